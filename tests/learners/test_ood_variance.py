"""Distance from all demonstrations adds to the variance, without bound."""

import numpy as np
import pytest

from drake_shared.learners.ood_variance import OodVariance

GRID = np.linspace(0.0, 2.0, 21)
PATHS = np.stack([np.stack([GRID, np.full(21, side)], axis=-1) for side in (1.0, -1.0)])


def added(time: float, x: float, y: float, **options) -> float:
    measure = OodVariance(grid=GRID, demonstrations=PATHS, **{"reach": 0.2, "gain": 3.0, **options})
    return measure(np.array([time]), np.array([[x, y]]))


def test_is_zero_within_reach_of_a_demonstration_at_its_time():
    assert added(1.0, 1.0, 1.0) == 0.0
    assert added(1.04, 1.04, -1.19) == 0.0


def test_beyond_it_grows_with_the_square_of_the_distance():
    assert added(1.0, 1.0, 1.5) == pytest.approx(3.0 * 0.3**2)
    assert added(1.0, 1.0, 101.0) == pytest.approx(3.0 * 99.8**2)


def test_between_two_demonstrations_the_nearer_counts():
    assert added(1.0, 1.0, 0.4) == pytest.approx(3.0 * 0.4**2)


def test_a_demonstrated_position_at_another_time_is_far_too():
    assert added(0.0, 2.0, 1.0) == pytest.approx(3.0 * 1.8**2)


def test_times_outside_the_grid_count_as_its_ends():
    assert added(-5.0, 0.0, 1.0) == 0.0
    assert added(50.0, 2.0, 1.0) == 0.0


def test_several_observations_add_their_mean():
    measure = OodVariance(grid=GRID, demonstrations=PATHS, reach=0.2, gain=3.0)
    both = measure(np.array([1.0, 1.0]), np.array([[1.0, 1.0], [1.0, 1.5]]))
    assert both == pytest.approx(0.5 * 3.0 * 0.3**2)


def test_prefixes_are_the_values_after_each_observation():
    measure = OodVariance(grid=GRID, demonstrations=PATHS, reach=0.2, gain=3.0)
    times, positions = np.array([1.0, 0.5, 2.0]), np.array([[1.0, 1.5], [0.5, 1.0], [2.0, 9.0]])
    counts = (1, 2, 3)
    assert measure.prefixes(times, positions) == [measure(times[:n], positions[:n]) for n in counts]
    assert measure.prefixes(times[:0], positions[:0]) == []


def test_a_table_has_the_values_of_each_row():
    measure = OodVariance(grid=GRID, demonstrations=PATHS, reach=0.2, gain=3.0)
    rng = np.random.default_rng(0)
    times = np.array([-3.0, 0.0, 0.03, 0.77, 1.0, 1.96, 2.0, 8.0])
    index = rng.integers(len(times), size=(40, 2))
    positions = np.stack([times[index].clip(0.0, 2.0), rng.uniform(-3.0, 3.0, (40, 2))], axis=-1)
    expected = [measure.prefixes(times[row], shown) for row, shown in zip(index, positions, strict=True)]
    np.testing.assert_allclose(measure.table(times)(index, positions), expected, rtol=1e-12)


def test_is_zero_without_gain_and_nan_for_nan():
    assert added(1.0, 1.0, 9.0, gain=0.0) == 0.0
    assert np.isnan(added(np.nan, 1.0, 1.0))
    assert np.isnan(added(1.0, np.nan, 1.0))


@pytest.mark.parametrize("size", [1, 3])
def test_distance_is_euclidean_for_any_number_of_coordinates(size):
    paths = np.zeros((1, 21, size))
    measure = OodVariance(grid=GRID, demonstrations=paths, reach=0.2, gain=3.0)
    away = np.full((1, size), 1.0)
    assert measure(np.array([1.0]), away) == pytest.approx(3.0 * (np.sqrt(size) - 0.2) ** 2)
