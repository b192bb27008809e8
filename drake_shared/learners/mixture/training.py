"""Training a mixture: an expert for each way that was demonstrated, in torch."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np

from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.cnmp.optimization import Progress
from drake_shared.learners.cnmp.parameters import TrainingParameters, find_parameters
from drake_shared.learners.cnmp.training import (
    RESERVED,
    check_options,
    fit,
    one_thread,
    training_metadata,
    training_record,
)
from drake_shared.learners.dataset import make_dataset
from drake_shared.learners.mixture.learner import MixtureLearner
from drake_shared.learners.route_clustering import find_ways


def train_mixture(
    demonstrations: Demonstrations,
    *,
    preset: str = "default",
    weighted: bool = True,
    seed: int = 0,
    seconds: float | None = None,
    iterations: int | None = None,
    progress: Progress | None = None,
    parameters: TrainingParameters | None = None,
) -> MixtureLearner:
    """Trains an expert on each way, side by side; the arguments are those of `train`.

    Raises:
        InputError: An argument or a score is not what it must be.
        RunError: A loss became NaN or infinite.
    """
    begun = time.perf_counter()
    parameters = parameters or find_parameters(preset)
    if iterations is not None:
        parameters = dataclasses.replace(parameters, iterations=iterations)
    check_options(parameters, seconds=seconds, seed=seed)
    dataset = make_dataset(demonstrations, weighted=weighted)
    ways = find_ways(dataset.positions, spread=dataset.spread, extent=dataset.extent)
    shares = np.array([len(way) / len(dataset.positions) for way in ways])
    leanings = np.array([dataset.weights[way].sum() for way in ways]) / shares
    own = [
        dataclasses.replace(
            dataset,
            positions=dataset.positions[way],
            weights=dataset.weights[way] / dataset.weights[way].sum(),
            mean_path=dataset.positions[way].mean(axis=0),
        )
        for way in ways
    ]
    # An expert that predicts the same whatever it is shown is right where its way was driven once.
    each = dataclasses.replace(parameters, restarts=0)
    deadline = None if seconds is None else begun + seconds * (1.0 - RESERVED)
    with one_thread():
        seeds = [seed + index for index in range(len(ways))]
        trained = fit(own, each, seeds, deadline=deadline, progress=progress)
        metadata: dict[str, Any] = training_metadata(demonstrations, dataset, parameters)
        record = metadata["training"]
        record |= {"weighted": weighted, "seed": seed, "seconds_allowed": seconds}
        record["ways"] = [
            {"demonstrations": way.tolist(), **training_record(run, place)}
            for way, (run, place, _) in zip(ways, trained, strict=True)
        ]
        learner = MixtureLearner(
            experts=[run.export(place, confidence_gain=1.0, metadata={}) for run, place, _ in trained],
            shares=shares,
            leanings=leanings,
            noise=(parameters.noise or 0.1) * dataset.spread,
            confidence_gain=1.0,
            metadata={**metadata, "preset": parameters.preset},
        ).calibrated(demonstrations)
    learner.metadata["training"]["seconds"] = round(time.perf_counter() - begun, 3)
    return learner
