"""Where a demonstrated task leaves open which way the driver is going, and whether w knows it.

The claim behind Fig. 4 of Amirshirzad et al. 2022 is that the human's share rises where ways that were
demonstrated run together and will part again. This makes it a measure.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import rankdata

from drake_shared.demonstrations import ProgressClock
from drake_shared.simulation.trial import Trial

TOGETHER = 0.15
PARTED = 0.3


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Ambiguity:
    """Steps of a trial, n without its last row, which is not applied.

    Attributes:
        ambiguous: Shape (n,), whether another demonstration at equal progress is within 0.15 m of the robot
            and later parts from its own by over 0.3 m.
        clear: Shape (n,), whether every other demonstration is over 0.3 m away.
        human_weight: Shape (n,), w.
    """

    ambiguous: np.ndarray
    clear: np.ndarray
    human_weight: np.ndarray


def ambiguity(trial: Trial, times: np.ndarray, demonstrations: np.ndarray) -> Ambiguity:
    """Tells the ambiguous steps of ``trial`` from the clear ones.

    The robot's own demonstration is the one that its way follows most closely at equal progress.

    Args:
        trial: A log.
        times: Shape (N,), of the demonstrations' grid, in [s].
        demonstrations: Shape (m, N, 2), on that grid, in [m]; m >= 2.
    """
    positions = trial.positions[:-1]
    steps = [_progress(times, item, positions) for item in demonstrations]
    strays = [
        np.linalg.norm(positions - item[step], axis=1).mean()
        for item, step in zip(demonstrations, steps, strict=True)
    ]
    own = int(np.argmin(strays))
    step = steps[own]
    others = [index for index in range(len(demonstrations)) if index != own]
    away = np.linalg.norm(demonstrations[others][:, step] - positions, axis=2)
    # How far its way runs from theirs, whenever they come there: one way at another pace is no parting.
    apart = np.stack([cKDTree(demonstrations[index]).query(demonstrations[own])[0] for index in others])
    later = np.maximum.accumulate(apart[:, ::-1], axis=1)[:, ::-1][:, step]
    return Ambiguity(
        ambiguous=((away < TOGETHER) & (later > PARTED)).any(axis=0),
        clear=(away > PARTED).all(axis=0),
        human_weight=trial["human_weight"][:-1],
    )


def weights(parts: list[Ambiguity]) -> dict[str, float]:
    """Mean w over the ambiguous and over the clear steps of all trials; NaN where there are none."""
    named = {"weight_where_ambiguous": "ambiguous", "weight_where_clear": "clear"}
    found = {
        name: np.concatenate([part.human_weight[getattr(part, kind)] for part in parts])
        for name, kind in named.items()
    }
    return {name: float(values.mean()) if values.size else float("nan") for name, values in found.items()}


def ranking(parts: list[Ambiguity]) -> float:
    """Area under the ROC curve of w as a sign of ambiguity against clarity, over all steps of all trials.

    1 if every ambiguous step has a higher w than every clear one, 0.5 if w knows nothing; NaN if there are
    no steps of one kind.
    """
    high = np.concatenate([part.human_weight[part.ambiguous] for part in parts])
    low = np.concatenate([part.human_weight[part.clear] for part in parts])
    if not (high.size and low.size):
        return float("nan")
    ranks = rankdata(np.concatenate([high, low]))[: high.size]
    return float((ranks.sum() - high.size * (high.size + 1) / 2) / (high.size * low.size))


def _progress(times: np.ndarray, demonstration: np.ndarray, positions: np.ndarray) -> np.ndarray:
    clock = ProgressClock(times, demonstration[None])
    reached, steps = 0.0, []
    for x, y in positions:
        reached = clock.advance(reached, x, y)
        steps.append(min(int(times.searchsorted(reached)), len(times) - 1))
    return np.array(steps)
