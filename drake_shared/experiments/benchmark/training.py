"""Group 3: training time until a learner distinguishes the routes, compared with baselines."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from drake_shared.common.threads import single_threaded
from drake_shared.experiments.benchmark.common import Setup
from drake_shared.experiments.benchmark.plain_cnmp import PlainCnmp
from drake_shared.experiments.benchmark.results import GroupResult, Ratio, Trace
from drake_shared.experiments.benchmark.routes import NOISE, Array, RouteData, drive_routes, make_route_data
from drake_shared.experiments.benchmark.timing import spread
from drake_shared.learners import Learner

OURS = "drake_shared"
PLAIN = {"plain CNMP, Adam at 1e-4": 1e-4, "plain CNMP, Adam at 3e-4": 3e-4}
PROMP = "ProMP"

Predict = Callable[[int, Array], Array]
"""From an observation's index on the grid and position (2,) to the expected path (N, 2), in [m]."""
Attempts = Iterator[tuple[float, float]]
"""CPU times and the errors reached with them, in [s] and [m]; each attempt takes longer than the last."""

_METHOD = (
    "CPU time on one thread until a learner that observes a single point where the routes are separate, "
    "with 3 cm of noise, predicts the whole path to within the target error (root mean square over "
    "held-out demonstrations). drake_shared is trained from the start with more and more iterations; the "
    "first training that reaches the target counts, from the demonstrations to the finished learner. The "
    "plain CNMP (as published: negative log-likelihood, raw time, networks 3-128-128-128 and "
    "129-128-128-4, batches of 32, Adam) is trained until it reaches the target; its tests do not count. "
    "Each repeat has other seeds."
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan:
    """Limits of the training.

    Attributes:
        target: Error to reach, in [m].
        limit: CPU time of each contender in each repeat, in [s].
        repeats: Number of seeds.
        demonstrations: Numbers of demonstrations to train on and to test with, if none are given.
    """

    target: float
    limit: float
    repeats: int
    demonstrations: tuple[int, int]


FULL = Plan(target=0.06, limit=60.0, repeats=3, demonstrations=(48, 12))
QUICK = Plan(target=0.1, limit=4.0, repeats=1, demonstrations=(18, 6))


def run(setup: Setup) -> GroupResult:
    """Runs the group."""
    plan = QUICK if setup.quick else FULL
    data = prepare_data(setup, plan)
    contenders: dict[str, Callable[[int], Attempts]] = {
        OURS: partial(train_ours, data),
        **{name: partial(train_plain, data, rate, plan.limit) for name, rate in PLAIN.items()},
        PROMP: partial(train_promp, data),
    }
    reached: dict[str, list[float | None]] = defaultdict(list)
    traces: list[Trace] = []
    absent: dict[str, str] = {}
    with single_threaded():
        _import_libraries(data)
        for seed in range(plan.repeats):
            for name, make in contenders.items():
                try:
                    seconds, trace = attempt(name, make(seed), plan)
                except ImportError as error:
                    absent[name] = f"not installed ({error})"
                    continue
                result = f"not within {plan.limit:g} s" if seconds is None else f"{seconds:.2f} s"
                setup.progress(f"training, seed {seed}: {name} {result}")
                reached[name].append(seconds)
                if seed == 0:
                    traces.append(trace)
    successes = {name: [time for time in times if time is not None] for name, times in reached.items()}
    for name, times in reached.items():
        if None in times:
            absent[name] = f"not within {plan.limit:g} s in {times.count(None)} of {len(times)} repeats"
    return GroupResult(
        name="training",
        method=_METHOD,
        ratios=compare(reached, plan.limit),
        seconds={name: spread(times) for name, times in successes.items() if times},
        traces=traces,
        absent=absent,
        details={
            "target": plan.target,
            "limit": plan.limit,
            "training_demonstrations": len(data.paths),
            "cases": len(data.steps),
            "demonstrations": str(setup.training_file or "simulated operator"),
        },
    )


def prepare_data(setup: Setup, plan: Plan) -> RouteData:
    """The given demonstrations, or simulated ones."""
    given = setup.read_files()
    if given is not None:
        return make_route_data(*given)
    count, tests = plan.demonstrations
    setup.progress(f"training: {count} + {tests} demonstrations by the simulated operator")
    driven = drive_routes(setup.scenario, count=count + tests).items
    parts = driven[:count], driven[count:]
    return make_route_data(*(dataclasses.replace(setup.route_demonstrations, items=part) for part in parts))


def attempt(name: str, attempts: Attempts, plan: Plan) -> tuple[float | None, Trace]:
    """CPU time of the first attempt that reaches the target, or None if none does within the limit."""
    trace = Trace(name=name, seconds=[], errors=[])
    for seconds, error in attempts:
        trace.seconds.append(seconds)
        trace.errors.append(error)
        if seconds > plan.limit:
            break
        if error <= plan.target:
            return seconds, trace
    return None, trace


def compare(reached: dict[str, list[float | None]], limit: float) -> list[Ratio]:
    """Ratios to each other contender; the limit stands for the time of one that did not reach the target."""
    ratios = []
    for name, times in reached.items():
        pairs = zip(reached[OURS], times, strict=True)
        values = [ours / (limit if other is None else other) for ours, other in pairs if ours is not None]
        if name != OURS and values:
            ratios.append(
                Ratio(
                    name=f"{OURS} / {name}",
                    spread=spread(values),
                    aim="at most 0.1" if name in PLAIN else "",
                    bound="at most" if None in times else "",
                )
            )
    return ratios


def train_ours(data: RouteData, seed: int) -> Attempts:
    """Trainings of drake_shared with more and more iterations, each from the start."""
    from drake_shared.learners import train

    iterations = 40.0
    while True:
        start = time.process_time()
        learner = train(data.training, iterations=round(iterations), seed=seed, weighted=False)
        yield time.process_time() - start, _error(partial(_predict_path, learner, data), data)
        iterations *= 1.5


def train_plain(data: RouteData, learning_rate: float, limit: float, seed: int) -> Attempts:
    """One training of the plain CNMP, tested at intervals."""
    plain = PlainCnmp(data.paths, learning_rate=learning_rate, seed=seed)
    spent = 0.0
    while spent < limit:
        spent += plain.train(max(0.5, 0.05 * spent))
        yield spent, data.error(plain.predict(data.steps, data.observed))


def train_promp(data: RouteData, seed: int) -> Attempts:
    """The ProMP, which is fitted in closed form; ``seed`` has no effect."""
    del seed
    start = time.process_time()
    predict = fit_promp(data.paths)
    yield time.process_time() - start, _error(predict, data)


def fit_promp(paths: Array, *, weights: int = 25) -> Predict:
    """A ProMP (``movement_primitives`` on PyPI) that models the noise of observations.

    Args:
        paths: Demonstrations on one grid: shape (m, N, 2), in [m].
        weights: Number of basis functions per axis.
    """
    from movement_primitives.promp import ProMP

    count, steps = paths.shape[:2]
    times = np.linspace(0.0, 1.0, steps)
    promp: Any = ProMP(n_dims=2, n_weights_per_dim=weights)
    promp.imitate(np.repeat(times[None], count, axis=0), paths)

    def predict(step: int, position: Array) -> Array:
        conditioned = promp.condition_position(position, NOISE**2 * np.eye(2), t=times[step], t_max=1.0)
        return np.asarray(conditioned.mean_trajectory(times))

    return predict


def _import_libraries(data: RouteData) -> None:
    """Imports every library before times are taken; missing ones are reported later."""
    from drake_shared.learners import train

    train(data.training, iterations=1, weighted=False)
    PlainCnmp(data.paths, learning_rate=1e-4, seed=0).train(0.01)
    with contextlib.suppress(ImportError):
        fit_promp(data.paths[:2], weights=5)


def _predict_path(learner: Learner, data: RouteData, step: int, position: Array) -> Array:
    return learner.predict(data.grid[step : step + 1], position[None], data.grid)[0]


def _error(predict: Predict, data: RouteData) -> float:
    observations = zip(data.steps.tolist(), data.observed, strict=True)
    return data.error(np.stack([predict(step, position) for step, position in observations]))
