"""Learners of intentions: what they offer, how they are trained, and their files. Knows no Drake.

Training needs torch, which is imported by the first call of `train` and by nothing else.
"""

from __future__ import annotations

from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.demonstrations.demonstrations import Demonstrations
from drake_shared.learners.base import Learner, confidence, mean_variance
from drake_shared.learners.calibration import calibrate
from drake_shared.learners.cnmp.parameters import PRESETS, TrainingParameters
from drake_shared.learners.registry import find_learner, learner_names
from drake_shared.learners.storage import load_learner, save_learner

__all__ = [
    "PRESETS",
    "Learner",
    "TrainingParameters",
    "calibrate",
    "confidence",
    "find_learner",
    "learner_names",
    "load_learner",
    "mean_variance",
    "save_learner",
    "train",
]


def train(
    demonstrations: Demonstrations, *, learner: str = "cnmp", members: int = 1, **options: Any
) -> Learner:
    """Trains a learner.

    Args:
        demonstrations: At least one.
        learner: "cnmp", "mixture", "cesn", "promp" or one that is registered; see
            `drake_shared.learners.registry`.
        members: More than one makes an ensemble of a "cnmp"; see `drake_shared.learners.ensemble`.
        options: preset, weighted, seed, seconds, iterations, progress;
            `drake_shared.learners.cnmp.training.train` says what they mean.

    Raises:
        InputError: There is no such learner, or it cannot be taught so.
    """
    if learner == "cnmp" and members != 1:
        learner = "ensemble"
    if learner == "ensemble" and members != 1:
        options["members"] = members
    elif members != 1:
        raise InputError("train", "members", f"must be 1 for {learner!r}: ensembles are of 'cnmp'", members)
    return find_learner(learner, source="train").train(demonstrations, **options)
