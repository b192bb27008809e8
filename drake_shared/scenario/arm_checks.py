"""Checks that an arm can do the task of a scenario."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import SceneGraph
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from pydrake.systems.rendering import MultibodyPositionToGeometryPose

from drake_shared.common.errors import InputError
from drake_shared.robots import Arm
from drake_shared.robots.arm_model import ArmModel, rotation_vector
from drake_shared.robots.velocity_ik import VelocityIk
from drake_shared.scenario.obstacles import ObstacleDistance, register_obstacles
from drake_shared.scenario.scenario import Goal, Scenario
from drake_shared.scenario.space_path import SpacePath

Floats = NDArray[np.float64]
Source = str | os.PathLike[str]

# What decimals in a file may miss the tip at home by, in [m].
_START = 0.01
_REACHING_STEPS = 150
# Longest step toward a place, in [m].
_REACHING_STEP = 0.03


def check_arm(
    scenario: Scenario, arm: Arm, goals: Sequence[tuple[str, Goal]], *, source: Source = "scenario"
) -> None:
    """Makes sure that ``arm`` can do the task.

    Args:
        scenario: The task.
        arm: Its robot.
        goals: Each goal with the field that holds it.
        source: The scenario's file, for the message of an error.

    Raises:
        InputError: The model cannot be used; home is in collision, or outside the workspace; a goal is
            outside the workspace or out of reach; or a route has waypoints that are not (x, y, z), misses
            start or goal, or leads through an obstacle.
    """
    space = scenario.workspace
    if not space.z_max > space.z_min:
        raise InputError(source, "workspace.z_max", "must be above z_min", space.z_max)
    scene_graph = SceneGraph()
    register_obstacles(scene_graph, scenario.static_obstacles)
    model = ArmModel(arm, scene_graph, source=source)
    _check_home(model, scene_graph, source)
    start = model.tip_pose(model.home).translation()
    _check_inside(scenario, start, "robot.home", source)
    names = arm.position_names
    for field, goal in goals:
        target = np.array(goal.position(names))
        _check_inside(scenario, target, field, source)
        missing = distance_to_reach(model, target)
        if missing > goal.radius:
            raise InputError(
                source, field, f"must be within reach; the tip comes no nearer than {missing:.3f} m"
            )
    for route in scenario.routes:
        end = np.array(scenario.goal_of(route).position(names))
        _check_route(scenario, route.name, route.waypoints, (start, end), source)


def distance_to_reach(model: ArmModel, target: Floats) -> float:
    """How near to ``target`` (3,), in [m], the tip comes from home by straight motion, in [m].

    Obstacles do not count; the limits of the joints do, and the tip keeps its orientation.
    """
    joints, ik = model.home, VelocityIk(model.size, rows=1)
    wanted = model.tip_pose(joints).rotation().matrix()
    none = np.zeros((0, model.size)), np.zeros(0)
    missing = math.inf
    for _ in range(_REACHING_STEPS):
        pose = model.tip_pose(joints)
        offset = target - pose.translation()
        missing = float(np.linalg.norm(offset))
        if missing < 1e-4:
            break
        turn = rotation_vector(wanted @ pose.rotation().matrix().T)
        twist = np.concatenate([turn, offset * min(1.0, _REACHING_STEP / missing)])
        change = ik.solve(
            model.jacobian(),
            twist,
            np.zeros(model.size),
            lower=model.lower - joints,
            upper=model.upper - joints,
            inequalities=lambda _: none,
        )
        if change is None:
            break
        joints = joints + change
    return missing


def _check_inside(scenario: Scenario, point: Floats, field: str, source: Source) -> None:
    low, high = scenario.workspace.corners()
    if (point < low).any() or (point > high).any():
        raise InputError(source, field, "must lie inside the workspace", _text(point))


def _check_home(model: ArmModel, scene_graph: SceneGraph, source: Source) -> None:
    builder = DiagramBuilder()
    builder.AddSystem(scene_graph)
    home = builder.AddSystem(ConstantVectorSource(model.home))
    placed = builder.AddSystem(MultibodyPositionToGeometryPose(model.plant))
    builder.Connect(home.get_output_port(), placed.get_input_port())
    builder.Connect(placed.get_output_port(), scene_graph.get_source_pose_port(model.plant.get_source_id()))
    diagram = builder.Build()
    context = scene_graph.GetMyContextFromRoot(diagram.CreateDefaultContext())
    query = scene_graph.get_query_output_port().Eval(context)
    inspector = scene_graph.model_inspector()
    pairs = query.ComputeSignedDistancePairwiseClosestPoints(0.0)
    if pairs:
        deepest = min(pairs, key=lambda pair: pair.distance)
        names = [inspector.GetName(item).split("::")[0] for item in (deepest.id_A, deepest.id_B)]
        links = [inspector.GetName(inspector.GetFrameId(item)) for item in (deepest.id_A, deepest.id_B)]
        touching = " and ".join(
            name if link == "world" else link.split("::")[-1] for name, link in zip(names, links, strict=True)
        )
        expected = f"must be free of collision; {touching} overlap by {-1e3 * deepest.distance:.1f} mm"
        raise InputError(source, "robot.home", expected)


def _check_route(
    scenario: Scenario,
    name: str,
    waypoints: Sequence[Sequence[float]],
    ends: tuple[Floats, Floats],
    source: Source,
) -> None:
    field = f"routes: {name}"
    if len(waypoints) < 2 or any(len(point) != 3 for point in waypoints):
        raise InputError(source, field, "must have at least two waypoints [x, y, z]", waypoints)
    if any(math.dist(a, b) < 1e-6 for a, b in itertools.pairwise(waypoints)):
        raise InputError(source, field, "must not have a waypoint twice in a row")
    route = scenario.route(name)
    for end, place, waypoint, most in (
        ("tip at home", ends[0], waypoints[0], _START),
        ("goal", ends[1], waypoints[-1], scenario.goal_of(route).radius),
    ):
        if math.dist(place, waypoint) > most:
            expected = f"must lead from the tip at home to the goal; it misses the {end}, {_text(place)}"
            raise InputError(source, field, expected, _text(waypoint))
    low, high = scenario.workspace.corners()
    positions = SpacePath(route.waypoints).points
    outside = ((positions < low) | (positions > high)).any(axis=1)
    if outside.any():
        raise InputError(source, field, "must stay inside the workspace", _text(positions[outside][0]))
    for other in scenario.all_goals:
        near = np.linalg.norm(positions - other.position(("x", "y", "z")), axis=1).min()
        if other is not scenario.goal_of(route) and near <= other.radius:
            raise InputError(source, field, f"must not lead through another goal, {other.name}")
    inside = ObstacleDistance(scenario.static_obstacles)(positions)
    if (inside <= 0.0).any():
        raise InputError(
            source, field, "must not lead through an obstacle", _text(positions[inside.argmin()])
        )


def _text(point: Floats | Sequence[float]) -> str:
    return "(" + ", ".join(f"{x:.3f}" for x in point) + ")"
