"""The blend of two commands and its weight: eq. (2) of Amirshirzad et al. 2022."""

from __future__ import annotations

import math
from collections.abc import Sequence


def confidence_weight(confidence: float) -> float:
    """The human's weight w = 1 - c_f; 1 where the confidence is NaN."""
    return 1.0 if math.isnan(confidence) else 1.0 - min(max(confidence, 0.0), 1.0)


def finite_weight(weight: float, autonomous: Sequence[float]) -> float:
    """``weight``, or 1 where it or the agent's command (M,) is NaN or infinite."""
    # The sum with NaN or infinity is not finite either.
    return weight if math.isfinite(weight + sum(autonomous)) else 1.0


def finite_command(command: Sequence[float]) -> Sequence[float]:
    """``command`` (M,), or zeros where it has a NaN or infinite element."""
    return command if math.isfinite(sum(command)) else [0.0] * len(command)


def blend(weight: float, human: Sequence[float], autonomous: Sequence[float]) -> Sequence[float]:
    """The command w human + (1 - w) autonomous, eq. (2).

    Args:
        weight: w, from 0 to 1.
        human: Shape (M,); counts as zero where it is not finite.
        autonomous: Shape (M,); does not matter where w is 1.
    """
    human = finite_command(human)
    if weight >= 1.0:
        return human
    rest = 1.0 - weight
    return [weight * own + rest * other for own, other in zip(human, autonomous, strict=True)]
