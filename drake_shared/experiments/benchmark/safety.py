"""Group 6: a step of the safety filter, beside what it cannot do without and what it does without."""

from __future__ import annotations

import dataclasses

import numpy as np
from pydrake.geometry import SceneGraph, SignedDistanceToPoint
from pydrake.solvers import ClarabelSolver, MathematicalProgram
from pydrake.systems.framework import Context

from drake_shared.arbitration.safety.barrier import safe_command
from drake_shared.experiments.benchmark.results import GroupResult, Ratio
from drake_shared.experiments.benchmark.test_tasks import Setting
from drake_shared.experiments.benchmark.timing import Task, interleave, ratio, spread
from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import Pose, Wheels, motion, speeds_after
from drake_shared.scenario.obstacles import Circle, register_obstacles

OBSTACLES = 12
STATES = 25
PASSED, CHANGED = "safety filter, command passed", "safety filter, command changed"
QUERY, PROGRAM = "distance query", "quadratic program by Clarabel"

_CLEARANCE = 0.05
# Of a drive that states are taken from: long enough to get up to speed and to come to an obstacle.
_STEPS = 40
# Nearly as far as the filter looks at these speeds, in [m].
_RADIUS = 0.7
_METHOD = (
    f"CPU seconds on one thread, contenders in turns. {OBSTACLES} round obstacles stand about a robot at "
    f"random; of drives among them at about full speed {STATES} states at speed near obstacles are taken in "
    "which the command passes, and as many in which it is changed. Beside a step of the filter: the one "
    "query of SceneGraph, for the obstacles about the robot, that it cannot do without, and one quadratic "
    f"program of its size (two wheel speeds, a box, {OBSTACLES} half-planes), set up and solved by Drake and "
    "Clarabel, its figures given."
)


@dataclasses.dataclass(frozen=True)
class _State:
    """A robot on its way among obstacles, and the command that it is given."""

    scene_graph: SceneGraph
    context: Context
    pose: Pose
    wheels: Wheels
    command: Wheels

    def look(self, x: float, y: float, radius: float) -> list[SignedDistanceToPoint]:
        """The distances from a point to the obstacles within a radius."""
        query = self.scene_graph.get_query_output_port().Eval(self.context)
        return query.ComputeSignedDistanceToPoint(np.array([x, y, 0.0]), radius)

    def filtered(self, setting: Setting) -> Wheels:
        """What the filter makes of the command."""
        return safe_command(
            setting.scenario.robot,
            self.pose,
            self.wheels,
            self.command,
            clearance=_CLEARANCE,
            query=self.look,
            period=setting.scenario.control_period,
        )


def run(setting: Setting) -> GroupResult:
    """Measures it."""
    passed, changed = draw_states(setting)
    robot, period = setting.scenario.robot, setting.scenario.control_period
    contenders: dict[str, Task] = {
        PASSED: lambda: [state.filtered(setting) for state in passed],
        CHANGED: lambda: [state.filtered(setting) for state in changed],
        QUERY: lambda: [state.look(*state.pose[:2], _RADIUS) for state in changed],
        PROGRAM: lambda: [solve_program(robot, state.wheels, state.command, period) for state in changed],
    }
    found = interleave(contenders, repeats=setting.repeats)
    seconds = {name: values / STATES for name, values in found.items()}
    pairs = [(name, other) for other in (QUERY, PROGRAM) for name in (PASSED, CHANGED)]
    return GroupResult(
        name="safety",
        method=_METHOD,
        ratios=[
            Ratio(name=f"{name} / {other}", spread=ratio(seconds[name], seconds[other]))
            for name, other in pairs
        ],
        seconds={name: spread(values) for name, values in seconds.items()},
        details={"obstacles": OBSTACLES, "states": STATES},
    )


def draw_states(setting: Setting) -> list[list[_State]]:
    """States in which the filter lets the command pass, and others in which it changes it: STATES of each."""
    rng = np.random.default_rng(0)
    robot, period = setting.scenario.robot, setting.scenario.control_period
    passed: list[_State] = []
    changed: list[_State] = []
    while min(len(passed), len(changed)) < 10 * STATES:
        x, y = rng.uniform(-2.0, 2.0, (2, OBSTACLES)).tolist()
        command = tuple(rng.uniform(0.8, 1.0, 2) * robot.max_wheel_speed)
        circles = [Circle(name=f"{k}", x=x[k], y=y[k], radius=0.2) for k in range(OBSTACLES)]
        scene_graph = SceneGraph()
        register_obstacles(scene_graph, list(circles))
        state = _State(scene_graph, scene_graph.CreateDefaultContext(), (0.0, 0.0, 0.0), (0.0, 0.0), command)
        if min(item.distance for item in state.look(0.0, 0.0, 10.0)) < robot.footprint_radius + _CLEARANCE:
            continue
        for _ in range(_STEPS):
            told = state.filtered(setting)
            if told != command:
                changed.append(state)
            elif state.wheels == command and state.look(*state.pose[:2], _RADIUS):
                passed.append(state)
            pose = motion(robot, state.pose, state.wheels, told, period)[-1]
            wheels = speeds_after(robot, state.wheels, told, period)
            state = dataclasses.replace(state, pose=pose, wheels=wheels)
    return [
        [found[k] for k in np.linspace(0, len(found) - 1, STATES).astype(int)] for found in (passed, changed)
    ]


def solve_program(robot: DiffDrive, wheels: Wheels, command: Wheels, period: float) -> np.ndarray:
    """The wheel speeds (2,) nearest to a command, in [rad/s], under as many half-planes as obstacles."""
    program = MathematicalProgram()
    speeds = program.NewContinuousVariables(2)
    change = robot.max_wheel_acceleration * period
    angles = np.linspace(0.0, 2 * np.pi, OBSTACLES, endpoint=False)
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    bounds = normals @ wheels - 0.5 * change
    program.AddQuadraticErrorCost(np.eye(2), np.array(command), speeds)
    program.AddBoundingBoxConstraint(np.array(wheels) - change, np.array(wheels) + change, speeds)
    program.AddLinearConstraint(normals, bounds, np.full(OBSTACLES, np.inf), speeds)
    return ClarabelSolver().Solve(program).GetSolution(speeds)
