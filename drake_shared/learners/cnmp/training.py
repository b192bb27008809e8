"""Alg. 1 of Amirshirzad et al. 2022: training CNMPs on weighted demonstrations, in torch."""

from __future__ import annotations

import contextlib
import dataclasses
import platform
import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import torch

from drake_shared.common.errors import InputError
from drake_shared.common.threads import single_threaded
from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.calibration import LEAST_CONFIDENCE, calibrate
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.optimization import Optimisation, Progress
from drake_shared.learners.cnmp.parameters import TrainingParameters, find_parameters
from drake_shared.learners.dataset import Dataset, data_record, make_dataset
from drake_shared.learners.heap import kept_memory

RESERVED = 0.05
"""Share of the seconds given that is kept for what is not iterations: data, calibration."""
SEED_STEP = 7919
"""From one seed to that of the next attempt, so that neighbouring seeds share none."""


def train(
    demonstrations: Demonstrations,
    *,
    preset: str = "default",
    weighted: bool = True,
    seed: int = 0,
    seconds: float | None = None,
    iterations: int | None = None,
    progress: Progress | None = None,
    duration: float | None = None,
    parameters: TrainingParameters | None = None,
    begun: float | None = None,
) -> CnmpLearner:
    """Trains a CNMP.

    The same demonstrations, parameters, seed and number of iterations give the same bits on the same kind of
    processor. ``seconds`` decides how many iterations there are, so that the result depends on the machine's
    speed; the training record says how many there were.

    Args:
        demonstrations: At least one.
        preset: "default" or "paper".
        weighted: Whether scores, where all have one, decide which demonstrations are leant to.
        seed: Of the network's first weights and of all that is drawn.
        seconds: Bounds the time and plans the iterations.
        iterations: In place of the preset's.
        progress: Called now and then.
        duration: T, in [s]; default: that of the longest demonstration.
        parameters: In place of the preset's.
        begun: When the seconds began to count, by `time.perf_counter`; default: now.

    Raises:
        InputError: An argument or a score is not what it must be.
        RunError: The loss became NaN or infinite.
    """
    (learner,) = train_together(
        [demonstrations],
        [seed],
        preset=preset,
        weighted=weighted,
        seconds=seconds,
        iterations=iterations,
        progress=progress,
        duration=duration,
        parameters=parameters,
        begun=begun,
    )
    return learner


def train_together(
    taught: Sequence[Demonstrations],
    seeds: Sequence[int],
    *,
    preset: str = "default",
    weighted: bool | Sequence[bool] = True,
    seconds: float | None = None,
    iterations: int | None = None,
    progress: Progress | None = None,
    duration: float | None = None,
    parameters: TrainingParameters | None = None,
    begun: float | None = None,
) -> list[CnmpLearner]:
    """Trains a CNMP on each of several sets of demonstrations, in one batched computation.

    What one becomes does not depend on its company, but for the rounding of batched products and for when
    training is cut short where nothing improves any more, which is decided for all.

    Args:
        taught: Of each learner; all of one duration.
        seeds: Of each learner.
        weighted: As for `train`, for all or of each.

    The other arguments, and what is raised, are those of `train`.
    """
    begun = time.perf_counter() if begun is None else begun
    chosen = parameters or find_parameters(preset)
    if iterations is not None:
        chosen = dataclasses.replace(chosen, iterations=iterations)
    check_options(chosen, seconds=seconds, seed=min(seeds))
    lean = [weighted] * len(taught) if isinstance(weighted, bool) else list(weighted)
    datasets = [
        make_dataset(demonstrations, weighted=leans, duration=duration)
        for demonstrations, leans in zip(taught, lean, strict=True)
    ]
    deadline = None if seconds is None else begun + seconds * (1.0 - RESERVED)
    learners = []
    with one_thread():
        trained = fit(datasets, chosen, seeds, deadline=deadline, progress=progress)
        for index, (run, place, restarts) in enumerate(trained):
            metadata = training_metadata(taught[index], datasets[index], chosen)
            record = metadata["training"]
            record |= training_record(run, place)
            record |= {
                "weighted": lean[index],
                "seed": seeds[index],
                "restarts": restarts,
                "seconds_allowed": seconds,
                "trained_together": len(taught),
            }
            gain = calibrate(
                run.export(place, confidence_gain=1.0, metadata=metadata),
                taught[index],
                resolution=0.5 * chosen.noise * datasets[index].spread,
            )
            record["seconds"] = round(time.perf_counter() - begun, 3)
            doubtful = 1.0 / (LEAST_CONFIDENCE * gain)
            learners.append(run.export(place, confidence_gain=gain, metadata=metadata, doubtful=doubtful))
    return learners


def fit(
    datasets: Sequence[Dataset],
    parameters: TrainingParameters,
    seeds: Sequence[int],
    *,
    deadline: float | None,
    progress: Progress | None,
) -> list[tuple[Optimisation, int, int]]:
    """Trains a network on each dataset; those that ignore what they are shown again from other seeds.

    Returns:
        Of each dataset the training, the place of its network there, and how often it was begun again.
    """
    found: dict[int, tuple[Optimisation, int, int]] = {}
    waiting = list(range(len(datasets)))
    for restarts in range(parameters.restarts + 1):
        run = Optimisation(
            [datasets[index] for index in waiting],
            parameters,
            [seeds[index] + SEED_STEP * restarts for index in waiting],
        )
        run.run(deadline=deadline, progress=progress, may_give_up=restarts < parameters.restarts)
        found |= {index: (run, place, restarts) for place, index in enumerate(waiting)}
        waiting = [index for place, index in enumerate(waiting) if run.ignores_observations[place]]
        if not waiting:
            break
    return [found[index] for index in range(len(datasets))]


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """How networks as small as these are trained quickly, with the same bits every time.

    A second thread makes it slower, and changes the bits. Units that are silent leave the optimiser with
    moments that fade towards nothing, and numbers so small cost a processor a hundred times as much: they are
    taken for zero.
    """
    torch.set_flush_denormal(True)
    try:
        with single_threaded(), kept_memory():
            yield
    finally:
        torch.set_flush_denormal(False)


def check_options(parameters: TrainingParameters, *, seconds: float | None, seed: int) -> None:
    """Refuses what no training can be done with.

    Raises:
        InputError: Says which option and what it must be.
    """
    if parameters.iterations < 1:
        raise InputError("train", "iterations", "must be at least 1", parameters.iterations)
    if seconds is not None and not (np.isfinite(seconds) and seconds > 0.0):
        raise InputError("train", "seconds", "must be positive and finite", seconds)
    if seed < 0:
        raise InputError("train", "seed", "must be 0 or more", seed)


def training_metadata(
    demonstrations: Demonstrations, dataset: Dataset, parameters: TrainingParameters
) -> dict[str, Any]:
    """What a learner's file says of its scenario, of how it is to be used and of how it was trained."""
    record = {
        "parameters": parameters.to_json(),
        **data_record(demonstrations, dataset),
        "versions": {
            "torch": torch.__version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
    }
    return {
        "scenario": demonstrations.scenario,
        "clock": parameters.clock,
        "evidence": parameters.evidence,
        "training": record,
    }


def training_record(run: Optimisation, place: int) -> dict[str, Any]:
    """What happened in the training of one network."""
    return {
        "planned": run.planned,
        "iterations": run.iterations[place],
        "held_out": run.held_out[place],
        "ignores_observations": run.ignores_observations[place],
        "loss": run.losses[place],
    }
