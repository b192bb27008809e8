"""Group 1: a prediction from one observation, against the same arithmetic by other means."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
import torch

from drake_shared.experiments.benchmark.predictors import (
    BareProducts,
    Network,
    PlainProducts,
    Predictor,
    make_compiled,
    make_onnx,
    make_plain_torch,
    make_torch,
)
from drake_shared.experiments.benchmark.results import GroupResult, Ratio
from drake_shared.experiments.benchmark.test_tasks import Setting, with_grid
from drake_shared.experiments.benchmark.timing import Seconds, Task, interleave, ratio, spread
from drake_shared.learners.cnmp.learner import CnmpLearner

QUERIES = 301
"""Every control step of 15 s."""
OURS = "drake_shared"
BARE = "bare products"
PLAIN = "bare products of the plain network"
ALONE = ", network alone"

_METHOD = (
    "A CNMP of the shipped size on a grid of 301 queries (0.05 s), shown one point of a demonstration, "
    "asked for all queries or the last half of them; one thread. Every contender takes the observation "
    "and returns mean and variance in metres as numpy arrays, with the same code around its network "
    "('network alone' is without that code); ours also adds what distance from the demonstrations does. "
    "'torch eager' is the network as published codes have it; the others have the time part of the "
    "decoder's first layer computed beforehand, as we do. The bare products are the matrix products of "
    "the same arrays, into float32 arrays made beforehand, and nothing else; those of the plain network "
    "are what they would be without that."
)


def run(setting: Setting) -> GroupResult:
    """Measures it."""
    learner = with_grid(setting.cnmp, QUERIES)
    block = 0.01 if setting.quick else 0.05
    ratios: list[Ratio] = []
    seconds: dict[str, Seconds] = {}
    absent: dict[str, str] = {}
    with one_torch_thread():
        for first in (0, QUERIES // 2 + 1):
            count = QUERIES - first
            contenders, missing = make_contenders(learner, first, compiled=not setting.quick)
            absent |= missing
            found = interleave(contenders, repeats=setting.repeats, block=block)
            for name, values in found.items():
                seconds[f"{name}, {count} queries"] = values
            ours = found[OURS]
            for name in (BARE, PLAIN):
                to_bare = ratio(ours, found[name])
                ratios.append(
                    Ratio(name=f"{OURS} / {name}, {count} queries", spread=to_bare, aim="at most 2")
                )
            for name in found:
                if name not in (OURS, BARE, PLAIN) and not name.endswith(ALONE):
                    aim = "at least 4" if name == "torch eager" else ""
                    slower = ratio(found[name], ours)
                    ratios.append(Ratio(name=f"{name} / {OURS}, {count} queries", spread=slower, aim=aim))
    return GroupResult(
        name="predict",
        method=_METHOD,
        ratios=ratios,
        seconds={name: spread(values) for name, values in seconds.items()},
        absent=absent,
        details={
            "encoder": [int(bias.size) for _, bias in learner.model.encoder],
            "aggregation": learner.model.aggregation,
            "decoder": [int(bias.size) for _, bias in learner.model.decoder],
            "harmonics": learner.model.harmonics,
        },
    )


def make_contenders(
    learner: CnmpLearner, first: int, *, compiled: bool = True
) -> tuple[dict[str, Task], dict[str, str]]:
    """What to time for the queries of the grid from ``first`` on, and why the others are absent.

    Args:
        learner: Ours.
        first: Index of the first query.
        compiled: Whether torch.compile takes part; compiling takes most of a minute.
    """
    model = learner.model
    time, position = float(model.grid[first]), model.demonstrations[0, first]
    times, positions, queries = np.array([time]), position[None], learner.grid[first:]
    bare = Predictor(model, first, BareProducts)
    assert isinstance(bare.network, BareProducts)
    bare.predict(time, position)
    contenders: dict[str, Task] = {
        OURS: partial(learner.predict, times, positions, queries),
        BARE: bare.network.multiply,
        PLAIN: PlainProducts(model, first).multiply,
    }
    absent: dict[str, str] = {}
    others: dict[str, Callable[..., Network]] = {
        "torch eager": make_plain_torch,
        "torch eager, time part kept": make_torch,
        "onnxruntime": make_onnx,
    }
    if compiled:
        others["torch.compile"] = make_compiled
    else:
        absent["torch.compile"] = "left out of a quick run: compiling takes long"
    for name, make in others.items():
        try:
            predictor = Predictor(model, first, make)
            encoded = predictor.encode(time, position)
            predictor.network(encoded)
        except Exception as error:  # What a compiler or a runtime raises is its own affair.
            absent[name] = _one_line(error)
            continue
        contenders[name] = partial(predictor.predict, time, position)
        contenders[f"{name}{ALONE}"] = partial(predictor.network, encoded)
    return contenders, absent


@contextmanager
def one_torch_thread() -> Iterator[None]:
    """A second thread makes networks this small slower."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _one_line(error: Exception) -> str:
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}: {text[0] if text else ''}"
