"""Likelihood of recorded human commands under the law of a simulated operator.

The law with first-order (Ornstein-Uhlenbeck) noise predicts each command from the poses before; see
:mod:`drake_shared.analysis.operator_drives`. The likelihood is evaluated on a grid of delays and yielding, at
each point of which skill and noise have closed forms.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.scenario import Scenario
from drake_shared.simulation.trial import Trial

Floats = NDArray[np.float64]

# Share of the largest command below which a command shows the intended one: noise is added after clipping.
_UNSATURATED = 0.9
# Bounds of the autocorrelation of the noise at one step.
_CORRELATIONS = (1e-6, 0.99)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Optimum:
    """The parameters of maximum likelihood.

    Attributes:
        cost: Twice the negative log-likelihood, up to a constant.
        delay, yielding, skill: As in :class:`drake_shared.operators.behaviour.Behaviour`.
        correlation: Autocorrelation of the noise at one step.
        innovation: Standard deviation of the noise's innovation at each step, in the robot's units.
    """

    cost: float
    delay: float
    yielding: float
    skill: float
    correlation: float
    innovation: float

    def behaviour(self, period: float) -> dict[str, float]:
        """The fitted parameters of a simulated operator, by name; ``period`` in [s]."""
        return {
            "skill": self.skill,
            "delay": self.delay,
            "noise": self.innovation / math.sqrt(1.0 - self.correlation**2),
            "noise_time": -period / math.log(self.correlation),
            "yielding": self.yielding,
        }


class DriveLikelihood:
    """The commands of one trial and the commands of a law at the same poses; a base class.

    A subclass implements `law_commands`.

    Args:
        trial: The log.
        scenario: Its scenario.
        name: Of the trial, for errors.
        effort: Of each command, the reaction to pose k, as a share of the largest: shape (n,).

    Attributes:
        commands: Shape (n, M), in the robot's units; row k is the reaction to pose k.
        informative: Whether row k counts, with a command below the limit: shape (n,).
        least_weight: Minimum of the human weight.

    Raises:
        InputError: The rows are not one period apart, or fewer than ten steps in a row are informative.
    """

    has_skill = True
    """Whether the law corrects errors by a skill."""
    axes: int
    """Number of elements of a command that vary."""

    def __init__(self, trial: Trial, scenario: Scenario, name: str, effort: Floats) -> None:
        period = scenario.control_period
        if not np.allclose(np.diff(trial["t"]), period, atol=1e-6):
            raise InputError(name, "t", f"must have a row each {period} s")
        self.commands = trial.commands("human")[1:]
        self.axes = self.commands.shape[1]
        self._weight = trial["human_weight"][:-1]
        self.least_weight = float(self._weight.min())
        self._effort = effort
        self._hands_on = (self.commands != 0.0).any(axis=1)
        self.select_informative(0.0)
        if self._pairs.sum() < 10:
            raise InputError(name, "", "must hold human commands in at least ten steps in a row")

    def select_informative(self, yielding: float) -> None:
        """Selects the informative rows for an operator with this yielding."""
        intended = self._effort / (1.0 - yielding * (1.0 - self._weight))
        self.informative = self._hands_on & (intended < _UNSATURATED)
        self._pairs = self.informative[1:] & self.informative[:-1]

    @property
    def largest_correction(self) -> float:
        """Largest element of a command, for the errors seen at the shortest delay, in the robot's units."""
        return float(np.abs(self.law_commands(0.0, 1.0)[1][self.informative]).max())

    def law_commands(self, delay: float, speed_factor: float) -> tuple[Floats, Floats]:
        """Commands (n, M) of the law at skill 0, and their increase per unit of skill, in the robot's
        units."""
        raise NotImplementedError

    def sums(self, delays: Floats, yielding: Floats, speed_factor: float) -> Floats:
        """Sufficient statistics of the likelihood: shape (delays, yielding, 11), additive over trials.

        With u the residual at skill 0 and f its decrease per unit of skill, these are, over pairs of steps:
        the sums of u u, u f and f f of the later step, of the earlier step, and of the products of both; then
        the sum of log(1 - yielding (1 - w)) and the number of commands.
        """
        kept = 1.0 - yielding[:, None] * (1.0 - self._weight)
        intended = self.commands[None] / kept[..., None]
        jacobian = self.axes * np.log(kept[:, 1:][:, self._pairs]).sum(axis=1)
        count = np.full(len(yielding), float(self.axes) * self._pairs.sum())
        table = []
        for delay in delays:
            base, per_skill = self.law_commands(float(delay), speed_factor)
            u = intended - base
            now, before = u[:, 1:][:, self._pairs], u[:, :-1][:, self._pairs]
            f, f_before = per_skill[1:][self._pairs], per_skill[:-1][self._pairs]
            ff, ff_before, ff_both = ((a * b).sum() for a, b in ((f, f), (f_before, f_before), (f, f_before)))
            each = np.ones(len(yielding))
            table.append(
                np.stack(
                    [
                        *((now * now).sum((1, 2)), (now * f).sum((1, 2)), ff * each),
                        *((before * before).sum((1, 2)), (before * f_before).sum((1, 2)), ff_before * each),
                        (now * before).sum((1, 2)),
                        (now * f_before).sum((1, 2)) + (before * f).sum((1, 2)),
                        *(ff_both * each, jacobian, count),
                    ],
                    axis=-1,
                )
            )
        return np.stack(table)

    def squared_errors(self, best: Optimum, speed_factor: float) -> tuple[float, float, int]:
        """Sums of squared errors of the law and of its one-step prediction, and the number of steps."""
        base, per_skill = self.law_commands(best.delay, speed_factor)
        kept = (1.0 - best.yielding * (1.0 - self._weight))[:, None]
        error = self.commands - kept * (base + best.skill * per_skill)
        noise = error / kept
        ahead = error.copy()
        ahead[1:][self._pairs] -= (kept[1:] * best.correlation * noise[:-1])[self._pairs]
        rows = self.informative
        return float((error[rows] ** 2).sum()), float((ahead[rows] ** 2).sum()), int(rows.sum())


