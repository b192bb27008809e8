"""A setting for a quick benchmark, with one learner for all tests."""

import math

import pytest
from threadpoolctl import threadpool_limits

from drake_shared.experiments.benchmark import test_tasks as setting_module
from drake_shared.experiments.benchmark.predict import one_torch_thread
from drake_shared.experiments.benchmark.results import GroupResult
from drake_shared.experiments.benchmark.test_tasks import Setting


@pytest.fixture(autouse=True, scope="session")
def _one_thread():
    """A second one makes networks this small slower, on a machine in use by far."""
    with one_torch_thread(), threadpool_limits(1):
        yield


@pytest.fixture(scope="session")
def setting() -> Setting:
    return Setting(quick=True, repeats=2)


@pytest.fixture
def trained(setting, monkeypatch) -> None:
    """Every other setting takes the learner of this one rather than training its own."""
    learner = setting.cnmp
    monkeypatch.setattr(setting_module, "train_briefly", lambda *arguments, **options: learner)


@pytest.fixture(scope="session")
def check_result():
    """Makes sure that what a group found can be read: finite, positive, in order."""

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
