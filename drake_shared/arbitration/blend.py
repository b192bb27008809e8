"""The blend of two commands and its weight: eq. (2) of Amirshirzad et al. 2022."""

from __future__ import annotations

from collections.abc import Sequence

from drake_shared.common.elementwise import FLOATS, Elementwise, Real, Reals

DRIVERS = ("shared", "human", "agent")
"""Shared control, the human alone, or the agent alone."""


def confidence_weight(confidence: Real, xp: Elementwise = FLOATS) -> Real:
    """The human's weight w = 1 - c_f; 1 where the confidence is NaN."""
    known = confidence == confidence
    return xp.where(known, 1.0 - xp.minimum(xp.maximum(confidence, 0.0), 1.0), 1.0)


def finite_weight(weight: Real, autonomous: Reals, xp: Elementwise = FLOATS) -> Real:
    """``weight``, or 1 where it or the agent's command (M,) is NaN or infinite."""
    # The sum with NaN or infinity is not finite either.
    return xp.where(xp.isfinite(weight + sum(autonomous)), weight, 1.0)


def finite_command(command: Reals, xp: Elementwise = FLOATS) -> Reals:
    """``command`` (M,), or zeros where it has a NaN or infinite element."""
    finite = xp.isfinite(sum(command))
    if xp.all(finite):
        return command
    return [xp.where(finite, element, 0.0) for element in command]


def blend(weight: Real, human: Reals, autonomous: Reals, xp: Elementwise = FLOATS) -> Sequence[Real]:
    """The command w human + (1 - w) autonomous, eq. (2).

    Args:
        weight: w, from 0 to 1.
        human: Shape (M,); counts as zero where it is not finite.
        autonomous: Shape (M,); does not matter where w is 1.
    """
    human, alone, rest = finite_command(human, xp), weight >= 1.0, 1.0 - weight
    if xp.all(alone):
        return list(human)
    blended = [weight * own + rest * other for own, other in zip(human, autonomous, strict=True)]
    if xp.any(alone):
        return [xp.where(alone, own, both) for own, both in zip(human, blended, strict=True)]
    return blended
