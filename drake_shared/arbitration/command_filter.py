"""Splits a command into what the driver means and noise: Kalman filters for many hypotheses at once."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Steps in which the gains become those of the steady state: far more than any time constant.
_STEPS = 600


class CommandFilters:
    """Filters of the difference between a driver's command and the one that a hypothesis expects.

    The difference is the sum of what the driver means, a smooth process (Matern 3/2: its rate of change is
    continuous), and noise of first order. Each filter is the Kalman filter of that sum in the steady state;
    see Saerkkae and Solin, Applied Stochastic Differential Equations, 2019. Its state is what is meant, the
    rate of change of that, and the noise. Axes of arrays: H kinds of what is meant, G of noise, n drivers.

    Args:
        meant: Standard deviation and rate, in [1/s], of the smooth process of each of H kinds: its values
            t apart have the correlation (1 + rate t) exp(-rate t).
        noises: Shape (G,), standard deviations of the noise.
        times: Shape (G,), time constants of the noise, in [s].
        period: In [s].
        tail: Degrees of freedom of Student's t distribution that scores innovations: sudden differences,
            such as a jerk, are more frequent than by the normal one. Infinite: normal.

    Attributes:
        share: Shape (H, G), share of a lasting difference that is found to be meant.
        innovation: Shape (H, G), variance of the difference that the filter does not foresee.
    """

    def __init__(
        self,
        meant: Sequence[tuple[float, float]],
        noises: Floats,
        times: Floats,
        *,
        period: float,
        tail: float = math.inf,
    ) -> None:
        kinds = list(dict.fromkeys(meant))
        which = [kinds.index(kind) for kind in meant]
        deviation, rate = (np.array(part)[:, None] for part in zip(*kinds, strict=True))
        self._tail = tail
        decay = np.exp(-rate * period)
        move = np.zeros((len(kinds), len(noises), 3, 3))
        move[..., 0, 0], move[..., 0, 1] = decay * (1.0 + rate * period), decay * period
        move[..., 1, 0], move[..., 1, 1] = -decay * rate**2 * period, decay * (1.0 - rate * period)
        move[..., 2, 2] = np.exp(-period / times)
        spread = np.zeros_like(move)
        spread[..., 0, 0], spread[..., 1, 1] = deviation**2, (deviation * rate) ** 2
        spread[..., 2, 2] = noises**2
        kick = spread - move @ spread @ move.swapaxes(-1, -2)
        seen = spread[..., 0] + spread[..., 2]
        variance = seen[..., 0] + seen[..., 2]
        first, self._variance = seen / variance[..., None], variance[which]
        for _ in range(_STEPS):
            gain = seen / variance[..., None]
            left = spread - gain[..., None] * seen[..., None, :]
            spread = move @ left @ move.swapaxes(-1, -2) + kick
            seen = spread[..., 0] + spread[..., 2]
            variance = seen[..., 0] + seen[..., 2]
        self.innovation = variance[which]
        self._log_innovation, self._log_variance = (
            np.log(part)[..., None] for part in (self.innovation, self._variance)
        )
        # The state x = (1 - g h) F x + g d for a lasting difference d = 1.
        kept = move - gain[..., None] * (move[..., 0, :] + move[..., 2, :])[..., None, :]
        self.share = np.linalg.solve(np.eye(3) - kept, gain[..., None])[which, :, 0, 0]
        self._move = move.transpose(2, 3, 0, 1)[:, :, which, :, None]
        self._gain, self._first = (part.transpose(2, 0, 1)[:, which, :, None] for part in (gain, first))

    def initial_state(self, count: int) -> Floats:
        """Shape (3, H, G, n): nothing is known, NaN."""
        return np.full((3, *self.share.shape, count), math.nan)

    def step(
        self, state: Floats, difference: Floats, gives: NDArray[np.bool_]
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """What follows from one more command.

        Args:
            state: Shape (3, H, G, n); it is left as it is.
            difference: Shape (H, n).
            gives: Shape (n,), whether each driver gives a command. The state of one who does not is reset.

        Returns:
            The state (3, H, G, n) of drivers who continue, and the logarithm (H, G, n) of their likelihood;
            the same of drivers whose difference began in this step. Up to a constant.
        """
        seen, move = difference[:, None], self._move
        before = np.empty_like(state)
        before[0] = move[0, 0] * state[0] + move[0, 1] * state[1]
        before[1] = move[1, 0] * state[0] + move[1, 1] * state[1]
        before[2] = move[2, 2] * state[2]
        innovation = seen - before[0] - before[2]
        fresh = self._first * seen
        fresh_log = -0.5 * (np.square(seen) / self._variance[..., None] + self._log_variance)
        # The first command of a drive says nothing: drivers start from rest.
        known = np.isfinite(innovation[:1, :1])
        scored = known & gives
        log, fresh_log = np.where(scored, self._log(innovation), 0.0), np.where(scored, fresh_log, 0.0)
        after = np.where(known, before + self._gain * innovation, fresh)
        return np.where(gives, after, math.nan), log, fresh, fresh_log

    def _log(self, innovation: Floats) -> Floats:
        variance = self.innovation[..., None]
        square = np.square(innovation) / variance
        if math.isfinite(self._tail):
            square = (self._tail + 1.0) * np.log1p(square / self._tail)
        return np.asarray(-0.5 * (square + self._log_innovation))
