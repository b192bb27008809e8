"""Training an ensemble: its members side by side, from different seeds."""

from __future__ import annotations

import dataclasses
from time import perf_counter
from typing import Unpack

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstrations, align
from drake_shared.learners.calibration import calibrate
from drake_shared.learners.cnmp.training import Options, train_together
from drake_shared.learners.ensemble.learner import EnsembleLearner

SEED_STEP = 104_729
"""Between the seeds of successive members, so that ensembles of neighbouring seeds share no member."""
MAX_MEMBERS = 100
_OF_EACH_MEMBER = ("seed", "restarts", "iterations", "ignores_observations", "loss")


def train_ensemble(
    demonstrations: Demonstrations,
    *,
    members: int = 5,
    weighted: bool = True,
    seed: int = 0,
    **options: Unpack[Options],
) -> EnsembleLearner:
    """Trains the members side by side.

    Args:
        demonstrations: At least one.
        members: From 2 to 100.
        weighted, options: As of `drake_shared.learners.cnmp.training.train`.
        seed: Of the first member; those of the others follow from it.

    Raises:
        InputError: ``members`` is out of range, or an option is invalid.
        RunError: The loss became NaN or infinite.
    """
    if not 2 <= members <= MAX_MEMBERS:
        raise InputError("train", "members", f"must be from 2 to {MAX_MEMBERS}", members)
    options.setdefault("begun", perf_counter())
    seeds = [seed + SEED_STEP * member for member in range(members)]
    trained = train_together([demonstrations] * members, seeds, weighted=weighted, **options)
    records = [member.metadata["training"] for member in trained]
    record = {name: value for name, value in records[-1].items() if name not in _OF_EACH_MEMBER}
    record |= {"seed": seed, "members": [{name: each[name] for name in _OF_EACH_MEMBER} for each in records]}
    ensemble = EnsembleLearner(
        members=tuple(trained),
        preset=trained[0].preset,
        metadata={**trained[0].metadata, "training": record},
    )
    # The gain of each member is bounded where its variance is negligible; the same bound holds for all.
    bound = max(member.confidence_gain for member in trained)
    calibration = options.get("calibration", "percentile")
    if ensemble.metadata["clock"] == "progress":
        demonstrations = align(demonstrations)
    gain = min(calibrate(ensemble, demonstrations, calibration=calibration), bound)
    return dataclasses.replace(ensemble, confidence_gain=gain)
