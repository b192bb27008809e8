"""The geometry of the predicted routes."""

import math

import numpy as np
import pytest

from drake_shared.learners import Modes
from drake_shared.robots import Arm, DiffDrive
from drake_shared.systems.intention import Intention
from drake_shared.systems.route_ribbons import POINTS, route_ribbons

ROBOT = DiffDrive()
TIMES = np.arange(0.0, 10.05, 0.1)


def straight(sigma=(0.01, 0.05), y: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of a drive along x at 0.5 m/s, after the start."""
    mean = np.stack([0.5 * TIMES[1:], np.full(len(TIMES) - 1, y)], axis=-1)
    return mean, np.broadcast_to(np.square(sigma), mean.shape)


def ribbons_of(*routes, probability=None):
    mean, variance = straight()
    whole = np.concatenate([[[math.nan, math.nan]], mean]), np.concatenate([variance[:1], variance])
    intention = Intention(time=0.0, times=TIMES, mean=whole[0], variance=whole[1], first=1)
    modes = None
    if routes:
        means, variances = (np.stack(values) for values in zip(*routes, strict=True))
        shares = np.full(len(routes), 1 / len(routes)) if probability is None else np.array(probability)
        modes = Modes(probability=shares, mean=means, variance=variances, aim=0)
    return route_ribbons(intention, modes, position=(0.0, 0.0), robot=ROBOT)


def test_it_is_twice_as_wide_to_each_side_as_the_standard_deviation_across_the_path():
    (ribbon,) = ribbons_of(straight(sigma=(0.09, 0.04)))
    np.testing.assert_allclose(ribbon.half_width[5:], 0.08)


@pytest.mark.parametrize("angle", [0.5 * math.pi, 0.6, -0.6, 2.5, -2.5])
def test_only_the_spread_across_the_path_counts_whatever_its_direction(angle):
    mean = straight()[0][:, :1] * [math.cos(angle), math.sin(angle)]
    (ribbon,) = ribbons_of((mean, np.broadcast_to(np.square([0.09, 0.04]), mean.shape)))
    across = math.hypot(0.09 * math.sin(angle), 0.04 * math.cos(angle))
    np.testing.assert_allclose(ribbon.half_width[5:], 2.0 * across)


@pytest.mark.parametrize(("sigma", "half_width"), [(0.001, 0.03), (0.02, 0.04), (0.14, 0.28), (0.2, 0.30)])
def test_its_half_width_is_at_least_3_cm_and_at_most_30_cm_and_grows_to_that_from_the_robot(
    sigma, half_width
):
    (ribbon,) = ribbons_of(straight(sigma=(sigma, sigma)))
    np.testing.assert_allclose(ribbon.half_width[4:], half_width)
    np.testing.assert_allclose(ribbon.half_width[:5], np.linspace(0.03, half_width, 5))


@pytest.mark.parametrize(
    ("sigma", "fade"), [(0.05, 1.0), (0.1, 1.0), (0.2, 0.2 / 0.95), (0.4, 0.0125 / 0.95)]
)
def test_it_fades_by_the_square_of_a_spread_of_more_than_10_cm(sigma, fade):
    (ribbon,) = ribbons_of(straight(sigma=(sigma, sigma)))
    np.testing.assert_allclose(ribbon.fade, fade)


@pytest.mark.parametrize(("length", "count"), [(0.049, 0), (0.051, 1)])
def test_a_path_of_less_than_5_cm_is_not_shown(length, count):
    mean, variance = straight()
    assert len(ribbons_of((mean * length / mean[-1, 0], variance))) == count


def test_the_end_of_a_path_on_which_the_robot_rests_has_no_marks():
    mean, variance = straight()
    (ribbon,) = ribbons_of((np.minimum(mean, 2.04), variance))
    at = np.interp(ribbon.marks, np.arange(POINTS), ribbon.center[:, 0])
    np.testing.assert_allclose(at, [0.5, 1.0, 1.5])


def test_it_begins_at_the_robot_and_is_evenly_spaced():
    (ribbon,) = ribbons_of()
    assert ribbon.center.shape == (POINTS, 2)
    np.testing.assert_array_equal(ribbon.center[0], [0.0, 0.0])
    np.testing.assert_allclose(np.diff(ribbon.center[:, 0]), 5.0 / (POINTS - 1))


def test_there_is_a_mark_for_each_second():
    (ribbon,) = ribbons_of()
    at = np.interp(ribbon.marks, np.arange(POINTS), ribbon.center[:, 0])
    np.testing.assert_allclose(at, 0.5 * np.arange(1, 10))


def test_where_nothing_is_known_it_fades_and_does_not_grow():
    mean, variance = straight()
    growing = np.square(np.linspace(0.01, 2.0, len(mean)))[:, None] * [1.0, 1.0]
    (ribbon,) = ribbons_of((mean, growing))
    assert ribbon.half_width.max() <= 0.30
    assert np.all(np.diff(ribbon.fade) <= 0.0)
    assert ribbon.fade[0] == 1.0
    assert ribbon.fade[-1] == 0.0
    assert ribbons_of((mean, np.full_like(variance, 4.0))) == []


def test_routes_that_no_longer_differ_are_one():
    same = ribbons_of(straight(y=0.02), straight(y=-0.02), straight(y=1.0), probability=[0.3, 0.3, 0.4])
    assert [ribbon.probability for ribbon in same] == pytest.approx([0.6, 0.4])
    # They are one if they stay within 15 cm all along.
    assert len(ribbons_of(straight(y=0.0), straight(y=0.149))) == 1
    assert len(ribbons_of(straight(y=0.0), straight(y=0.151))) == 2


def test_the_most_probable_route_comes_first_and_improbable_ones_are_left_out():
    shown = ribbons_of(straight(y=-1.0), straight(y=0.0), straight(y=1.0), probability=[0.01, 0.29, 0.7])
    assert [ribbon.center[-1, 1] for ribbon in shown] == [1.0, 0.0]
    assert len(ribbons_of(straight(), straight(y=1.0), probability=[0.971, 0.029])) == 1
    assert len(ribbons_of(straight(), straight(y=1.0), probability=[0.969, 0.031])) == 2


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_prediction_that_is_not_finite_is_left_out(value):
    mean, variance = straight()
    assert ribbons_of((np.full_like(mean, value), variance), (mean, np.full_like(variance, value))) == []


def test_at_the_goal_nothing_is_left_to_show():
    mean, variance = straight()
    assert ribbons_of((0.0 * mean, variance)) == []


def test_a_path_straight_up_is_as_narrow_as_any_is():
    mean = np.array([0.4, 0.1, 0.2]) + np.linspace(0.02, 0.4, 20)[:, None] * [0.0, 0.0, 1.0]
    intention = Intention(
        time=0.0, times=0.1 * np.arange(1.0, 21.0), mean=mean, variance=np.full_like(mean, 0.01), first=0
    )
    (ribbon,) = route_ribbons(intention, None, position=(0.4, 0.1, 0.2), robot=Arm())
    np.testing.assert_array_equal(ribbon.half_width, ribbon.half_width.min())
    np.testing.assert_array_equal(ribbon.fade, 1.0)


def test_lengths_scale_with_the_robot():
    mean, variance = straight()
    small = DiffDrive(footprint_radius=0.0267, wheel_radius=0.00975, track=0.033)
    intention = Intention(
        time=0.0,
        times=TIMES,
        mean=0.1 * np.concatenate([[[0.0, 0.0]], mean]),
        variance=0.01 * np.concatenate([variance[:1], variance]),
        first=1,
    )
    (ribbon,) = route_ribbons(intention, None, position=(0.0, 0.0), robot=small)
    (reference,) = ribbons_of()
    np.testing.assert_allclose(ribbon.half_width, 0.1 * reference.half_width)
    np.testing.assert_allclose(ribbon.fade, reference.fade)
