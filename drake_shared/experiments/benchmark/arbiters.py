"""Group 9: a step of each arbiter of the package."""

from __future__ import annotations

import itertools

import numpy as np

from drake_shared.experiments.benchmark.common import Setup
from drake_shared.experiments.benchmark.results import GroupResult, make_ratio
from drake_shared.experiments.benchmark.timing import Task, interleave, spread
from drake_shared.learners import Modes
from drake_shared.systems.arbiters import DEFAULT, make_arbiter
from drake_shared.systems.intention import Intention
from drake_shared.systems.rule_arbiter import RuleArbiter

NAMES = (DEFAULT, "halves", "traded", "leader-follower", "fusion", "hindsight", "rt-v2", "consistency")

_METHOD = (
    "CPU time on one thread, contenders in turns, of one step of an arbiter in Drake: a new command of the "
    "human is set, and weight and shared command are evaluated. The robot is on the first demonstrated "
    "route, and three modes are predicted."
)


def run(setup: Setup) -> GroupResult:
    """Runs the group."""
    found = interleave({name: step_of(name, setup) for name in NAMES}, repeats=setup.repeats)
    return GroupResult(
        name="arbiters",
        method=_METHOD,
        ratios=[make_ratio(found, name, DEFAULT) for name in NAMES[1:]],
        seconds={name: spread(values) for name, values in found.items()},
    )


def step_of(name: str, setup: Setup) -> Task:
    """A function that runs one step of the arbiter of that name."""
    scenario, learner = setup.scenario, setup.learner
    arbiter = make_arbiter(name, robot=scenario.robot, period=scenario.control_period, scenario=scenario)
    context = arbiter.CreateDefaultContext()
    if isinstance(arbiter, RuleArbiter):
        arbiter.SetLearner(context, learner)
    grid, taught = np.asarray(learner.grid), learner.demonstrations
    assert taught is not None
    first = len(grid) // 4
    x, y = taught[0, first].tolist()
    modes = Modes(
        probability=np.full(len(taught), 1.0 / len(taught)),
        mean=taught[:, first:],
        variance=np.full_like(taught[:, first:], 0.01),
        aim=0,
    )
    intention = Intention(
        time=float(grid[first - 1]),
        times=grid,
        mean=taught[0],
        variance=np.full_like(taught[0], 0.01),
        first=first,
        modes=modes,
    )
    inputs = {
        "autonomous_command": [4.0, 4.5],
        "confidence": [0.7],
        "pose": [x, y, 0.1],
        "idle_time": [0.0],
        "clearance": [0.5],
    }
    for port, value in inputs.items():
        if arbiter.HasInputPort(port):
            arbiter.GetInputPort(port).FixValue(context, value)
    if arbiter.HasInputPort("intention"):
        arbiter.GetInputPort("intention").FixValue(context, intention)
    human = arbiter.GetInputPort("human_command")
    outputs = [arbiter.GetOutputPort(port) for port in ("human_weight", "shared_command")]
    commands = itertools.cycle([[5.0, 4.0], [4.0, 5.0]])

    def step() -> None:
        human.FixValue(context, next(commands))
        for port in outputs:
            port.Eval(context)

    return step
