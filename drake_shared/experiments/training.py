"""Trains the learners of the experiments."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from drake_shared.demonstrations import Demonstrations
from drake_shared.learners import Learner
from drake_shared.learners.cnmp.parameters import PRESETS as PARAMETERS, TrainingParameters

PRESETS = ("paper", "default")
"""Presets that experiments compare, in the order of the report."""
# Three demonstrations need fewer samples than sixty: with half the batch and fewer iterations, learners
# predict new demonstrations as well, in a fifth of the time, and an experiment can average over many.
STUDIED = {
    "default": dataclasses.replace(PARAMETERS["default"], iterations=1_200, batch=32),
    "paper": PARAMETERS["paper"],
}
# A larger group of learners does not fit into the cache of a processor.
_TRAINED_TOGETHER = 30


def studied(preset: str) -> TrainingParameters:
    """The training parameters of a preset in experiments."""
    return STUDIED[preset]


def train_all(
    sets: Sequence[Demonstrations],
    seeds: Sequence[int],
    *,
    preset: str,
    weighted: bool | Sequence[bool] = True,
) -> list[Any]:
    """Trains a CNMP for each set of demonstrations, many at a time. Imports torch.

    Args:
        sets: The demonstrations of each learner.
        seeds: The seed of each training.
        preset: Of all learners.
        weighted: Whether scores weight the demonstrations, for all learners or for each.
    """
    from drake_shared.learners.cnmp.training import train_together

    weights = [weighted] * len(sets) if isinstance(weighted, bool) else list(weighted)
    trained: list[Any] = []
    for begin in range(0, len(sets), _TRAINED_TOGETHER):
        part = slice(begin, begin + _TRAINED_TOGETHER)
        trained += train_together(sets[part], seeds[part], weighted=weights[part], parameters=studied(preset))
    return trained


def training_cost(preset: str, count: int) -> float:
    """Approximate time of `train_all` for ``count`` learners on one core while other cores train too, in [s].

    Training is limited by the memory bandwidth that processes share; a single process is faster.
    """
    groups = -(-count // _TRAINED_TOGETHER)
    return 12.0 * count if preset == "paper" else 4.0 * groups + 1.2 * count


def ignores_observations(learner: Learner) -> bool:
    """Whether a CNMP predicts the same whatever it is conditioned on, as its training found."""
    return bool(learner.metadata["training"]["ignores_observations"])