def maximize_likelihood(sums: Floats, delays: Floats, yielding: Floats, *, has_skill: bool = True) -> Optimum:
    """The maximum over a grid of delays and yielding, interpolated between its points.

    Args:
        sums: As `DriveLikelihood.sums` returns them, added over trials.
        delays: Of the grid, in [s].
        yielding: Of the grid.
        has_skill: False leaves the skill at 0.

    Returns:
        The parameters; NaN where the sums do not determine them.
    """
    uu, uf, ff, uu_before, uf_before, ff_before, uu_both, uf_both, ff_both, jacobian, count = np.moveaxis(
        sums, -1, 0
    )
    correlation, skill = np.full(uu.shape, 0.5), np.zeros(uu.shape)
    # Alternating maximisation: each parameter has a closed form given the other.
    with np.errstate(invalid="ignore", divide="ignore"):
        for _ in range(12):
            if has_skill:
                skill = (uf - correlation * uf_both + correlation**2 * uf_before) / (
                    ff - 2.0 * correlation * ff_both + correlation**2 * ff_before
                )
            now = uu - 2.0 * skill * uf + skill**2 * ff
            before = uu_before - 2.0 * skill * uf_before + skill**2 * ff_before
            both = uu_both - skill * uf_both + skill**2 * ff_both
            correlation = np.clip(both / before, *_CORRELATIONS)
    squares = np.maximum(now - 2.0 * correlation * both + correlation**2 * before, 1e-12)
    cost = count * np.log(squares / count) + 2.0 * jacobian
    row, column = np.unravel_index(cost.argmin(), cost.shape)

    def value(table: Floats) -> float:
        return float(table[row, column])

    return Optimum(
        cost=value(cost),
        delay=_interpolate_minimum(delays, cost[:, column], int(row)),
        yielding=_interpolate_minimum(yielding, cost[row], int(column)),
        skill=value(skill),
        correlation=value(correlation),
        innovation=math.sqrt(value(squares) / value(count)),
    )


def _interpolate_minimum(grid: Floats, values: Floats, index: int) -> float:
    """The minimum of the parabola through the lowest point of an even grid and its neighbours."""
    if not 0 < index < len(grid) - 1:
        return float(grid[index])
    before, at, after = values[index - 1 : index + 2].tolist()
    curvature = before - 2.0 * at + after
    shift = 0.5 * (before - after) / curvature if curvature > 0 else 0.0
    return float(grid[index] + shift * (grid[1] - grid[0]))
