"""Curves: where they pass, how long they are, how they bend."""

import numpy as np
import pytest

from drake_shared.scenario.paths import Path, passing_side


def circle(radius: float, *, turn: float = 2 * np.pi, points: int = 41) -> np.ndarray:
    angle = np.linspace(0, turn, points)
    return radius * np.stack([np.sin(angle), 1 - np.cos(angle)], axis=-1)


def test_a_straight_path_is_as_long_as_it_is():
    path = Path(np.array([[0.0, 0.0], [3.0, 4.0]]))
    assert path.length == pytest.approx(5.0)
    np.testing.assert_allclose(path.position(np.array([2.5])), [[1.5, 2.0]], atol=1e-9)


def test_goes_through_its_waypoints():
    waypoints = np.array([[0.0, 0.0], [1.4, 0.8], [2.5, 0.0], [3.6, -0.8], [5.0, 0.0]])
    path = Path(waypoints)
    driven = path.position(np.linspace(0, path.length, 5000))
    for waypoint in waypoints:
        assert np.linalg.norm(driven - waypoint, axis=1).min() < 2e-3


def test_arc_length_is_the_distance_gone():
    path = Path(circle(1.5, turn=np.pi))
    assert path.length == pytest.approx(1.5 * np.pi, abs=1e-3)
    at = np.linspace(0, path.length, 200)
    gone = np.linalg.norm(np.diff(path.position(at), axis=0), axis=1)
    np.testing.assert_allclose(gone, at[1], rtol=1e-3)


def test_stays_at_its_ends():
    path = Path(np.array([[0.0, 0.0], [1.0, 0.0]]))
    np.testing.assert_allclose(path.position(np.array([-1.0, 9.0])), [[0, 0], [1, 0]], atol=1e-12)


def test_frame_of_a_circle_has_its_tangent_and_its_curvature():
    path = Path(circle(2.0, turn=1.5 * np.pi), heading=0.0)
    for angle in (0.5, 1.5, 3.0, 4.0):
        x, y, direction, curvature = path.frame(2.0 * angle)
        assert (x, y) == pytest.approx((2 * np.sin(angle), 2 - 2 * np.cos(angle)), abs=5e-3)
        assert direction == pytest.approx(angle, abs=5e-3)
        assert curvature == pytest.approx(0.5, abs=5e-3)


def test_direction_goes_on_through_a_whole_turn_without_a_jump():
    path = Path(circle(1.0, turn=2.5 * np.pi))
    directions = [path.frame(at)[2] for at in np.linspace(0, path.length, 500)]
    assert np.abs(np.diff(directions)).max() < 0.05
    assert directions[-1] == pytest.approx(2.5 * np.pi, abs=0.1)


@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5])
def test_leaves_in_the_direction_given(heading):
    path = Path(np.array([[0.0, 0.0], [1.0, 0.5], [2.0, 0.0]]), heading=heading)
    assert np.angle(np.exp(1j * (path.frame(0.0)[2] - heading))) == pytest.approx(0.0, abs=1e-9)


def test_nearest_point_of_a_straight_line_is_the_foot_of_the_perpendicular():
    path = Path(np.array([[0.0, 0.0], [4.0, 0.0]]))
    assert path.nearest(1.25, 0.7, between=(0.0, 4.0)) == pytest.approx(1.25, abs=5e-3)


def test_nearest_point_is_looked_for_in_the_interval_alone():
    path = Path(np.array([[0.0, 0.0], [4.0, 0.0]]))
    assert path.nearest(1.0, 0.0, between=(2.0, 2.5)) == pytest.approx(2.0, abs=5e-3)
    assert path.nearest(3.0, 0.0, between=(2.0, 2.5)) == pytest.approx(2.5, abs=5e-3)
    assert path.nearest(9.0, 0.0, between=(4.0, 4.3)) == pytest.approx(4.0, abs=5e-3)


def test_where_a_path_crosses_itself_the_interval_says_which_branch_is_meant():
    path = Path(circle(1.0))
    assert path.nearest(0.0, 0.0, between=(0.0, 1.0)) == pytest.approx(0.0, abs=0.01)
    assert path.nearest(0.0, 0.0, between=(5.0, path.length)) == pytest.approx(path.length, abs=0.01)


STRAIGHT = np.stack([np.linspace(-2, 2, 50), np.zeros(50)], axis=-1)


@pytest.mark.parametrize(
    ("point", "side"), [((0.0, -0.5), "left"), ((0.0, 0.5), "right"), ((1.0, -0.01), "left")]
)
def test_passing_with_the_point_to_the_right_hand_is_passing_on_the_left(point, side):
    assert passing_side(STRAIGHT, point) == side


def test_the_way_back_passes_on_the_same_hand():
    assert passing_side(STRAIGHT[::-1], (0.0, 0.5)) == "left"


def test_turning_the_world_does_not_change_the_side():
    for angle in np.linspace(0, 2 * np.pi, 9):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        assert passing_side(STRAIGHT @ turn.T, tuple(turn @ (0.3, 0.4))) == "right"


@pytest.mark.parametrize("point", [(2.0, 0.4), (2.5, 0.4), (-2.0, 0.4), (-3.0, 0.4)])
def test_a_centimetre_does_not_change_the_side_of_a_point_beside_or_beyond_an_end(point):
    swerves = STRAIGHT + np.stack([np.zeros(50), 0.05 * np.sin(np.linspace(0, 9, 50))], axis=-1)
    for end in (-0.01, 0.01):
        swerves[-1, 1] = end
        assert passing_side(swerves, point) == "right"


def test_a_loop_beside_the_way_does_not_matter():
    loop = np.stack([np.sin(np.linspace(0, 2 * np.pi, 60)), np.cos(np.linspace(0, 2 * np.pi, 60)) - 1], -1)
    wanders = np.concatenate([STRAIGHT[:25], 0.2 * loop, STRAIGHT[25:]])
    assert passing_side(wanders, (0.0, 0.5)) == passing_side(STRAIGHT, (0.0, 0.5))


def test_turning_back_to_pass_on_the_other_side_counts_as_the_other_side():
    left = np.array([[-2.0, 0.3], [0.0, 0.6], [0.5, 0.6], [0.0, 0.6], [-1.0, 0.3], [-1.0, -0.3], [0.0, -0.6]])
    assert passing_side(np.vstack([left, [[2.0, 0.0]]]), (0.0, 0.0)) == "right"


def test_a_long_road_has_no_more_points_than_its_waypoints_ask_for():
    short, long, longer = (Path(np.array([[0.0, 0.0], [length, 0.0]])) for length in (80.0, 4e3, 4e4))
    assert short.spacing == pytest.approx(0.005)
    assert len(long.frames) == len(longer.frames) <= 20_001
    assert long.length == pytest.approx(4e3)
    assert long.nearest(2e3, 3.0, between=(1.9e3, 2.1e3)) == pytest.approx(2e3, abs=long.spacing)


def test_a_long_road_with_many_turns_keeps_its_shape():
    turns = 300
    x = np.arange(turns + 1) * 2.0
    path = Path(np.stack([x, np.where(np.arange(turns + 1) % 2, 0.5, -0.5)], axis=-1))
    driven = path.position(np.linspace(0.0, path.length, 400_000))
    crests = driven[:, 1].max(), driven[:, 1].min()
    # The ends of the spline are free and swing further out.
    assert np.abs(np.array(crests)).max() < 0.7
    for waypoint in ([2.0, 0.5], [300.0, -0.5]):
        assert np.linalg.norm(driven - waypoint, axis=1).min() < 5e-3
