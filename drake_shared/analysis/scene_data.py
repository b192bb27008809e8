"""What the pictures of a task and of a prediction are drawn from, as JSON holds it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from drake_shared.robots import Arm
from drake_shared.scenario import Scenario
from drake_shared.scenario.obstacles import Circle, Obstacle
from drake_shared.systems.route_ribbons import Ribbon

# A tenth of a millimetre is less than a pixel shows.
_DIGITS = 4


def describe_task(scenario: Scenario) -> dict[str, Any]:
    """Workspace, start, goals, obstacles and sizes of the robot, in [m] and [rad], world frame."""
    space, start, robot = scenario.workspace, scenario.start, scenario.robot
    if isinstance(robot, Arm):
        x, y, _ = scenario.routes[0].waypoints[0]
        place = [x, y, 0.0]
        sizes = {"arm": True, "robot_radius": robot.link_radius, "height": space.z_max}
    else:
        place = [start.x, start.y, start.yaw]
        sizes = {
            "robot_radius": robot.footprint_radius,
            "wheel_radius": robot.wheel_radius,
            "track": robot.track,
        }
    return {
        "workspace": [space.x_min, space.x_max, space.y_min, space.y_max],
        "start": place,
        "goal": [scenario.goal.x, scenario.goal.y, scenario.goal.radius],
        "goals": describe_goals(scenario),
        # A table under an arm is the floor of the picture.
        "obstacles": [
            _describe_obstacle(item)
            for item in scenario.obstacles
            if not item.height or item.z + item.height > space.z_min
        ],
        **sizes,
    }


def describe_goals(scenario: Scenario) -> list[dict[str, Any]]:
    """Place, radius and label of each goal."""
    return [
        {"x": goal.x, "y": goal.y, "radius": goal.radius, "name": goal.name or "Goal"}
        for goal in scenario.all_goals
    ]


def _describe_obstacle(item: Obstacle) -> dict[str, Any]:
    place = {"name": item.name, "x": item.x, "y": item.y, "path": item.path}
    if isinstance(item, Circle):
        return place | {"radius": item.radius}
    return place | {"length": item.length, "width": item.width, "yaw": item.yaw}


def describe_routes(ribbons: Sequence[Ribbon]) -> list[dict[str, Any]]:
    """Each ribbon: ``probability``, ``center`` [[x, y], ...], ``half_width``, ``fade`` and ``marks``."""
    return [
        {
            "probability": round(ribbon.probability, 3),
            "center": ribbon.center[:, :2].round(_DIGITS).tolist(),
            "half_width": ribbon.half_width.round(_DIGITS).tolist(),
            "fade": ribbon.fade.round(2).tolist(),
            "marks": ribbon.marks.round(2).tolist(),
        }
        for ribbon in ribbons
    ]
