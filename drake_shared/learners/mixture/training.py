"""Training a mixture: an expert for each demonstrated route, side by side."""

from __future__ import annotations

import dataclasses
from typing import Unpack

import numpy as np

from drake_shared.demonstrations import Demonstrations, align
from drake_shared.learners.calibration import calibrate
from drake_shared.learners.cnmp.training import Options, Plan, fast_training, fit, training_metadata
from drake_shared.learners.dataset import make_dataset
from drake_shared.learners.mixture.learner import MixtureLearner
from drake_shared.learners.route_clustering import group_by_route


def train_mixture(
    demonstrations: Demonstrations, *, weighted: bool = True, seed: int = 0, **options: Unpack[Options]
) -> MixtureLearner:
    """Trains a mixture; arguments and errors as of `drake_shared.learners.cnmp.training.train`."""
    plan = Plan.make(seed=seed, **options)
    if plan.parameters.clock == "progress":
        demonstrations = align(demonstrations)
    dataset = make_dataset(
        demonstrations,
        weighted=weighted,
        duration=options.get("duration"),
        score_width=plan.parameters.score_width,
    )
    routes = group_by_route(dataset.positions)
    shares = np.array([len(route) / len(dataset.positions) for route in routes])
    leanings = np.array([dataset.weights[route].sum() for route in routes]) / shares
    datasets = [
        dataclasses.replace(
            dataset,
            positions=dataset.positions[route],
            weights=dataset.weights[route] / dataset.weights[route].sum(),
            mean_path=dataset.positions[route].mean(axis=0),
        )
        for route in routes
    ]
    # An expert that ignores observations is right where its route was demonstrated once.
    once = dataclasses.replace(plan, parameters=dataclasses.replace(plan.parameters, restarts=0))
    noise = (plan.parameters.noise or 0.1) * dataset.spread
    with fast_training():
        trained = fit(datasets, once, [seed + index for index in range(len(routes))])
        metadata = training_metadata(demonstrations, dataset, plan.parameters)
        record = metadata["training"]
        record |= {"weighted": weighted, "seed": seed, "seconds_allowed": plan.seconds}
        record["ways"] = [
            {"demonstrations": route.tolist(), **run.record(place)}
            for route, (run, place, _) in zip(routes, trained, strict=True)
        ]
        learner = MixtureLearner(
            experts=tuple(run.export(place) for run, place, _ in trained),
            shares=shares,
            leanings=leanings,
            noise=noise,
            preset=plan.parameters.preset,
            metadata=metadata,
        )
        gain = calibrate(learner, demonstrations, resolution=noise, calibration=plan.calibration)
    record["seconds"] = plan.spent()
    return dataclasses.replace(learner, confidence_gain=gain)
