"""Hindsight optimisation over routes: the command of least expected cost, whatever the driver may intend.

Source: Javdani, Admoni, Pellegrinelli, Srinivasa and Bagnell, "Shared autonomy via hindsight optimization for
teleoperation and teaming", IJRR 37(7), 2018; goals are routes here. A driver is taken to be noisily rational
(maximum entropy): a command that costs more on a route makes that route less probable. The applied command
has the least cost in the mean over that posterior (QMDP, Littman et al. 1995), plus a cost of differing from
the driver's.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.route_pursuit import RoutePursuit
from drake_shared.arbitration.routes import Routes
from drake_shared.arbitration.rule import ArbiterInputs, State
from drake_shared.common.elementwise import ARRAYS
from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive, scaled_length

Floats = NDArray[np.float64]

# Human shares of the blends that are considered.
_SHARES = np.linspace(0.0, 0.9, 10)
_STILL = 1e-6
_DECIMALS = 9


@dataclasses.dataclass(frozen=True, kw_only=True)
class HindsightModel:
    """Costs of a route, and the model of a driver. Lengths are those for the Pioneer P3-DX.

    Raises:
        InputError: A value is out of range.
    """

    horizon: float = 0.6
    """A command is judged by where it leads in this time, in s."""
    delay: float = 0.2
    """Reaction delay of the driver, in s."""
    rationality: float = 3.0
    """Weight of a command's cost in the logarithm of its probability, in 1/m."""
    slope: float = 1.5
    """Cost per distance from a route, relative to that per length that is left of it."""
    width: float = 0.1
    """Distance from a route within which the cost is quadratic, in m."""
    deviation: float = 6.0
    """Cost per squared distance between where the driver's command leads and where the applied one does, in
    1/m."""
    most_probable: float = 0.99
    """Largest probability of a route, so that a driver can change it."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            most = 1.0 if field.name == "most_probable" else math.inf
            may_be_zero = field.name in ("delay", "deviation")
            if not (0.0 < value < most or (may_be_zero and value == 0.0)):
                expected = "must be from 0 to 1" if most == 1.0 else "must be positive and finite"
                raise InputError("hindsight", field.name, expected, value)


def route_value(left: Floats, distance: Floats, *, slope: float, width: float) -> Floats:
    """Cost to go from a distance beside a route, in [m].

    It is that of the published policy for one goal, with the length that is left for the distance to a goal:
    the rate of the cost per distance from the route grows linearly up to ``slope`` at ``width``, and is
    constant beyond.

    Args:
        left: Length of the route that is left, in [m].
        distance: From the route, in [m].
        slope, width: See `HindsightModel`.
    """
    far = distance - 0.5 * width
    return np.asarray(left + slope * np.where(distance <= width, distance**2 / (2.0 * width), far))


def updated_posterior(probability: Floats, advantage: Floats, *, rationality: float, most: float) -> Floats:
    """Probability (K, n) of each goal after one more command: p exp(beta (V - Q)), normalised.

    Args:
        probability: Before it, shape (K, n).
        advantage: V - Q of the command for each goal, shape (K, n).
        rationality: beta.
        most: Largest probability; what is above it is divided among the other goals.
    """
    log = rationality * advantage
    odds = probability * np.exp(log - log.max(axis=0))
    odds /= odds.sum(axis=0)
    if len(odds) > 1:
        above = np.maximum(odds - most, 0.0)
        odds = odds + above.sum(axis=0) / (len(odds) - 1) * (above == 0.0) - above
    return np.asarray(odds)


def least_expected(probability: Floats, values: Floats, penalty: Floats) -> NDArray[np.int64]:
    """Index (n,) of the action with the least expected cost, the first one of those that are equal.

    In worlds with a symmetry costs are equal but for rounding, which must not decide.

    Args:
        probability: Of each goal, shape (K, n).
        values: Q of each action for each goal, shape (A, K, n).
        penalty: Further cost of each action, shape (A, n).
    """
    expected = (values * probability).sum(axis=1) + penalty
    return np.asarray(np.round(expected, _DECIMALS).argmin(axis=0))


class Hindsight:
    """The rule of hindsight optimisation: an `ArbitrationRule`.

    The commands that are considered are the driver's, and blends of it with the pursuit of each route and
    with the mean of these pursuits over the posterior. So the applied one is a convex combination of them.

    Args:
        model: Costs, and the driver.
        routes: K routes.
        robot: Steers, and tells where commands lead.
        period: Of the control step, in [s].
        travel_time: Time in which a driver takes a route from start to goal, in [s].
    """

    def __init__(
        self,
        model: HindsightModel,
        routes: Routes,
        *,
        robot: DiffDrive,
        period: float,
        travel_time: float,
    ) -> None:
        self._model = model
        self._robot = robot
        self._pursuit = RoutePursuit(routes, robot=robot, look_ahead=model.horizon, travel_time=travel_time)
        # Lengths of the model are for the Pioneer P3-DX; a length in the world is this many times as large.
        self._scale = scaled_length(robot, 1.0)
        self._memory = round(model.delay / period) + 1
        self._prior = np.full(self._pursuit.count, 1.0 / self._pursuit.count)
        # The human share of each candidate.
        self._shares = np.append(1.0, np.repeat(_SHARES, self._pursuit.count + 1))

    def initial_state(self, count: int) -> State:
        """See `ArbitrationRule`."""
        routes = self._pursuit.count
        return {
            "index": self._pursuit.initial(count),
            "probability": np.repeat(self._prior[:, None], count, axis=1),
            # Of the steps within the reaction delay: poses, points reached, and turns along the routes.
            "poses": np.full((self._memory, 3, count), math.nan),
            "indices": np.zeros((self._memory, routes, count), dtype=np.int64),
            "turns": np.zeros((self._memory, routes, count)),
        }

    def step(self, state: State, inputs: ArbiterInputs) -> tuple[Floats, Floats, State]:
        """See `ArbitrationRule`; pose and the drivers' commands are used."""
        pose, human = inputs.pose, inputs.human
        index, _, _ = self._pursuit.project(pose[0] + 1j * pose[1], state["index"])
        own = self._pursuit.commands(index, pose)
        before = state["probability"]
        after = {
            "index": index,
            "poses": np.concatenate([state["poses"][1:], pose[None]]),
            "indices": np.concatenate([state["indices"][1:], index[None]]),
            "turns": np.concatenate([state["turns"][1:], 0.5 * (own[1] - own[0])[None]]),
        }
        candidates = self._candidates(human, own, before)
        count = candidates.shape[1]
        ends, observed, near = self._ends(pose, candidates), *self._observed(after, human)
        values = self._values(
            np.concatenate([np.repeat(ends[:, None], len(own[0]), axis=1), observed]),
            np.concatenate([np.repeat(index[None], count, axis=0), near]),
        )
        probability = self._updated(before, values[count] - values[count + 1], human)
        penalty = self._model.deviation * (np.abs(ends - ends[0]) / self._scale) ** 2
        chosen = least_expected(probability, values[:count], penalty)
        command = np.take_along_axis(candidates, chosen[None, None], axis=1)[:, 0]
        return self._shares[chosen], command, {**after, "probability": probability}

    def _candidates(self, human: Floats, own: Floats, probability: Floats) -> Floats:
        """The commands (2, A, n) that are considered, the driver's first, then blends with the agent's."""
        mean = (own * probability).sum(axis=1)
        toward = np.concatenate([own, mean[:, None]], axis=1)
        blends = (
            _SHARES[:, None, None] * human[:, None, None] + (1.0 - _SHARES[:, None, None]) * toward[:, None]
        )
        return np.concatenate([human[:, None], blends.reshape(2, -1, human.shape[1])], axis=1)

    def _observed(self, state: State, human: Floats) -> tuple[NDArray[np.complex128], NDArray[np.int64]]:
        """Where the best command of each route and the driver's own led a reaction delay ago.

        Returns:
            Positions (2, K, n), and points of the routes near them (2, K, n).
        """
        then = np.isfinite(state["poses"][:, 0]).argmax(axis=0)
        drivers = np.arange(human.shape[1])
        pose = state["poses"][then, :, drivers].T
        index, turn = (state[name][then, :, drivers].T for name in ("indices", "turns"))
        # The driver's pace is not evidence: of the routes' commands the turns count, at the driver's speed.
        middle = 0.5 * (human[0] + human[1])
        commands = np.stack([middle - turn, middle + turn])
        ends = self._ends(pose, np.concatenate([commands, human[:, None]], axis=1))
        count = len(turn)
        return np.stack([ends[:count], np.repeat(ends[count:], count, axis=0)]), np.stack([index, index])

    def _updated(self, probability: Floats, advantage: Floats, human: Floats) -> Floats:
        """The posterior after the drivers' commands."""
        advantage = np.minimum(advantage, 0.0)
        moves = np.isfinite(advantage.sum(axis=0)) & (np.abs(human).max(axis=0) > _STILL)
        return updated_posterior(
            probability,
            np.where(moves, advantage, 0.0),
            rationality=self._model.rationality,
            most=self._model.most_probable,
        )

    def _ends(self, pose: Floats, commands: Floats) -> NDArray[np.complex128]:
        """Where commands (2, ..., n) lead within the horizon: shape (..., n)."""
        x, y = self._robot.rollout(pose, commands, self._model.horizon, ARRAYS)
        return np.asarray(x + 1j * y)

    def _values(self, ends: NDArray[np.complex128], index: NDArray[np.int64]) -> Floats:
        """Cost to go (..., K, n) from positions near the points ``index``, both (..., K, n)."""
        _, left, distance = self._pursuit.project(ends, index)
        left, distance = left / self._scale, distance / self._scale
        return route_value(left, distance, slope=self._model.slope, width=self._model.width)
