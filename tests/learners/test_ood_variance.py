"""Distance from all demonstrations is doubt, and grows without bound."""

import numpy as np
import pytest

from drake_shared.learners.ood_variance import Doubt

GRID = np.linspace(0.0, 2.0, 21)
PATHS = np.stack([np.stack([GRID, np.full(21, side)], axis=-1) for side in (1.0, -1.0)])


def doubt(time: float, x: float, y: float, **options) -> float:
    measure = Doubt(grid=GRID, demonstrations=PATHS, **{"reach": 0.2, "gain": 3.0, **options})
    return measure(np.array([time]), np.array([[x, y]]))


def test_there_is_none_within_reach_of_a_demonstration_at_its_time():
    assert doubt(1.0, 1.0, 1.0) == 0.0
    assert doubt(1.04, 1.04, -1.19) == 0.0


def test_beyond_it_grows_with_the_square_of_the_distance():
    assert doubt(1.0, 1.0, 1.5) == pytest.approx(3.0 * 0.3**2)
    assert doubt(1.0, 1.0, 101.0) == pytest.approx(3.0 * 99.8**2)


def test_between_two_demonstrations_the_nearer_counts():
    assert doubt(1.0, 1.0, 0.4) == pytest.approx(3.0 * 0.4**2)


def test_to_be_where_a_demonstration_was_at_another_time_is_doubt_too():
    assert doubt(0.0, 2.0, 1.0) == pytest.approx(3.0 * 1.8**2)


def test_beyond_the_ends_of_time_the_ends_count():
    assert doubt(-5.0, 0.0, 1.0) == 0.0
    assert doubt(50.0, 2.0, 1.0) == 0.0


def test_several_observations_add_their_mean():
    measure = Doubt(grid=GRID, demonstrations=PATHS, reach=0.2, gain=3.0)
    both = measure(np.array([1.0, 1.0]), np.array([[1.0, 1.0], [1.0, 1.5]]))
    assert both == pytest.approx(0.5 * 3.0 * 0.3**2)


def test_prefixes_are_the_doubts_after_each_observation():
    measure = Doubt(grid=GRID, demonstrations=PATHS, reach=0.2, gain=3.0)
    times, positions = np.array([1.0, 0.5, 2.0]), np.array([[1.0, 1.5], [0.5, 1.0], [2.0, 9.0]])
    counts = (1, 2, 3)
    assert measure.prefixes(times, positions) == [measure(times[:n], positions[:n]) for n in counts]
    assert measure.prefixes(times[:0], positions[:0]) == []


def test_without_gain_there_is_none_and_nan_stays_nan():
    assert doubt(1.0, 1.0, 9.0, gain=0.0) == 0.0
    assert np.isnan(doubt(np.nan, 1.0, 1.0))
    assert np.isnan(doubt(1.0, np.nan, 1.0))
