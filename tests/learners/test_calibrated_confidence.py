"""A calibrated confidence is the probability that a forecast is correct."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.learners.calibrated_confidence import (
    CALIBRATION_KEY,
    CalibratedConfidence,
    CalibratedForecasts,
    OpenWay,
)

GRID = np.linspace(0.0, 10.0, 11)
LEFT = np.stack([GRID, 0.1 * GRID], axis=-1)
RIGHT = LEFT * (1.0, -1.0)
CALIBRATION = CalibratedConfidence(
    log_ratio=(0.0, 1.0), probability=(0.9, 0.5), open_ways=((OpenWay(until=4.0, alike=2),), ())
)


def with_calibration(learner, data):
    return dataclasses.replace(learner, metadata={**learner.metadata, CALIBRATION_KEY: data})


def test_between_its_points_it_is_linear_in_the_logarithm_and_beyond_them_it_falls_as_the_ratio_grows():
    ratio = np.array([0.0, 1.0, 10.0**0.5, 10.0, 100.0, np.inf])
    np.testing.assert_allclose(CALIBRATION.on_demonstrated(ratio), [0.9, 0.9, 0.7, 0.5, 0.05, 0.0])
    assert np.isnan(CALIBRATION.on_demonstrated(np.array([np.nan]))).all()


def test_a_way_that_was_never_demonstrated_takes_its_share_until_it_is_passed():
    forecasts = CalibratedForecasts(CALIBRATION, GRID, np.stack([LEFT, RIGHT]))
    # Both forecasts begin at entry 4 of the grid; the second is known from entry 5 on.
    found = forecasts(np.ones(2), np.stack([LEFT[4:], LEFT[4:]]), 4, np.array([4, 5]))
    np.testing.assert_allclose(found, [0.9 * 2.0 / 2.3, 0.9])
    np.testing.assert_allclose(forecasts(np.ones(1), RIGHT[None, 4:], 4, np.array([4])), [0.9])


def test_a_learner_keeps_its_calibration_in_its_metadata(learner):
    assert CalibratedConfidence.from_learner(learner) is None
    ways = ((OpenWay(until=1.0, alike=1),), ())
    calibration = dataclasses.replace(CALIBRATION, open_ways=ways)
    found = CalibratedConfidence.from_learner(with_calibration(learner, calibration.to_json()))
    assert found == calibration


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("log_ratio", [1.0, 0.0]),
        ("log_ratio", [0.0, float("nan")]),
        ("log_ratio", "01"),
        ("probability", [0.9, 1.5]),
        ("probability", None),
        ("open_ways", [[]]),
        ("open_ways", [[{"until": 1.0}], []]),
        ("open_ways", [[{"until": 1.0, "alike": 0}], []]),
    ],
)
def test_a_calibration_that_is_not_valid_is_refused(learner, field, value):
    with pytest.raises(InputError) as caught:
        CalibratedConfidence.from_learner(with_calibration(learner, {**CALIBRATION.to_json(), field: value}))
    assert caught.value.field == field
