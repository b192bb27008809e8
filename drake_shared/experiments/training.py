"""Trains the learners of the experiments."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from drake_shared.demonstrations import Demonstrations
from drake_shared.learners import Learner
from drake_shared.learners.cnmp.parameters import PRESETS as PARAMETERS, TrainingParameters
from drake_shared.learners.loss_threshold import loss_threshold

PRESETS = ("paper", "default")
"""Presets that experiments compare, in the order of the report."""
# Three demonstrations need fewer samples than sixty: with half the batch and fewer iterations, learners
# predict new demonstrations as well, in a fifth of the time, and an experiment can average over many.
STUDIED = {
    "default": dataclasses.replace(PARAMETERS["default"], iterations=1_200, batch=32),
    "paper": PARAMETERS["paper"],
}
CAPPED = {"paper": 12_000}
"""Most iterations of learners with more than three demonstrations, by preset; see `train_all`."""
_FEW = 3
_TRAINED_TOGETHER = 20
"""Learners in one batched computation of `train_together`."""


def studied(preset: str) -> TrainingParameters:
    """The training parameters of a preset in experiments."""
    return STUDIED[preset]


def train_all(
    sets: Sequence[Demonstrations],
    seeds: Sequence[int],
    *,
    preset: str,
    weighted: bool | Sequence[bool] = True,
    **options: Any,
) -> list[Any]:
    """Trains a CNMP for each set of demonstrations, many at a time. Imports torch.

    With preset paper, learners with more than three demonstrations are trained for one cycle of the schedule,
    in which only some of them reach Lt: up to three cycles more would take seven times as long. They then
    meet conditions and follow routes about as well.

    Args:
        sets: The demonstrations of each learner.
        seeds: The seed of each training.
        preset: Of all learners.
        weighted: Whether scores weight the demonstrations, for all learners or for each.
        options: Further options of `train_together`.
    """
    from drake_shared.learners.cnmp.training import train_together

    if not sets:
        return []
    options = {"parameters": studied(preset), **options}
    weights = [weighted] * len(sets) if isinstance(weighted, bool) else list(weighted)
    capped = [preset in CAPPED and len(one) > _FEW for one in sets]
    trained: dict[int, Any] = {}
    for cap in sorted(set(capped)):
        chosen = [index for index, one in enumerate(capped) if one == cap]
        if cap:
            options["iterations"] = min(options["parameters"].iterations, CAPPED[preset])
        learners = train_together(
            [sets[index] for index in chosen],
            [seeds[index] for index in chosen],
            weighted=[weights[index] for index in chosen],
            **options,
        )
        trained |= dict(zip(chosen, learners, strict=True))
    return [trained[index] for index in range(len(sets))]


def training_cost(preset: str, count: int) -> float:
    """Approximate time of `train_all` for ``count`` learners on one core while other cores train too, in [s].

    Training is limited by the memory bandwidth that processes share; a single process is faster.

    Args:
        preset: Of all learners.
        count: Number of learners.
    """
    groups = -(-count // _TRAINED_TOGETHER)
    if preset == "paper":
        return 14.0 * count
    return 4.0 * groups + 1.4 * count


def stopped_early(learner: Learner | None) -> bool:
    """Whether the training of a learner ended before its loss threshold."""
    found = None if learner is None else loss_threshold(learner.metadata)
    return found is not None and not found["reached"]


def ignores_observations(learner: Learner) -> bool:
    """Whether a CNMP predicts the same whatever it is conditioned on, as its training found."""
    return bool(learner.metadata["training"]["ignores_observations"])
