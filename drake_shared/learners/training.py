"""Alg. 1 of Amirshirzad et al. 2022: training a CNMP on weighted demonstrations, in torch."""

from __future__ import annotations

import dataclasses
import platform
import time
from typing import Any

import numpy as np
import torch
from threadpoolctl import threadpool_limits

from drake_shared.demonstrations import Demonstrations
from drake_shared.errors import InputError
from drake_shared.learners.calibration import LEAST_CONFIDENCE, calibrate
from drake_shared.learners.cnmp import CnmpLearner
from drake_shared.learners.dataset import Dataset, make_dataset
from drake_shared.learners.optimisation import Optimisation, Progress
from drake_shared.learners.parameters import TrainingParameters, find_parameters

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
    begun = time.perf_counter() if begun is None else begun
    chosen = parameters or find_parameters(preset)
    if iterations is not None:
        chosen = dataclasses.replace(chosen, iterations=iterations)
    check_options(chosen, seconds=seconds, seed=seed)
    dataset = make_dataset(demonstrations, weighted=weighted, duration=duration)
    deadline = None if seconds is None else begun + seconds * (1.0 - RESERVED)
    threads = torch.get_num_threads()
    # The arrays are small: a second thread makes it slower, and changes the bits.
    torch.set_num_threads(1)
    try:
        with threadpool_limits(1, user_api="blas"):
            restarts = 0
            while True:
                run = Optimisation(dataset, chosen, seed + SEED_STEP * restarts)
                last = restarts == chosen.restarts
                run.run(deadline=deadline, progress=progress, may_give_up=not last)
                if last or not run.ignores_observations:
                    break
                restarts += 1
            metadata = training_metadata(demonstrations, dataset, chosen)
            record = metadata["training"]
            record |= {
                "planned": run.planned,
                "iterations": run.iterations,
                "held_out": run.held_out,
                "ignores_observations": run.ignores_observations,
                "loss": run.losses,
            }
            record |= {"weighted": weighted, "seed": seed, "restarts": restarts, "seconds_allowed": seconds}
            gain = calibrate(
                run.export(confidence_gain=1.0, metadata=metadata),
                demonstrations,
                resolution=0.5 * chosen.noise * dataset.spread,
            )
    finally:
        torch.set_num_threads(threads)
    record["seconds"] = round(time.perf_counter() - begun, 3)
    return run.export(confidence_gain=gain, metadata=metadata, doubtful=1.0 / (LEAST_CONFIDENCE * gain))


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
        "data_sha256": dataset.digest,
        "demonstrations": len(demonstrations),
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
