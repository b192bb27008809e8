"""Learners of human intention: prediction, training and files. Knows no Drake.

A learner is a distribution over trajectories, conditioned on where the robot was observed. This module has
what programs need; the rest of the room is

- `base`, `modes`, `check`: the interface `Learner`, its optional parts, and tests of it
- `registry`, `storage`, `fields`, `stored`: learners by name, their files, and base classes that write them
- `cnmp`, `ensemble`, `mixture`, `cesn`, `promp`, `no_learner`: the learners, each with its trainer beside it
- `consistency`: a model of demonstrated actions for arbitration, which is not a learner
- `dataset`, `augmentation`, `route_clustering`: preparation of demonstrations for training
- `calibration`, `ood_variance`: the gain K, and variance far from all demonstrations

Training a network needs torch, which `train` imports and nothing else does.
"""

from __future__ import annotations

import inspect
import time
from typing import Any

from drake_shared.common.errors import DrakeSharedError, InputError, RunError
from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.base import (
    Learner,
    MultimodalLearner,
    PrefixLearner,
    ScalableLearner,
    confidence,
    mean_variance,
)
from drake_shared.learners.calibration import calibrate
from drake_shared.learners.check import check_learner, check_prediction
from drake_shared.learners.cnmp.parameters import PRESETS, TrainingParameters
from drake_shared.learners.modes import Modes
from drake_shared.learners.no_learner import NoLearner
from drake_shared.learners.registry import find_learner, find_trainer, learner_names
from drake_shared.learners.storage import load_learner, save_learner

__all__ = [
    "PRESETS",
    "Learner",
    "Modes",
    "MultimodalLearner",
    "NoLearner",
    "PrefixLearner",
    "ScalableLearner",
    "TrainingParameters",
    "calibrate",
    "check_learner",
    "check_prediction",
    "confidence",
    "find_learner",
    "find_trainer",
    "learner_names",
    "load_learner",
    "mean_variance",
    "save_learner",
    "train",
]

_DEFAULTS = {
    "preset": "default",
    "weighted": True,
    "seed": 0,
    "seconds": None,
    "iterations": None,
    "progress": None,
}


def train(
    demonstrations: Demonstrations, *, learner: str = "cnmp", members: int = 1, **options: Any
) -> Learner:
    """Trains a learner.

    Args:
        demonstrations: At least one.
        learner: "cnmp", "mixture", "cesn", "promp" or one that is registered; see
            `drake_shared.learners.registry`.
        members: More than one trains an ensemble of a "cnmp".
        options: preset, weighted, seed, seconds, iterations, progress, which
            `drake_shared.learners.cnmp.training.train` describes, and other options of the trainer. Of the
            former a trainer gets those that it accepts, with their defaults.

    Raises:
        InputError: There is no such learner, an option or a score is invalid, or the result fails
            `check_learner`.
        RunError: Training diverged, or the trainer of another package failed.
    """
    # Importing torch takes seconds, which count.
    defaults = {**_DEFAULTS, "begun": time.perf_counter()}
    if learner == "cnmp" and members != 1:
        learner = "ensemble"
    if learner == "ensemble" and members != 1:
        options["members"] = members
    elif members != 1:
        raise InputError("train", "members", f"must be 1 for {learner!r}: ensembles are of 'cnmp'", members)
    trainer = find_trainer(learner)
    accepted = inspect.signature(trainer).parameters
    given = {**defaults, **options}
    if not any(parameter.kind is parameter.VAR_KEYWORD for parameter in accepted.values()):
        unknown = set(options) - set(accepted) - set(defaults)
        if unknown:
            raise InputError("train", min(unknown), f"is not an option of the learner {learner!r}")
        given = {name: value for name, value in given.items() if name in accepted}
    try:
        trained = trainer(demonstrations, **given)
    except Exception as error:
        if isinstance(error, DrakeSharedError) or trainer.__module__.startswith("drake_shared."):
            raise
        # A trainer of another package may fail in any way.
        raise RunError(f"learner {learner!r} cannot be trained ({type(error).__name__}: {error})") from error
    check_learner(trained, source=f"learner {learner!r}")
    return trained
