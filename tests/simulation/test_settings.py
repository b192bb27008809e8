"""The settings of one trial: their ranges, and how a log gives them back."""

import dataclasses
import math

import pytest

from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import Behaviour
from drake_shared.simulation.log import Trial
from drake_shared.simulation.settings import TrialSettings, settings_of_log


@pytest.mark.parametrize(
    ("field", "value"),
    [("driver", "robot"), ("seed", -1), ("seed", 2**32)]
    + [("confidence_gain", gain) for gain in (0.0, -1.0, math.inf, math.nan)],
)
def test_values_out_of_range_are_refused(field, value):
    with pytest.raises(InputError) as caught:
        TrialSettings(**{field: value})
    assert caught.value.field == field


@pytest.mark.parametrize("settings", [{"seed": 0}, {"seed": 2**32 - 1}, {"confidence_gain": 1e-9}])
def test_values_at_the_edge_are_accepted(settings):
    TrialSettings(**settings)


def test_a_log_gives_its_settings_back():
    settings = TrialSettings(
        driver="shared",
        seed=7,
        route="left_right",
        then="left_left",
        behaviour=Behaviour(noise=1.2),
        confidence_gain=50.0,
    )
    metadata = {
        "mode": settings.driver,
        "seed": settings.seed,
        "route": settings.route,
        "then": settings.then,
        "behaviour": dataclasses.asdict(settings.behaviour),
        "confidence_gain": settings.confidence_gain,
    }
    assert settings_of_log(Trial(columns={}, metadata=metadata)) == settings
    # A person's trial has no seed and no behaviour.
    assert settings_of_log(Trial(columns={}, metadata={"mode": "human"})) == TrialSettings(driver="human")


@pytest.mark.parametrize("metadata", [{}, {"mode": "shared", "behaviour": {"mood": 1.0}}])
def test_a_log_without_valid_settings_is_refused(metadata):
    with pytest.raises(InputError):
        settings_of_log(Trial(columns={}, metadata=metadata))
