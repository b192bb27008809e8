"""Displacements of an obstacle on a known path."""

import numpy as np
import pytest

from drake_shared.arbitration.safety.braking_paths import BrakingPaths
from drake_shared.arbitration.safety.obstacle_motion import ObstacleMotion
from drake_shared.robots import DiffDrive

PERIOD, HORIZON = 0.05, 0.9


def make(times=(-1.0, 0.4, 2.0), positions=(0.0, 1.4 + 1.4j, 1.4 - 0.2j), horizon=HORIZON) -> ObstacleMotion:
    """Moves at 1 m/s along x and y until 0.4 s from now, then at 1 m/s against y."""
    return ObstacleMotion(np.array(times), np.array(positions), period=PERIOD, horizon=horizon)


def test_displacements_count_from_the_present_position():
    displacements = make().displacement([-2.0, 0.0, 0.2, 0.4, 0.9, 2.0, 9.0])
    expected = [-1.0 - 1.0j, 0.0, 0.2 + 0.2j, 0.4 + 0.4j, 0.4 - 0.1j, 0.4 - 1.2j, 0.4 - 1.2j]
    np.testing.assert_allclose(displacements, expected, atol=1e-12)
    assert make().displacement(0.2) == pytest.approx(0.2 + 0.2j)


def test_the_largest_displacement_is_that_within_the_horizon():
    # At the turn, not at the end; and where the path is straight, at the end.
    assert make().largest_displacement == pytest.approx(0.4 * 2.0**0.5)
    assert make(horizon=0.3).largest_displacement == pytest.approx(0.3 * 2.0**0.5)
    assert make(positions=(1.0, 1.0, 1.0)).largest_displacement == 0.0


def test_a_stopped_obstacle_stays_where_it_is():
    motion = make()
    motion.stop_at(0.1)
    np.testing.assert_allclose(motion.displacement([0.05, 0.1, 0.5]), [0.05 + 0.05j] + 2 * [0.1 + 0.1j])


def test_along_a_path_the_displacements_at_its_times_and_a_period_earlier_count():
    paths = BrakingPaths(DiffDrive(), (0.0, 0.0, 0.0), (6.0, 6.0), [(6.0, 6.0), (5.5, 6.5)], PERIOD)
    motion = make()
    times = paths.times()
    displacements = motion.displacements_along(paths)
    assert displacements.shape[1:] == times.shape
    since, until = displacements[:2]
    np.testing.assert_allclose(since, motion.displacement(np.maximum(times - PERIOD, 0.0)), atol=1e-12)
    np.testing.assert_allclose(until[:, :-1], motion.displacement(times[:, :-1]), atol=1e-12)
    # At rest the robot waits until the horizon.
    np.testing.assert_allclose(until[:, -1], motion.displacement(HORIZON), atol=1e-12)


def test_between_the_nodes_no_displacement_is_farther_along_any_direction():
    paths = BrakingPaths(DiffDrive(), (0.0, 0.0, 0.0), (6.0, 6.0), [(6.0, 6.0)], PERIOD)
    times = paths.times()[0]
    for turn in (0.001, 0.1, 0.2, 0.4, 0.7):
        motion = make(times=(-1.0, turn, 2.0))
        displacements = motion.displacements_along(paths)[:, 0]
        for direction in (1.0, 1.0j, -1.0j, np.exp(0.5j)):
            along = (displacements * np.conj(direction)).real.max(axis=0)
            for moment in np.linspace(0.0, times[-1], 200):
                for earlier in (moment, max(moment - PERIOD, 0.0)):
                    moved = (complex(motion.displacement(earlier)) * np.conj(direction)).real
                    assert moved <= np.interp(moment, times, along) + 1e-12


@pytest.mark.parametrize("turn", [0.02, 0.1, 0.3])
def test_a_turn_of_the_obstacle_counts_at_both_ends_of_the_pieces_that_the_robot_is_on_then(turn):
    paths = BrakingPaths(DiffDrive(), (0.0, 0.0, 0.0), (6.0, 6.0), [(6.0, 6.0)], PERIOD)
    motion = make(times=(-1.0, turn, 2.0))
    times = paths.times()[0]
    _, until, at_turn = motion.displacements_along(paths)[:, 0]
    # The plant may lag behind by a period.
    begins, ends = np.maximum(times[:-1] - PERIOD, 0.0), np.append(times[1:-1], HORIZON)
    on_piece = (begins <= turn) & (turn <= ends)
    counts = np.append(on_piece, False) | np.append(False, on_piece)
    assert 0 < counts.sum() < len(counts)
    np.testing.assert_allclose(at_turn, np.where(counts, motion.displacement(turn), until), atol=1e-12)


def test_a_stop_changes_the_displacements_along_a_path():
    paths = BrakingPaths(DiffDrive(), (0.0, 0.0, 0.0), (6.0, 6.0), [(6.0, 6.0)], PERIOD)
    motion = make()
    before = motion.displacements_along(paths)
    np.testing.assert_array_equal(motion.displacements_along(paths), before)
    motion.stop_at(0.0)
    np.testing.assert_array_equal(motion.displacements_along(paths), np.zeros_like(before))


def test_another_path_has_displacements_of_its_own():
    motion, robot = make(), DiffDrive()
    slow, fast = (
        BrakingPaths(robot, (0.0, 0.0, 0.0), wheels, [wheels], PERIOD) for wheels in ((1.0, 1.0), (6.0, 6.0))
    )
    for paths in (slow, fast, slow):
        np.testing.assert_allclose(
            motion.displacements_along(paths)[1, :, :-1], motion.displacement(paths.times()[:, :-1])
        )
