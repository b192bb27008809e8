"""Training a mixture: an expert for each way that was demonstrated, in torch."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np
import torch
from threadpoolctl import threadpool_limits

from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.dataset import make_dataset
from drake_shared.learners.mixture import MixtureLearner
from drake_shared.learners.optimisation import Optimisation, Progress
from drake_shared.learners.parameters import find_parameters
from drake_shared.learners.training import RESERVED, check_options, training_metadata
from drake_shared.learners.ways import find_ways


def train_mixture(
    demonstrations: Demonstrations,
    *,
    preset: str = "default",
    weighted: bool = True,
    seed: int = 0,
    seconds: float | None = None,
    iterations: int | None = None,
    progress: Progress | None = None,
) -> MixtureLearner:
    """Trains an expert on each way; the arguments are those of `drake_shared.learners.training.train`.

    Iterations and seconds are divided evenly between the experts.

    Raises:
        InputError: An argument or a score is not what it must be.
        RunError: A loss became NaN or infinite.
    """
    begun = time.perf_counter()
    parameters = find_parameters(preset)
    if iterations is not None:
        parameters = dataclasses.replace(parameters, iterations=iterations)
    check_options(parameters, seconds=seconds, seed=seed)
    dataset = make_dataset(demonstrations, weighted=weighted)
    ways = find_ways(dataset.positions, spread=dataset.spread, extent=dataset.extent)
    each = dataclasses.replace(parameters, iterations=max(1, parameters.iterations // len(ways)))
    shares = np.array([len(way) / len(dataset.positions) for way in ways])
    leanings = np.array([dataset.weights[way].sum() for way in ways]) / shares
    experts, iterations_done, losses = [], 0, []
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with threadpool_limits(1, user_api="blas"):
            for index, way in enumerate(ways):
                chosen = dataset.positions[way]
                weights = dataset.weights[way] / dataset.weights[way].sum()
                own = dataclasses.replace(
                    dataset, positions=chosen, weights=weights, mean_path=chosen.mean(axis=0)
                )
                run = Optimisation(own, each, seed + index)
                deadline = None
                if seconds is not None:
                    deadline = begun + seconds * (1.0 - RESERVED) * (index + 1) / len(ways)
                run.run(deadline=deadline, progress=_part(progress, index, len(ways)), may_give_up=False)
                experts.append(run.export(confidence_gain=1.0, metadata={}))
                iterations_done += run.iterations
                losses.append(run.losses)
            metadata: dict[str, Any] = training_metadata(demonstrations, dataset, parameters)
            record = metadata["training"]
            record |= {"iterations": iterations_done, "loss": losses, "ways": [way.tolist() for way in ways]}
            record |= {"weighted": weighted, "seed": seed, "seconds_allowed": seconds}
            learner = MixtureLearner(
                experts=experts,
                shares=shares,
                leanings=leanings,
                noise=(parameters.noise or 0.1) * dataset.spread,
                confidence_gain=1.0,
                metadata={**metadata, "preset": preset},
            ).calibrated(demonstrations)
    finally:
        torch.set_num_threads(threads)
    learner.metadata["training"]["seconds"] = round(time.perf_counter() - begun, 3)
    return learner


def _part(progress: Progress | None, index: int, count: int) -> Progress | None:
    """Progress of one of ``count`` experts as progress of the whole."""
    if progress is None:
        return None

    def report(done: int, planned: int, loss: float) -> None:
        progress(index * planned + done, count * planned, loss)

    return report
