"""Learners of intentions: what they offer, how they are trained, and their files. Knows no Drake.

Training needs torch, which is imported by the first call of `train` and by nothing else.
"""

from __future__ import annotations

from typing import Any

from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.calibration import calibrate
from drake_shared.learners.interface import Learner, confidence, mean_variance
from drake_shared.learners.parameters import PRESETS, TrainingParameters
from drake_shared.learners.storage import load_learner, save_learner

__all__ = [
    "PRESETS",
    "Learner",
    "TrainingParameters",
    "calibrate",
    "confidence",
    "load_learner",
    "mean_variance",
    "save_learner",
    "train",
]


def train(demonstrations: Demonstrations, **options: Any) -> Learner:
    """Trains a learner; see `drake_shared.learners.training.train` for the options."""
    from drake_shared.learners.training import train as train_cnmp

    return train_cnmp(demonstrations, **options)
