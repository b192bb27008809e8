"""What does not move in the picture lies where the task has it."""

import numpy as np
import pytest

from drake_shared.simulation.scene_drawing import draw_path, draw_scene, look_from_above


class FakeMeshcat:
    """Notes what it is told."""

    def __init__(self):
        self.objects, self.places, self.lines, self.hidden, self.view = {}, {}, {}, set(), None

    def SetObject(self, path, shape, rgba):
        self.objects[path] = shape

    def SetTransform(self, path, X):
        self.places[path] = X.translation()

    def SetLine(self, path, vertices, line_width, rgba):
        self.lines[path] = vertices

    def SetProperty(self, path, name, value):
        if name == "visible" and not value:
            self.hidden.add(path)

    def Set2dRenderMode(self, X_WC, xmin, xmax, ymin, ymax):
        self.view = (xmin, xmax, ymin, ymax)

    def Delete(self, path):
        self.lines.pop(path, None)


@pytest.fixture
def meshcat() -> FakeMeshcat:
    return FakeMeshcat()


def test_start_and_goal_lie_where_they_are_and_the_goal_is_as_wide_as_it_counts(meshcat, scenario):
    draw_scene(meshcat, scenario)
    np.testing.assert_allclose(meshcat.places["scene_drawing/goal"][:2], [5.0, 0.0])
    np.testing.assert_allclose(meshcat.places["scene_drawing/start"][:2], [0.0, 0.0])
    assert meshcat.objects["scene_drawing/goal"].radius() == scenario.goal.radius


def test_the_floor_is_the_workspace(meshcat, scenario):
    draw_scene(meshcat, scenario)
    space, floor = scenario.workspace, meshcat.objects["scene_drawing/floor"]
    assert (floor.width(), floor.depth()) == pytest.approx((6.4, 3.2))
    np.testing.assert_allclose(meshcat.places["scene_drawing/floor"][:2], [2.5, 0.0], atol=1e-12)
    border = meshcat.lines["scene_drawing/border"]
    assert (border[0].min(), border[0].max()) == (space.x_min, space.x_max)
    np.testing.assert_array_equal(border[:, 0], border[:, -1])


def test_the_view_from_above_holds_the_workspace_and_a_margin(meshcat, scenario):
    look_from_above(meshcat, scenario, margin=0.1)
    assert meshcat.view == pytest.approx((-0.8, 5.8, -1.7, 1.7))


def test_the_way_is_a_line_through_the_positions(meshcat):
    positions = np.array([[0.0, 0.0], [1.0, 0.5], [2.0, 0.0]])
    draw_path(meshcat, positions)
    np.testing.assert_array_equal(meshcat.lines["path"][:2], positions.T)
    draw_path(meshcat, positions[:1])
    assert "path" not in meshcat.lines
