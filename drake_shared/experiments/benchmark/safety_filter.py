"""Group 6: a step of the safety filter compared with a distance query and a quadratic program."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import SceneGraph, SignedDistanceToPoint
from pydrake.solvers import ClarabelSolver, MathematicalProgram
from pydrake.systems.framework import Context

from drake_shared.arbitration.safety.barrier import nearest_feasible, safe_command
from drake_shared.experiments.benchmark.common import Setup
from drake_shared.experiments.benchmark.results import GroupResult, make_ratio
from drake_shared.experiments.benchmark.timing import Task, interleave, spread
from drake_shared.robots.motion import Pose, Wheels, motion, speeds_after
from drake_shared.scenario import Scenario
from drake_shared.scenario.obstacles import Circle, register_obstacles

OBSTACLES = 12
STATES = 25
PASSED, CHANGED = "safety filter, command passed", "safety filter, command changed"
QUERY, PROGRAM, OWN_PROGRAM = "distance query", "quadratic program by Clarabel", "quadratic program, own"

_CLEARANCE = 0.05
# Steps of a drive from which states are taken: enough to reach full speed and an obstacle.
_STEPS = 40
# About the distance to which the filter considers obstacles at these speeds, in [m].
_RADIUS = 0.7
_METHOD = (
    f"CPU time on one thread, contenders in turns. {OBSTACLES} circular obstacles stand around a robot at "
    f"random; from drives among them at about full speed {STATES} states near obstacles are taken in which "
    "the filter passes the command, and as many in which it changes it. A step of the filter is compared "
    "with the one distance query of SceneGraph that it needs at least, and with one quadratic program of "
    f"its size (two wheel speeds, a box, {OBSTACLES} half-planes), built and solved by Drake and Clarabel; "
    "the filter's own algorithm solves the same program."
)

Program = tuple[Wheels, Wheels, Wheels, list[list[float]], list[float]]


@dataclasses.dataclass(frozen=True)
class State:
    """A robot among obstacles, and its command."""

    scenario: Scenario
    scene_graph: SceneGraph
    context: Context
    pose: Pose
    wheels: Wheels
    command: Wheels

    def query(self, x: float, y: float, radius: float) -> list[SignedDistanceToPoint]:
        """Distances from a point to the obstacles within a radius."""
        query = self.scene_graph.get_query_output_port().Eval(self.context)
        found: list[SignedDistanceToPoint] = query.ComputeSignedDistanceToPoint(np.array([x, y, 0.0]), radius)
        return found

    def filtered(self) -> Wheels:
        """The command after the filter."""
        return safe_command(
            self.scenario.diff_drive,
            self.pose,
            self.wheels,
            self.command,
            clearance=_CLEARANCE,
            query=self.query,
            period=self.scenario.control_period,
        )

    def program(self) -> Program:
        """A quadratic program for the wheel speeds nearest to the command, with active constraints."""
        change = self.scenario.diff_drive.max_wheel_acceleration * self.scenario.control_period
        angles = np.linspace(0.0, 2 * np.pi, OBSTACLES, endpoint=False)
        normals = np.column_stack([np.cos(angles), np.sin(angles)])
        low, high = np.subtract(self.wheels, change), np.add(self.wheels, change)
        bounds = normals @ self.wheels - 0.5 * change
        return self.command, tuple(low.tolist()), tuple(high.tolist()), normals.tolist(), bounds.tolist()


def run(setup: Setup) -> GroupResult:
    """Runs the group."""
    passed, changed = draw_states(setup)
    programs = [state.program() for state in changed]
    contenders: dict[str, Task] = {
        PASSED: lambda: [state.filtered() for state in passed],
        CHANGED: lambda: [state.filtered() for state in changed],
        QUERY: lambda: [state.query(*state.pose[:2], _RADIUS) for state in changed],
        PROGRAM: lambda: [solve_by_drake(*program) for program in programs],
        OWN_PROGRAM: lambda: [nearest_feasible(*program) for program in programs],
    }
    found = interleave(contenders, repeats=setup.repeats)
    seconds = {name: values / STATES for name, values in found.items()}
    pairs = [(name, other) for other in (QUERY, PROGRAM) for name in (PASSED, CHANGED)]
    return GroupResult(
        name="safety",
        method=_METHOD,
        ratios=[make_ratio(seconds, *pair) for pair in (*pairs, (PROGRAM, OWN_PROGRAM))],
        seconds={name: spread(values) for name, values in seconds.items()},
        details={"obstacles": OBSTACLES, "states": STATES},
    )


def draw_states(setup: Setup) -> list[list[State]]:
    """STATES states in which the filter passes the command, and as many in which it changes it."""
    rng = np.random.default_rng(0)
    robot, period = setup.scenario.diff_drive, setup.scenario.control_period
    passed: list[State] = []
    changed: list[State] = []
    while min(len(passed), len(changed)) < 10 * STATES:
        x, y = rng.uniform(-2.0, 2.0, (2, OBSTACLES)).tolist()
        command = tuple(rng.uniform(0.8, 1.0, 2) * robot.max_wheel_speed)
        scene_graph = SceneGraph()
        circles = [Circle(name=f"{k}", x=x[k], y=y[k], radius=0.2) for k in range(OBSTACLES)]
        register_obstacles(scene_graph, list(circles))
        context = scene_graph.CreateDefaultContext()
        state = State(setup.scenario, scene_graph, context, (0.0, 0.0, 0.0), (0.0, 0.0), command)
        if min(item.distance for item in state.query(0.0, 0.0, 10.0)) < robot.footprint_radius + _CLEARANCE:
            continue
        for _ in range(_STEPS):
            safe = state.filtered()
            if safe != command:
                changed.append(state)
            elif state.wheels == command and state.query(*state.pose[:2], _RADIUS):
                passed.append(state)
            pose = motion(robot, state.pose, state.wheels, safe, period)[-1]
            wheels = speeds_after(robot, state.wheels, safe, period)
            state = dataclasses.replace(state, pose=pose, wheels=wheels)
    return [
        [found[k] for k in np.linspace(0, len(found) - 1, STATES).astype(int)] for found in (passed, changed)
    ]


def solve_by_drake(
    target: Wheels, low: Wheels, high: Wheels, normals: list[list[float]], bounds: list[float]
) -> NDArray[np.float64]:
    """Solves the program of `nearest_feasible` by Drake and Clarabel: shape (2,), in [rad/s]."""
    program = MathematicalProgram()
    speeds = program.NewContinuousVariables(2)
    program.AddQuadraticErrorCost(np.eye(2), np.array(target), speeds)
    program.AddBoundingBoxConstraint(np.array(low), np.array(high), speeds)
    program.AddLinearConstraint(np.array(normals), np.array(bounds), np.full(len(bounds), np.inf), speeds)
    solution: NDArray[np.float64] = ClarabelSolver().Solve(program).GetSolution(speeds)
    return solution
