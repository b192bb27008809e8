"""Learners of intentions: what they offer, how they are trained, and their files. Knows no Drake.

Training needs torch, which is imported by the first call of `train` and by nothing else.
"""

from __future__ import annotations

import inspect
import time
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.base import Learner, confidence, mean_variance
from drake_shared.learners.calibration import calibrate
from drake_shared.learners.cnmp.parameters import PRESETS, TrainingParameters
from drake_shared.learners.registry import find_learner, find_trainer, learner_names
from drake_shared.learners.storage import load_learner, save_learner

__all__ = [
    "PRESETS",
    "Learner",
    "TrainingParameters",
    "calibrate",
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
            `drake_shared.learners.cnmp.training.train` describes, and what else the trainer takes. Those
            which a trainer does not take are omitted, those which it requires have defaults.

    Raises:
        InputError: There is no such learner, or an option or a score is invalid.
        RunError: Training diverged.
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
    takes = inspect.signature(trainer).parameters
    if not any(parameter.kind is parameter.VAR_KEYWORD for parameter in takes.values()):
        unknown = set(options) - set(takes) - set(defaults)
        if unknown:
            raise InputError("train", min(unknown), f"is not an option of the learner {learner!r}")
        options = {name: value for name, value in options.items() if name in takes}
    options |= {name: value for name, value in defaults.items() if name in takes and name not in options}
    return trainer(demonstrations, **options)
