"""Group 5: how costs grow with obstacles, queries, demonstrations and trials."""

from __future__ import annotations

import dataclasses
import time
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.experiments.benchmark.predict import one_torch_thread
from drake_shared.experiments.benchmark.results import Curve, GroupResult, make_curve
from drake_shared.experiments.benchmark.test_tasks import Setting, with_grid
from drake_shared.experiments.benchmark.timing import Task, interleave
from drake_shared.learners import Learner
from drake_shared.learners.cnmp.parameters import find_parameters
from drake_shared.scenario import Scenario, Workspace
from drake_shared.scenario.obstacles import Circle
from drake_shared.simulation.trial import Simulation, TrialSettings

OBSTACLES = (2, 8, 30, 120, 400, 1_000)
QUERIES = (75, 150, 300, 600, 1_200, 2_400)
DEMONSTRATIONS = (3, 10, 30, 100, 300, 1_000)
TRIALS = (10, 100, 1_000, 10_000)

_METHOD = (
    "CPU seconds on one thread; sizes take turns within each repeat. Obstacles: a step of a "
    "shared-control trial, the further obstacles standing in rows beside the workspace. Queries: a "
    "prediction of a CNMP of the shipped size from one observation on a grid of so many times. "
    "Demonstrations: an iteration of training, what there is in it beside the iterations, and a "
    "prediction of the learner that comes of it. Trials: so many of 1 s of the task, one after another in "
    "one process. A constant share bends the curve at its lower end: the exponent between the last two "
    "sizes is given beside that over all."
)


