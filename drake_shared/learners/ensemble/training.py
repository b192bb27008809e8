"""Training an ensemble: its members side by side, from different seeds."""

from __future__ import annotations

from time import perf_counter
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstrations
from drake_shared.learners.calibration import calibrate
from drake_shared.learners.cnmp.training import train_together
from drake_shared.learners.ensemble.learner import EnsembleLearner

SEED_STEP = 104_729
"""Between the seeds of successive members, so that ensembles of neighbouring seeds share no member."""
MAX_MEMBERS = 100
_OF_EACH_MEMBER = ("seed", "restarts", "iterations", "ignores_observations", "loss")


def train_ensemble(
    demonstrations: Demonstrations,
    *,
    members: int = 5,
    seed: int = 0,
    begun: float | None = None,
    **options: Any,
) -> EnsembleLearner:
    """Trains the members side by side.

    Args:
        demonstrations: At least one.
        members: From 2 to 100.
        seed: Of the first member; those of the others follow from it.
        begun: See `drake_shared.learners.cnmp.training.train`.
        options: As for a single CNMP.

    Raises:
        InputError: ``members`` is out of range, or an option is invalid.
        RunError: The loss became NaN or infinite.
    """
    if not 2 <= members <= MAX_MEMBERS:
        raise InputError("train", "members", f"must be from 2 to {MAX_MEMBERS}", members)
    begun = perf_counter() if begun is None else begun
    seeds = [seed + SEED_STEP * member for member in range(members)]
    trained = train_together([demonstrations] * members, seeds, begun=begun, **options)
    records = [member.metadata["training"] for member in trained]
    record = {name: value for name, value in records[-1].items() if name not in _OF_EACH_MEMBER}
    record |= {"seed": seed, "members": [{name: each[name] for name in _OF_EACH_MEMBER} for each in records]}
    ensemble = EnsembleLearner(
        members=trained, confidence_gain=1.0, metadata={**trained[0].metadata, "training": record}
    )
    # The gain of each member is bounded where its variance is negligible; the same bound holds for all.
    bound = max(member.confidence_gain for member in trained)
    ensemble.confidence_gain = min(calibrate(ensemble, demonstrations), bound)
    return ensemble
