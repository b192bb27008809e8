"""Setup of a quick benchmark, with one learner for all tests."""

import dataclasses
import math
from functools import cached_property

import pytest

from drake_shared.experiments.benchmark import common
from drake_shared.experiments.benchmark.common import Setup
from drake_shared.experiments.benchmark.results import GroupResult
from drake_shared.scenario import Scenario, load_scenario
from drake_shared.simulation.teaching import teach


class ShortSetup(Setup):
    """Trials of one second."""

    @cached_property
    def scenario(self) -> Scenario:
        return dataclasses.replace(load_scenario(), duration=1.0)

    @cached_property
    def route_demonstrations(self):
        return teach(load_scenario())


@pytest.fixture(scope="session")
def setup() -> Setup:
    return ShortSetup(quick=True, repeats=2)


@pytest.fixture
def trained(setup, monkeypatch) -> None:
    """Every other setup uses the learner of this one."""
    learner = setup.cnmp
    monkeypatch.setattr(common, "train_cnmp", lambda *arguments, **options: learner)


@pytest.fixture(scope="session")
def check_result():
    """Checks that a group's results are finite, positive and ordered."""

    def check(result: GroupResult) -> None:
        assert result.method
        assert result.ratios or result.curves
        spreads = [item.spread for item in result.ratios]
        spreads += [item for curve in result.curves for item in curve.seconds]
        spreads += result.seconds.values()
        for item in spreads:
            assert 0.0 < item.low <= item.median <= item.high < math.inf
            assert item.count >= 1
        for curve in result.curves:
            assert len(curve.sizes) == len(curve.seconds)
            assert math.isfinite(curve.exponent)
            assert math.isfinite(curve.last_exponent)
        assert all(result.absent.values())

    return check
