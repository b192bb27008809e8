"""Group 5: growth of computing times with obstacles, queries, demonstrations and trials."""

from __future__ import annotations

import dataclasses
import time
from functools import partial

import numpy as np

from drake_shared.common.threads import single_threaded
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.experiments.benchmark.common import Setup, prediction_task, with_grid
from drake_shared.experiments.benchmark.results import Curve, GroupResult, make_curve
from drake_shared.experiments.benchmark.timing import Task, interleave
from drake_shared.experiments.benchmark.trial import whole_trials
from drake_shared.learners import Learner
from drake_shared.learners.cnmp.parameters import find_parameters
from drake_shared.scenario import Scenario, Workspace
from drake_shared.scenario.obstacles import Circle
from drake_shared.simulation.trial import TrialSettings

OBSTACLES = (2, 8, 30, 120, 400, 1_000)
QUERIES = (75, 150, 300, 600, 1_200, 2_400)
DEMONSTRATIONS = (3, 10, 30, 100, 300, 1_000)
TRIALS = (10, 100, 1_000, 10_000)

_METHOD = (
    "CPU time on one thread; sizes take turns within each repeat. Obstacles: a step of a shared-control "
    "trial, with further obstacles in rows beside the workspace. Queries: a prediction of a CNMP of the "
    "shipped size from one observation, on a grid of that many times. Demonstrations: an iteration of "
    "training, the rest of the training, and a prediction of the learner. Trials: that many of 1 s of the "
    "task, one after another in one process. Constant parts bend a curve at its lower end, so the "
    "exponent between the last two sizes is given beside that over all."
)


def run(setup: Setup) -> GroupResult:
    """Runs the group."""
    repeats = 2 if setup.quick else max(3, setup.repeats // 3)
    curves = []
    with single_threaded():
        for measure in (grow_obstacles, grow_queries, grow_demonstrations, grow_trials):
            setup.progress(f"growth: {measure.__name__.removeprefix('grow_')}")
            curves += measure(setup, repeats)
    return GroupResult(name="growth", method=_METHOD, curves=curves)


def grow_obstacles(setup: Setup, repeats: int) -> list[Curve]:
    """A step of a trial, by number of obstacles."""
    sizes = _select(OBSTACLES, setup)
    duration = 1.0 if setup.quick else 5.0
    tasks: dict[str, Task] = {}
    for count in sizes:
        scenario = add_obstacles(setup.scenario, count, duration=duration)
        settings = TrialSettings(route=scenario.routes[0].name)
        tasks[str(count)] = partial(whole_trials(scenario, setup.learner).run, settings)
    found = interleave(tasks, repeats=repeats, block=0.0)
    steps = duration / setup.scenario.control_period
    seconds = [values / steps for values in found.values()]
    return [make_curve("a step of a trial, s", "obstacles", sizes, seconds)]


def grow_queries(setup: Setup, repeats: int) -> list[Curve]:
    """A prediction, by number of queries."""
    tasks = {str(count): prediction_task(with_grid(setup.cnmp, count)) for count in QUERIES}
    found = interleave(tasks, repeats=repeats, block=0.005 if setup.quick else 0.05)
    return [make_curve("a prediction, s", "queries", QUERIES, list(found.values()))]


def grow_demonstrations(setup: Setup, repeats: int) -> list[Curve]:
    """Training and prediction, by number of demonstrations."""
    sizes = _select(DEMONSTRATIONS, setup)
    iterations = 10 if setup.quick else 60
    data = [multiply(setup.route_demonstrations, count) for count in sizes]
    predictions: dict[str, Task] = {}
    per_iteration, rest = np.empty((2, len(sizes), repeats))
    for repeat in range(repeats):
        for index, demonstrations in enumerate(data):
            learner, whole, iteration = _time_training(demonstrations, iterations)
            per_iteration[index, repeat], rest[index, repeat] = iteration, whole - iterations * iteration
            predictions[str(len(demonstrations))] = prediction_task(learner)
    predicted = interleave(predictions, repeats=repeats, block=0.005 if setup.quick else 0.05)
    return [
        make_curve("an iteration of training, s", "demonstrations", sizes, list(per_iteration)),
        make_curve("training beside its iterations, s", "demonstrations", sizes, list(rest)),
        make_curve("a prediction, s", "demonstrations", sizes, list(predicted.values())),
    ]


def _time_training(demonstrations: Demonstrations, iterations: int) -> tuple[Learner, float, float]:
    """A learner, the CPU time of its training, and that of one iteration, both in [s]."""
    from drake_shared.learners.cnmp.training import train

    reports: list[tuple[int, float]] = []

    def progress(done: int, planned: int, loss: float) -> None:
        reports.append((done, time.process_time()))

    parameters = dataclasses.replace(find_parameters("default"), iterations=iterations, restarts=0)
    start = time.process_time()
    learner = train(demonstrations, parameters=parameters, progress=progress)
    whole = time.process_time() - start
    (first, since), (last, until) = reports[0], reports[-1]
    return learner, whole, (until - since) / (last - first)


def grow_trials(setup: Setup, repeats: int) -> list[Curve]:
    """All trials so far, by their number."""
    sizes = (3, 10, 30) if setup.quick else TRIALS
    scenario = dataclasses.replace(setup.scenario, duration=1.0)
    simulation = whole_trials(scenario, setup.learner)
    settings = TrialSettings(route=scenario.routes[0].name)
    simulation.run(settings)
    seconds = np.empty((len(sizes), 1 if setup.quick else min(repeats, 2)))
    for repeat in range(seconds.shape[1]):
        start, done = time.process_time(), 0
        for index, size in enumerate(sizes):
            while done < size:
                simulation.run(settings)
                done += 1
            seconds[index, repeat] = time.process_time() - start
    return [make_curve("all trials, s", "trials", sizes, list(seconds))]


def add_obstacles(scenario: Scenario, count: int, *, duration: float) -> Scenario:
    """The same task with ``count`` obstacles in all; further ones stand in rows above the workspace."""
    space = scenario.workspace
    columns = max(1, int((space.x_max - space.x_min) / 0.5))
    obstacles = list(scenario.obstacles[:count])
    for index in range(count - len(obstacles)):
        row, column = divmod(index, columns)
        x, y = space.x_min + 0.5 * column, space.y_max + 0.5 * (row + 1)
        obstacles.append(Circle(name=f"further_{index}", x=x, y=y, radius=0.2))
    top = max(space.y_max, *(item.y + 0.5 for item in obstacles))
    workspace = Workspace(x_min=space.x_min, x_max=space.x_max, y_min=space.y_min, y_max=top)
    return dataclasses.replace(scenario, obstacles=obstacles, workspace=workspace, duration=duration)


def multiply(demonstrations: Demonstrations, count: int) -> Demonstrations:
    """``count`` demonstrations: the given ones in turn, each deformed a little at random."""
    rng = np.random.default_rng(0)
    items = []
    for index in range(count):
        item = demonstrations[index % len(demonstrations)]
        share = (item.times - item.times[0]) / (item.times[-1] - item.times[0])
        bend = 0.1 * np.sin(np.pi * share)[:, None] * rng.standard_normal(2)
        items.append(Demonstration(times=item.times, positions=item.positions + bend))
    return Demonstrations(items=tuple(items))


def _select(sizes: tuple[int, ...], setup: Setup) -> tuple[int, ...]:
    """All sizes, or in a quick run every second one and the last."""
    return tuple(sorted({*sizes[::2], sizes[-1]})) if setup.quick else sizes
