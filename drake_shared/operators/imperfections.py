"""What makes the command of a simulated operator differ from the steering law, as arithmetic.

The arguments are numbers, or arrays of them with ``xp`` as `drake_shared.common.elementwise.ARRAYS`;
``behaviour`` has the fields of `drake_shared.operators.behaviour.Behaviour`.
"""

from __future__ import annotations

from typing import Any

from drake_shared.common.elementwise import FLOATS, Elementwise, Real, Reals

Command = Reals
"""Wheel speeds (left, right), in [rad/s]."""


def coloured_noise(
    behaviour: Any, noise: Command, meant: Command, normal: Command, keep: Real, xp: Elementwise = FLOATS
) -> list[Real]:
    """The noise (left, right) of the next step, in [rad/s]: of first order, and stronger in strong commands.

    Args:
        behaviour: Standard deviations of the noise.
        noise: Of this step.
        meant: Command of the steering law.
        normal: Samples of a standard normal distribution.
        keep: Correlation of one step with the next, exp(-period / noise_time).
    """
    kick = (1.0 - keep * keep) ** 0.5
    return [
        keep * old + xp.hypot(behaviour.noise, behaviour.signal_noise * own) * kick * new
        for old, own, new in zip(noise, meant, normal, strict=True)
    ]


def within_limits(command: Command, fastest: float, xp: Elementwise = FLOATS) -> list[Real]:
    """``command``, each wheel within ``fastest``, in [rad/s]."""
    return [xp.minimum(xp.maximum(wheel, -fastest), fastest) for wheel in command]


def slipped(
    behaviour: Any,
    meant: Command,
    last: Command,
    chance: Reals,
    fastest: float,
    xp: Elementwise = FLOATS,
) -> list[Real]:
    """``meant``, or by chance a random command or the one of the last step.

    Args:
        chance: Four samples of a uniform distribution over [0, 1).
        fastest: Largest wheel speed, in [rad/s].
    """
    lags, random, *drawn = chance
    at_random = [fastest * (2.0 * sample - 1.0) for sample in drawn]
    return [
        xp.where(lags < behaviour.lag, old, xp.where(random < behaviour.random_share, other, own))
        for own, old, other in zip(meant, last, at_random, strict=True)
    ]


def answered(
    behaviour: Any,
    intended: Command,
    last: Command,
    shared: Command,
    weight: Real,
    fastest: float,
    xp: Elementwise = FLOATS,
) -> list[Real]:
    """``intended``, changed by the operator's answer to assistance.

    Args:
        last: Intended command of the last step.
        shared: What the arbiter made of it.
        weight: w of the last step.
        fastest: Largest wheel speed, in [rad/s].
    """
    held = 1.0 - behaviour.yielding * (1.0 - weight)
    command = [
        held * (own + behaviour.stubbornness * (old - made))
        for own, old, made in zip(intended, last, shared, strict=True)
    ]
    return within_limits(command, fastest, xp)