def run(setting: Setting) -> GroupResult:
    """Measures it."""
    repeats = 2 if setting.quick else max(3, setting.repeats // 3)
    curves = []
    with one_torch_thread():
        for measure in (grow_obstacles, grow_queries, grow_demonstrations, grow_trials):
            setting.say(f"growth: {measure.__name__.removeprefix('grow_')}")
            curves += measure(setting, repeats)
    return GroupResult(name="growth", method=_METHOD, curves=curves)


def grow_obstacles(setting: Setting, repeats: int) -> list[Curve]:
    """A step of a trial against the number of obstacles."""
    sizes = _fewer(OBSTACLES) if setting.quick else OBSTACLES
    seconds = 1.0 if setting.quick else 5.0
    tasks: dict[str, Task] = {}
    for count in sizes:
        scenario = crowded(setting.scenario, count, duration=seconds)
        simulation = Simulation(scenario, learner=setting.learner)
        settings = TrialSettings(route=scenario.routes[0].name, end="duration")
        tasks[str(count)] = partial(simulation.run, settings)
    found = interleave(tasks, repeats=repeats, block=0.0)
    steps = seconds / setting.scenario.control_period
    return [make_curve("a step of a trial, s", "obstacles", sizes, [v / steps for v in found.values()])]


def grow_queries(setting: Setting, repeats: int) -> list[Curve]:
    """A prediction against the number of queries."""
    tasks: dict[str, Task] = {}
    for count in QUERIES:
        tasks[str(count)] = _prediction(with_grid(setting.cnmp, count))
    found = interleave(tasks, repeats=repeats, block=0.005 if setting.quick else 0.05)
    return [make_curve("a prediction, s", "queries", QUERIES, list(found.values()))]


def grow_demonstrations(setting: Setting, repeats: int) -> list[Curve]:
    """Training and prediction against the number of demonstrations."""
    sizes = _fewer(DEMONSTRATIONS) if setting.quick else DEMONSTRATIONS
    iterations = 10 if setting.quick else 60
    multiplied = [_multiply(setting.taught, count) for count in sizes]
    predictions: dict[str, Task] = {}
    iteration, beside = np.empty((2, len(sizes), repeats))
    with threadpool_limits(1):
        for repeat in range(repeats):
            for index, demonstrations in enumerate(multiplied):
                learner, whole, one = _timed_training(demonstrations, iterations)
                iteration[index, repeat], beside[index, repeat] = one, whole - iterations * one
                predictions[str(len(demonstrations))] = _prediction(learner)
    predicted = interleave(predictions, repeats=repeats, block=0.005 if setting.quick else 0.05)
    return [
        make_curve("an iteration of training, s", "demonstrations", sizes, list(iteration)),
        make_curve("training beside its iterations, s", "demonstrations", sizes, list(beside)),
        make_curve("a prediction, s", "demonstrations", sizes, list(predicted.values())),
    ]


def _timed_training(demonstrations: Demonstrations, iterations: int) -> tuple[Learner, float, float]:
    """A learner, the CPU seconds of its training, and those of one iteration."""
    from drake_shared.learners.cnmp.training import train

    told: list[tuple[int, float]] = []

    def progress(done: int, planned: int, loss: float) -> None:
        told.append((done, time.process_time()))

    parameters = dataclasses.replace(find_parameters("default"), iterations=iterations, restarts=0)
    begun = time.process_time()
    learner = train(demonstrations, parameters=parameters, progress=progress)
    whole = time.process_time() - begun
    (first, since), (last, until) = told[0], told[-1]
    return learner, whole, (until - since) / (last - first)


def grow_trials(setting: Setting, repeats: int) -> list[Curve]:
    """All trials so far against their number."""
    sizes = (3, 10, 30) if setting.quick else TRIALS
    scenario = dataclasses.replace(setting.scenario, duration=1.0)
    simulation = Simulation(scenario, learner=setting.learner)
    settings = TrialSettings(route=scenario.routes[0].name, end="duration")
    simulation.run(settings)
    seconds = np.empty((len(sizes), 1 if setting.quick else min(repeats, 2)))
    with threadpool_limits(1):
        for repeat in range(seconds.shape[1]):
            begun, done = time.process_time(), 0
            for index, size in enumerate(sizes):
                while done < size:
                    simulation.run(settings)
                    done += 1
                seconds[index, repeat] = time.process_time() - begun
    return [make_curve("all trials, s", "trials", sizes, list(seconds))]


def crowded(scenario: Scenario, count: int, *, duration: float) -> Scenario:
    """The same task with ``count`` obstacles in all, those to come standing in rows above the workspace."""
    space = scenario.workspace
    columns = max(1, int((space.x_max - space.x_min) / 0.5))
    obstacles = list(scenario.obstacles[:count])
    for index in range(count - len(obstacles)):
        row, column = divmod(index, columns)
        x, y = space.x_min + 0.5 * column, space.y_max + 0.5 * (row + 1)
        obstacles.append(Circle(name=f"further_{index}", x=x, y=y, radius=0.2))
    top = max(space.y_max, *(item.y + 0.5 for item in obstacles))
    return dataclasses.replace(
        scenario,
        obstacles=obstacles,
        workspace=Workspace(x_min=space.x_min, x_max=space.x_max, y_min=space.y_min, y_max=top),
        duration=duration,
    )


def _fewer(sizes: tuple[int, ...]) -> tuple[int, ...]:
    """Every second size, and the last."""
    return tuple(sorted({*sizes[::2], sizes[-1]}))


def _multiply(demonstrations: Demonstrations, count: int) -> Demonstrations:
    """So many demonstrations: the given ones in turn, each bent a little in its own way."""
    random = np.random.default_rng(0)
    items = []
    for index in range(count):
        item = demonstrations[index % len(demonstrations)]
        share = (item.times - item.times[0]) / (item.times[-1] - item.times[0])
        bend = 0.1 * np.sin(np.pi * share)[:, None] * random.standard_normal(2)
        items.append(Demonstration(times=item.times, positions=item.positions + bend))
    return Demonstrations(items=tuple(items))


def _prediction(learner: Learner) -> Task:
    assert learner.demonstrations is not None
    times, positions = learner.grid[:1], learner.demonstrations[0, :1]
    return partial(learner.predict, times, positions, learner.grid)
