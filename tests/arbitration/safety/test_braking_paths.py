"""Paths of one period under a command and full braking after it, compared with the plant's exact motion."""

import math

import numpy as np
import pytest

from drake_shared.arbitration.safety.braking_paths import BrakingPaths
from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import motion, speeds_after

ROBOT = DiffDrive()
PERIOD = 0.05
CHANGE = ROBOT.max_wheel_acceleration * PERIOD
POSE = (0.3, -1.2, 2.0)
# Wheels and commands: both wheels ramp, one holds, a wheel turns back, both stand.
CASES = [
    ((8.0, 3.0), (7.6, 3.7)),
    ((-5.0, 9.0), (-5.0, 9.5)),
    ((0.2, -0.3), (-0.4, 0.3)),
    ((12.0, 12.0), (12.0, 12.0)),
    ((0.0, 0.0), (0.0, 0.0)),
    ((-6.0, -2.0), (-6.0 + CHANGE, -2.0 - CHANGE)),
]


def state_at(wheels, command, time: float):
    """Pose and wheel speeds at a time on such a path, by the exact motion."""
    in_period = min(time, PERIOD)
    pose, reached = (
        motion(ROBOT, POSE, wheels, command, in_period)[-1] if in_period else POSE,
        speeds_after(ROBOT, wheels, command, in_period),
    )
    if time <= PERIOD:
        return pose, reached
    still = (0.0, 0.0)
    return (
        motion(ROBOT, pose, reached, still, time - PERIOD)[-1],
        speeds_after(ROBOT, reached, still, time - PERIOD),
    )


@pytest.mark.parametrize(("wheels", "command"), CASES)
def test_points_are_on_the_exact_path_at_their_times(wheels, command):
    paths = BrakingPaths(ROBOT, POSE, wheels, [command], PERIOD)
    (times,), (points,) = paths.times(), paths.points
    expected = [complex(*state_at(wheels, command, time)[0][:2]) for time in times]
    np.testing.assert_allclose(points, expected, rtol=0, atol=2e-6)
    assert (np.diff(times) >= 0.0).all()
    np.testing.assert_allclose(np.diff(times), paths.durations[0], atol=1e-15)
    assert times[0] == 0.0
    assert times[3] == pytest.approx(PERIOD)
    assert times[-1] == pytest.approx(PERIOD + max(map(abs, command)) / ROBOT.max_wheel_acceleration)


@pytest.mark.parametrize(("wheels", "command"), CASES)
def test_tangents_are_the_velocities_at_both_ends_of_a_piece_times_its_duration(wheels, command):
    paths = BrakingPaths(ROBOT, POSE, wheels, [command], PERIOD)
    times, durations, pieces = paths.times()[0], paths.durations[0], paths.durations.shape[1]
    states = [state_at(wheels, command, time) for time in times]
    velocities = np.array(
        [ROBOT.twist(*speeds)[0] * np.array([math.cos(yaw), math.sin(yaw)]) for (_, _, yaw), speeds in states]
    )
    points, begins, ends = np.split(paths.points_and_tangents[0], [pieces + 1, 2 * pieces + 1])
    np.testing.assert_array_equal(points, np.stack([paths.points[0].real, paths.points[0].imag], axis=-1))
    np.testing.assert_allclose(begins, -durations[:, None] * velocities[:-1], atol=1e-9)
    np.testing.assert_allclose(ends, durations[:, None] * velocities[1:], atol=1e-9)


def test_paths_of_several_commands_are_those_of_each():
    wheels, commands = (3.0, 2.0), [(3.5, 1.5), (2.6, 2.4)]
    together = BrakingPaths(ROBOT, POSE, wheels, commands, PERIOD)
    for index, command in enumerate(commands):
        alone = BrakingPaths(ROBOT, POSE, wheels, [command], PERIOD)
        np.testing.assert_allclose(together.points[index], alone.points[0], atol=1e-14)
        np.testing.assert_allclose(
            together.points_and_tangents[index], alone.points_and_tangents[0], atol=1e-14
        )
        np.testing.assert_allclose(together.times()[index], alone.times()[0], atol=1e-14)
