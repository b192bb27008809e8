"""A stale pose is not passed on."""

import numpy as np
import pytest

from drake_shared.systems.pose_watchdog import PoseWatchdog


def evaluate(age: float) -> tuple[np.ndarray, float]:
    watchdog = PoseWatchdog(timeout=0.2)
    context = watchdog.CreateDefaultContext()
    watchdog.GetInputPort("pose").FixValue(context, [1.0, 2.0, 0.5])
    watchdog.GetInputPort("pose_age").FixValue(context, [age])
    fresh = watchdog.GetOutputPort("fresh").Eval(context)[0]
    return watchdog.GetOutputPort("checked_pose").Eval(context), fresh


@pytest.mark.parametrize("age", [0.0, 0.2])
def test_a_fresh_pose_is_passed_on(age):
    pose, fresh = evaluate(age)
    np.testing.assert_array_equal(pose, [1.0, 2.0, 0.5])
    assert fresh == 1.0


@pytest.mark.parametrize("age", [0.21, np.inf, np.nan])
def test_a_stale_pose_becomes_nan(age):
    pose, fresh = evaluate(age)
    assert np.all(np.isnan(pose))
    assert fresh == 0.0


@pytest.mark.parametrize("timeout", [0.0, -1.0, np.nan, np.inf])
def test_the_timeout_must_be_positive_and_finite(timeout):
    with pytest.raises(ValueError, match="timeout"):
        PoseWatchdog(timeout=timeout)
