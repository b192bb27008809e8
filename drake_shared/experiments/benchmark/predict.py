"""Group 1: a prediction from one observation, compared with the same arithmetic in other libraries."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from drake_shared.common.threads import single_threaded
from drake_shared.experiments.benchmark.common import Setup, with_grid
from drake_shared.experiments.benchmark.networks import (
    Network,
    Predictor,
    make_compiled,
    make_onnx,
    make_products,
    make_published,
    make_torch,
)
from drake_shared.experiments.benchmark.results import GroupResult, Ratio, make_ratio
from drake_shared.experiments.benchmark.timing import Spread, Task, interleave, spread
from drake_shared.learners.cnmp.learner import CnmpLearner

QUERIES = 301
"""Every control step of 15 s."""
OURS = "drake_shared"
BARE = "bare products"
PUBLISHED_BARE = "bare products of the plain network"
NETWORK_ALONE = ", network alone"

_METHOD = (
    "A CNMP of the shipped size on a grid of 301 queries (0.05 s) predicts all queries, or the last half "
    "of them, from one point of a demonstration, on one thread. Every contender takes the observation and "
    "returns mean and variance in metres as numpy arrays, with the same code around its network ('network "
    "alone' is without that code); drake_shared also adds the variance for unfamiliar positions. 'torch "
    "eager' is the network as published codes have it; the others precompute the time part of the "
    "decoder's first layer, as drake_shared does. The bare products are the matrix products of the same "
    "sizes in float32, into arrays allocated in advance, and nothing else; those of the plain network are "
    "without the precomputed part."
)


def run(setup: Setup) -> GroupResult:
    """Runs the group."""
    learner = with_grid(setup.cnmp, QUERIES)
    ratios: list[Ratio] = []
    seconds: dict[str, Spread] = {}
    absent: dict[str, str] = {}
    for first in (0, QUERIES // 2 + 1):
        note = f", {QUERIES - first} queries"
        with single_threaded():
            contenders, missing = make_contenders(learner, first, compiled=not setup.quick)
            found = interleave(contenders, repeats=setup.repeats, block=0.01 if setup.quick else 0.05)
        absent |= missing
        seconds |= {name + note: spread(values) for name, values in found.items()}
        for name in (BARE, PUBLISHED_BARE):
            ratios.append(make_ratio(found, OURS, name, aim="at most 2", note=note))
        for name in found:
            if name not in (OURS, BARE, PUBLISHED_BARE) and not name.endswith(NETWORK_ALONE):
                aim = "at least 4" if name == "torch eager" else ""
                ratios.append(make_ratio(found, name, OURS, aim=aim, note=note))
    return GroupResult(
        name="predict",
        method=_METHOD,
        ratios=ratios,
        seconds=seconds,
        absent=absent,
        details={
            "encoder": [int(bias.size) for _, bias in learner.encoder],
            "aggregation": learner.aggregation,
            "decoder": [int(bias.size) for _, bias in learner.decoder],
            "harmonics": learner.harmonics,
        },
    )


def make_contenders(
    learner: CnmpLearner, first: int, *, compiled: bool = True
) -> tuple[dict[str, Task], dict[str, str]]:
    """The tasks to time for the queries from ``first`` on, and the reasons why others are absent.

    Args:
        learner: The learner to compare.
        first: Index of the first query on its grid.
        compiled: Whether torch.compile takes part; compiling takes most of a minute.
    """
    time, position = float(learner.grid[first]), learner.demonstrations[0, first]
    contenders: dict[str, Task] = {
        OURS: partial(learner.predict, np.array([time]), position[None], learner.grid[first:]),
        BARE: make_products(learner, first, precompute=True),
        PUBLISHED_BARE: make_products(learner, first, precompute=False),
    }
    others: dict[str, Callable[[CnmpLearner, int], Network]] = {
        "torch eager": make_published,
        "torch eager, time part kept": make_torch,
        "onnxruntime": make_onnx,
        "torch.compile": make_compiled,
    }
    absent: dict[str, str] = {}
    if not compiled:
        del others["torch.compile"]
        absent["torch.compile"] = "not in a quick run: compiling takes most of a minute"
    for name, make in others.items():
        try:
            predictor = Predictor(learner, first, make)
            encoded = predictor.encode(time, position)
            predictor.network(encoded)
        except Exception as error:  # Compilers and runtimes raise exceptions of many types.
            absent[name] = f"{type(error).__name__}: {str(error).strip().partition(chr(10))[0]}"
            continue
        contenders[name] = partial(predictor.predict, time, position)
        contenders[f"{name}{NETWORK_ALONE}"] = partial(predictor.network, encoded)
    return contenders, absent
