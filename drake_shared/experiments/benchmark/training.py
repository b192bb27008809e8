"""Group 3: how long training takes to tell the routes apart, ours and a plain CNMP as published."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from drake_shared.experiments.benchmark.baselines import Predict, fit_gaussian_process, fit_promp
from drake_shared.experiments.benchmark.predict import one_torch_thread
from drake_shared.experiments.benchmark.published_cnmp import PublishedCnmp
from drake_shared.experiments.benchmark.results import GroupResult, Ratio, Trace
from drake_shared.experiments.benchmark.routes import NOISE, Routes, drive_routes, make_routes
from drake_shared.experiments.benchmark.test_tasks import Setting
from drake_shared.experiments.benchmark.timing import spread
from drake_shared.learners import Learner

OURS = "drake_shared"
PLAIN = {"plain CNMP, Adam at 1e-4": 1e-4, "plain CNMP, Adam at 3e-4": 3e-4}
PROMP = "ProMP"
PROCESS = "Gaussian process"
POINTS = (125, 250, 500, 1000)
"""Pairs of times that the Gaussian process is shown, more and more of them."""

Attempts = Iterator[tuple[float, float]]
"""CPU seconds spent and the error reached with them, in [m]; the next attempt is allowed more time."""

_METHOD = (
    "CPU seconds on one thread until a learner shown a single point where the routes are apart, moved by "
    "3 cm of noise, is off by at most the target over the whole way (root mean square over held-out "
    "demonstrations). Ours and the Gaussian process are trained afresh with more and more iterations or "
    "points, and the first training that gets there counts, from the demonstrations to the finished "
    "learner. The plain CNMP (as published: negative log-likelihood, time as it is, network 3-128-128-128 "
    "and 129-128-128-4, batch of 32, Adam) trains on until it gets there; testing it is not counted. Each "
    "repeat has other seeds."
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan:
    """How far training is taken.

    Attributes:
        target: Error to reach, in [m].
        limit: CPU time for each contender and repeat, in [s].
        repeats: Number of seeds.
        demonstrations: How many to make to train on and to test with, if none are given.
    """

    target: float
    limit: float
    repeats: int
    demonstrations: tuple[int, int]


FULL = Plan(target=0.06, limit=60.0, repeats=3, demonstrations=(48, 12))
QUICK = Plan(target=0.1, limit=4.0, repeats=1, demonstrations=(18, 6))


def run(setting: Setting) -> GroupResult:
    """Measures it."""
    plan = QUICK if setting.quick else FULL
    routes = _routes(setting, plan)
    contenders: dict[str, Callable[[int], Attempts]] = {
        OURS: partial(train_ours, routes),
        **{name: partial(train_plain, routes, rate, plan.limit) for name, rate in PLAIN.items()},
        PROMP: partial(fit_promps, routes),
        PROCESS: partial(fit_processes, routes),
    }
    reached: dict[str, list[float | None]] = {}
    traces: list[Trace] = []
    absent: dict[str, str] = {}
    with one_torch_thread(), threadpool_limits(1):
        _import_all(routes)
        for seed in range(plan.repeats):
            for name, make in contenders.items():
                try:
                    seconds, trace = attempt(name, make(seed), plan)
                except ImportError as error:
                    absent[name] = f"not installed ({error})"
                    continue
                setting.say(f"training, seed {seed}: {name} {_say(seconds, plan)}")
                reached.setdefault(name, []).append(seconds)
                if seed == 0:
                    traces.append(trace)
    for name, times in reached.items():
        if None in times:
            absent[name] = f"not within {plan.limit:g} s in {times.count(None)} of {len(times)} repeats"
    return GroupResult(
        name="training",
        method=_METHOD,
        ratios=_compare(reached, plan.limit),
        seconds={
            name: spread([time for time in times if time is not None])
            for name, times in reached.items()
            if any(time is not None for time in times)
        },
        traces=traces,
        absent=absent,
        details={
            "target": plan.target,
            "limit": plan.limit,
            "training_demonstrations": len(routes.paths),
            "cases": len(routes.steps),
            "demonstrations": str(setting.demonstrations or "simulated operator"),
        },
    )


def attempt(name: str, attempts: Attempts, plan: Plan) -> tuple[float | None, Trace]:
    """CPU seconds of the first attempt that reaches the target, None if none does within the limit."""
    seconds: list[float] = []
    errors: list[float] = []
    for spent, error in attempts:
        seconds.append(spent)
        errors.append(error)
        if error <= plan.target or spent > plan.limit:
            break
    there = bool(errors) and errors[-1] <= plan.target and seconds[-1] <= plan.limit
    return seconds[-1] if there else None, Trace(name=name, seconds=seconds, errors=errors)


def train_ours(routes: Routes, seed: int) -> Attempts:
    """Trainings of more and more iterations, each from the start."""
    from drake_shared.learners import train

    iterations = 40.0
    while True:
        begun = time.process_time()
        learner = train(routes.training, iterations=round(iterations), seed=seed, weighted=False)
        yield time.process_time() - begun, error_of_learner(learner, routes)
        iterations *= 1.5


def error_of_learner(learner: Learner, routes: Routes) -> float:
    """How far a learner of ours is off, in [m]."""
    means = [
        learner.predict(routes.grid[step : step + 1], position[None], routes.grid)[0]
        for step, position in zip(routes.steps, routes.observed, strict=True)
    ]
    return routes.error(np.stack(means))


def train_plain(routes: Routes, learning_rate: float, limit: float, seed: int) -> Attempts:
    """The plain CNMP, tested every now and then."""
    plain = PublishedCnmp(routes.paths, learning_rate=learning_rate, seed=seed)
    spent = 0.0
    while spent < limit:
        spent += plain.train(max(0.5, 0.05 * spent))
        yield spent, routes.error(plain.predict(routes.steps, routes.observed)[0])


def fit_promps(routes: Routes, seed: int) -> Attempts:
    """The ProMP, which is fitted in one go and draws nothing."""
    del seed
    begun = time.process_time()
    predict = fit_promp(routes.paths, noise=NOISE)
    yield time.process_time() - begun, _error(predict, routes)


def fit_processes(routes: Routes, seed: int) -> Attempts:
    """Gaussian processes of more and more points, each from the start."""
    for points in POINTS:
        begun = time.process_time()
        predict = fit_gaussian_process(routes.paths, noise=NOISE, points=points, seed=seed)
        yield time.process_time() - begun, _error(predict, routes)


def _routes(setting: Setting, plan: Plan) -> Routes:
    given = setting.read_training()
    if given is not None:
        return make_routes(*given)
    count, tests = plan.demonstrations
    setting.say(f"training: {count} + {tests} demonstrations by the simulated operator")
    driven = drive_routes(setting.scenario, count=count + tests).items
    return make_routes(
        *(dataclasses.replace(setting.taught, items=part) for part in (driven[:count], driven[count:]))
    )


def _compare(reached: dict[str, list[float | None]], limit: float) -> list[Ratio]:
    """Ours by each other's; where another did not get there, the limit is the least that it needed."""
    ours = reached[OURS]
    ratios = []
    for name, theirs in reached.items():
        pairs = [(a, limit if b is None else b) for a, b in zip(ours, theirs, strict=True) if a is not None]
        if name == OURS or not pairs:
            continue
        ratios.append(
            Ratio(
                name=f"{OURS} / {name}",
                spread=spread([a / b for a, b in pairs]),
                aim="at most 0.1" if name in PLAIN else "",
                bound="at most" if None in theirs else "",
            )
        )
    return ratios


def _import_all(routes: Routes) -> None:
    """Loads every library before the clock runs; those that are missing are missed later."""
    from drake_shared.learners import train

    train(routes.training, iterations=1, weighted=False)
    PublishedCnmp(routes.paths, learning_rate=1e-4, seed=0).train(0.01)
    with contextlib.suppress(ImportError):
        fit_promp(routes.paths[:2], noise=NOISE, weights=5)
    with contextlib.suppress(ImportError):
        fit_gaussian_process(routes.paths, noise=NOISE, points=20, seed=0)


def _error(predict: Predict, routes: Routes) -> float:
    observations = zip(routes.steps, routes.observed, strict=True)
    return routes.error(np.stack([predict(int(step), position) for step, position in observations]))


def _say(seconds: float | None, plan: Plan) -> str:
    return f"not within {plan.limit:g} s" if seconds is None else f"{seconds:.2f} s"
