"""Draws what does not move in Meshcat: floor, workspace, start, goal, camera, and the path of a trial."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Box, Cylinder, Meshcat, Rgba
from pydrake.math import RigidTransform

from drake_shared.scenario import Scenario

_FLOOR = Rgba(0.98, 0.98, 0.97, 1.0)
_BORDER = Rgba(0.62, 0.64, 0.66, 1.0)
_START = Rgba(0.80, 0.25, 0.22, 1.0)
_GOAL = Rgba(0.10, 0.62, 0.38, 1.0)
_PATH = Rgba(0.25, 0.27, 0.30, 1.0)
GHOST = Rgba(0.70, 0.52, 0.20, 1.0)
"""Colour of a path that is shown for comparison."""


def draw_scene(meshcat: Meshcat, scenario: Scenario) -> None:
    """Draws floor, workspace, start (red) and goal (green) of ``scenario``, and sets the light."""
    space = scenario.workspace
    width, depth = space.x_max - space.x_min, space.y_max - space.y_min
    middle = np.array([(space.x_min + space.x_max) / 2, (space.y_min + space.y_max) / 2])
    meshcat.SetObject("scene_drawing/floor", Box(width, depth, 0.002), _FLOOR)
    meshcat.SetTransform("scene_drawing/floor", RigidTransform([*middle, 0.0]))
    corners = [
        (space.x_min, space.y_min),
        (space.x_max, space.y_min),
        (space.x_max, space.y_max),
        (space.x_min, space.y_max),
        (space.x_min, space.y_min),
    ]
    border = np.array([(x, y, 0.004) for x, y in corners]).T
    meshcat.SetLine("scene_drawing/border", border, 2.0, _BORDER)
    meshcat.SetObject("scene_drawing/goal", Cylinder(scenario.goal.radius, 0.004), _GOAL)
    meshcat.SetTransform("scene_drawing/goal", RigidTransform([scenario.goal.x, scenario.goal.y, 0.003]))
    meshcat.SetObject("scene_drawing/start", Cylinder(0.08, 0.004), _START)
    meshcat.SetTransform("scene_drawing/start", RigidTransform([scenario.start.x, scenario.start.y, 0.003]))
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetProperty("/Background", "visible", True)
    for end in ("top_color", "bottom_color"):
        meshcat.SetProperty("/Background/<object>", end, [0.90, 0.91, 0.92])
    # Even light: seen from above, a lamp paints a bright spot on the floor.
    for lamp in ("PointLightNegativeX", "PointLightPositiveX", "SpotLight", "FillLight"):
        meshcat.SetProperty(f"/Lights/{lamp}", "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 2.7)


def look_from_above(meshcat: Meshcat, scenario: Scenario, *, margin: float = 0.1) -> None:
    """Sets an orthographic view from above, x to the right and y up.

    Args:
        meshcat: Shows the scenario.
        scenario: Gives the workspace.
        margin: Space around the workspace, in [m].
    """
    space = scenario.workspace
    meshcat.Set2dRenderMode(
        RigidTransform([0, 0, 5]),
        space.x_min - margin,
        space.x_max + margin,
        space.y_min - margin,
        space.y_max + margin,
    )


def draw_path(meshcat: Meshcat, positions: np.ndarray, name: str = "path", colour: Rgba = _PATH) -> None:
    """Draws a path on the floor; fewer than two points delete it.

    Args:
        meshcat: Shows the path.
        positions: Shape (n, 2), in [m], world frame.
        name: Of the path in Meshcat.
        colour: Of the line.
    """
    if len(positions) < 2:
        meshcat.Delete(name)
        return
    line = np.column_stack([positions, np.full(len(positions), 0.012)]).T
    meshcat.SetLine(name, line, 3.0, colour)
