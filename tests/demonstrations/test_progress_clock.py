"""ProgressClock follows the robot along the demonstrations and never runs back."""

import math

import numpy as np
import pytest

from drake_shared.demonstrations import ProgressClock

TIMES = np.arange(0.0, 10.05, 0.1)
# Straight on at 0.5 m/s, and the same path a metre to the left.
STRAIGHT = np.stack([0.5 * TIMES, np.zeros_like(TIMES)], axis=-1)
CLOCK = ProgressClock(TIMES, np.stack([STRAIGHT, STRAIGHT + np.array([0.0, 1.0])]), tolerance=0.0)


def test_is_the_time_of_the_nearest_demonstrated_point():
    assert CLOCK.advance(2.0, 1.2, 0.05) == pytest.approx(2.4)
    assert CLOCK.advance(2.0, 1.2, 0.95) == pytest.approx(2.4)


def test_stands_while_the_robot_stands():
    reached = CLOCK.advance(2.0, 1.2, 0.0)
    for _ in range(100):
        reached = CLOCK.advance(reached, 1.2, 0.0)
    assert reached == pytest.approx(2.4)


def test_never_runs_back():
    assert CLOCK.advance(5.0, 1.2, 0.0) == 5.0


def test_looks_no_further_ahead_than_its_horizon():
    assert CLOCK.advance(2.0, 4.0, 0.0) == pytest.approx(3.0)
    wide = ProgressClock(TIMES, STRAIGHT[None], horizon=5.0)
    assert wide.advance(2.0, 2.0, 0.0) == pytest.approx(4.0, abs=0.1)


def test_stays_on_its_branch_where_the_path_crosses_itself():
    angle = 2 * np.pi * TIMES / TIMES[-1]
    eight = np.stack([np.sin(angle), np.sin(2 * angle)], axis=-1)
    clock = ProgressClock(TIMES, eight[None], tolerance=0.0)
    assert clock.advance(0.0, 0.0, 0.0) == pytest.approx(0.0)
    assert clock.advance(4.5, 0.0, 0.0) == pytest.approx(5.0)


def test_waits_for_a_driver_who_starts_late():
    reached = 0.0
    for _ in range(60):
        reached = CLOCK.advance(reached, 0.0, 0.0)
    assert reached == 0.0
    for x in np.arange(0.0, 2.0, 0.025):
        reached = CLOCK.advance(reached, x, 0.0)
        assert reached == pytest.approx(2 * x, abs=0.051)


def test_does_not_wait_where_the_demonstrations_linger():
    lingers = np.concatenate([np.zeros((30, 2)), STRAIGHT])[: len(TIMES)]
    clock = ProgressClock(TIMES, lingers[None], tolerance=0.03)
    reached = 0.0
    for _ in range(10):
        reached = clock.advance(reached, 0.0, 0.0)
    assert reached == pytest.approx(2.9, abs=0.2)


def test_stops_at_the_end_of_the_grid():
    assert CLOCK.advance(9.5, 50.0, 0.0) == pytest.approx(10.0)
    assert CLOCK.advance(10.0, 50.0, 0.0) == pytest.approx(10.0)


def test_keeps_its_time_where_the_position_is_nan():
    assert CLOCK.advance(3.0, math.nan, 0.0) == 3.0


@pytest.mark.parametrize("stretch", [1, 3, 10])
def test_does_not_run_away_from_a_robot_that_stands_where_demonstrations_are_slow(stretch):
    # The robot may be 3 cm ahead of the point it stands at, however long the demonstrations take for that.
    times = np.arange(0.0, 10.0 * stretch + 0.05, 0.1)
    slow = np.stack([0.5 * times / stretch, np.zeros_like(times)], axis=-1)
    clock = ProgressClock(times, slow[None], tolerance=0.03)
    reached = 0.0
    for _ in range(200):
        reached = clock.advance(reached, 0.0, 0.0)
    assert reached <= 0.06 * stretch + 0.1


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_positions_have_any_number_of_coordinates(size):
    line = TIMES[:, None] * np.linspace(0.3, 0.6, size)
    clock = ProgressClock(TIMES, np.stack([line, line + 1.0]), tolerance=0.0)
    assert clock.advance(2.0, *line[24]) == pytest.approx(2.4)
    assert clock.advance(2.0, *[math.nan] * size) == 2.0


@pytest.mark.parametrize("scale", [0.1, 10.0])
def test_scaled_with_its_tolerance_it_reads_the_same(scale):
    clock = ProgressClock(TIMES, scale * STRAIGHT[None], tolerance=scale * 0.03)
    plain = ProgressClock(TIMES, STRAIGHT[None], tolerance=0.03)
    for x in np.linspace(0.0, 1.0, 23):
        assert clock.advance(1.0, scale * x, 0.0) == pytest.approx(plain.advance(1.0, x, 0.0))
