"""Why human and agent have the shares of control that they have: one reason of a fixed set."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Reason = Literal[
    "contact",
    "kept_away",
    "hands_off",
    "steady",
    "smoothed",
    "paused",
    "no_learner",
    "assistance_off",
    "agent_alone",
    "no_prediction",
    "conflict",
    "fixed_share",
    "off_demonstrations",
    "points_elsewhere",
    "routes_open",
    "unsure",
    "follows_you",
    "sure",
]
"""The reasons; the page has a sentence for each."""

TOGETHER = 0.2
"""Routes run together within this distance, in [m] for the Pioneer P3-DX."""
SEPARATE = 0.4
"""Routes are different ones if they later are further apart than this, in the same unit."""
OFF_DEMONSTRATIONS = 0.4
"""Distance from the nearest demonstration past which the robot is off them, in the same unit."""
MOVED_BY_COMMAND = 0.15
"""Change of the expected path by the human's command past which the human points elsewhere, the same."""
_UNSURE, _SURE = 0.5, 0.85  # Of the confidence.
_STEADY = 0.75  # Of the human weight.
_KEPT_AWAY = 0.2  # Of the shared command: what the safety filter changes.
_MOST_DEMONSTRATIONS = 48  # All pairs are compared.


@dataclasses.dataclass(frozen=True, kw_only=True)
class Surroundings:
    """Where the robot is among the demonstrations.

    Attributes:
        open_routes: Number of different routes that start near the robot.
        distance: To the nearest demonstration at the same progress, in [m].
    """

    open_routes: int
    distance: float


class DemonstratedRoutes:
    """Counts the routes of the demonstrations that are still possible from a position.

    Args:
        demonstrations: Shape (m, N, D), on one grid, in [m].
        scale: Length of the robot relative to the Pioneer P3-DX.
    """

    def __init__(self, demonstrations: NDArray[np.float64], *, scale: float = 1.0) -> None:
        step = math.ceil(len(demonstrations) / _MOST_DEMONSTRATIONS)
        self._paths = np.ascontiguousarray(demonstrations[::step].swapaxes(0, 1))
        self._scale = scale
        apart = np.linalg.norm(self._paths[:, :, None] - self._paths[:, None], axis=-1)
        # Shape (N, m, m): whether two demonstrations are different routes from an entry on.
        self._differ = np.maximum.accumulate(apart[::-1], axis=0)[::-1] > SEPARATE * scale

    def look(self, index: int, position: NDArray[np.float64]) -> Surroundings:
        """Looks around from ``position`` (D,), in [m], at entry ``index`` of the grid."""
        index = min(max(index, 0), len(self._paths) - 1)
        distances = np.linalg.norm(self._paths[index] - position, axis=-1)
        near = np.flatnonzero(distances < TOGETHER * self._scale)
        chosen: list[int] = []
        for candidate in near.tolist():
            if all(self._differ[index, candidate, other] for other in chosen):
                chosen.append(candidate)
        return Surroundings(open_routes=len(chosen), distance=float(distances.min()))


def reason_for(
    values: Mapping[str, float],
    *,
    mode: str,
    has_learner: bool,
    arbitration: str = "blend",
    let_go: str | None = None,
    surroundings: Surroundings | None = None,
    scale: float = 1.0,
    paused: bool = False,
) -> Reason:
    """Returns the one reason that explains the division of control best.

    Args:
        values: Columns of the log at this step: contact, confidence, human_weight, the shared command, and,
            if there are such, that of the safety filter and moved_by_command.
        mode: Who drives in this trial: "shared", "human" or "agent".
        has_learner: Whether a learner was chosen.
        arbitration: Name of the arbiter.
        let_go: Why the agent gives up control, if it does: "conflict" or "hands_off".
        surroundings: Where the robot is among the demonstrations, if they are known.
        scale: Length of the robot relative to the Pioneer P3-DX.
        paused: Whether the driver asked for a stop.
    """
    if paused:
        return "paused"
    if values.get("contact", 0.0) > 0.5:
        return "contact"
    if _is_kept_away(values):
        return "kept_away"
    if mode == "human":
        return "assistance_off" if has_learner else "no_learner"
    if mode == "agent":
        return "agent_alone"
    if let_go == "hands_off":
        return "hands_off"
    if arbitration == "fusion":
        # It has no use for the confidence.
        return "steady" if values["human_weight"] >= _STEADY else "smoothed"
    confidence = values["confidence"]
    if math.isnan(confidence):
        return "no_prediction"
    if let_go == "conflict":
        return "conflict"
    if arbitration == "halves":
        return "fixed_share"
    if confidence >= _UNSURE:
        return "sure" if confidence >= _SURE else "follows_you"
    if surroundings is not None and surroundings.distance > OFF_DEMONSTRATIONS * scale:
        return "off_demonstrations"
    if values.get("moved_by_command", 0.0) > MOVED_BY_COMMAND * scale:
        return "points_elsewhere"
    if surroundings is not None and surroundings.open_routes > 1:
        return "routes_open"
    return "unsure"


def _is_kept_away(values: Mapping[str, float]) -> bool:
    """Whether the safety filter changes the shared command by much."""
    safe = {name.removeprefix("safe_"): value for name, value in values.items() if name.startswith("safe_")}
    changed = math.hypot(*(values[f"shared_{name}"] - value for name, value in safe.items()))
    return changed > _KEPT_AWAY * math.hypot(*(values[f"shared_{name}"] for name in safe))
