"""Arbitration by hindsight optimisation over routes (Javdani et al. 2018)."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context

from drake_shared.arbitration.hindsight import Hindsight, HindsightModel
from drake_shared.arbitration.routes import Routes
from drake_shared.robots import Robot
from drake_shared.scenario import Scenario
from drake_shared.systems.route_arbiter import RouteArbiter


class HindsightOptimization(RouteArbiter):
    """Applies the command of least expected cost over the routes that the driver may intend.

    .. pydrake_system::

        name: HindsightOptimization
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        - pose
        output_ports:
        - shared_command
        - human_weight

    Inputs, outputs and parameters are those of :class:`~drake_shared.systems.arbiter.Arbiter`. The routes are
    those of the learner's demonstrations, and one for each further way of passing the known obstacles; see
    `drake_shared.arbitration.hindsight`, which names the source. The agent's own command and confidence play
    no part. The command is a convex combination of the driver's and of the pursuits of the routes, w being
    the driver's share.

    State:
        The probability of each route, the nearest point on it, and the poses within a reaction delay.

    Args:
        scenario: Start, goal and static obstacles.
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.
        horizon, rationality, slope, width, deviation: Fields of
            :class:`~drake_shared.arbitration.hindsight.HindsightModel`.

    Raises:
        InputError: The robot is not a differential drive, a field is out of range, or no way leads to the
            goal.
    """

    def __init__(
        self,
        *,
        scenario: Scenario,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
        horizon: float = HindsightModel.horizon,
        rationality: float = HindsightModel.rationality,
        slope: float = HindsightModel.slope,
        width: float = HindsightModel.width,
        deviation: float = HindsightModel.deviation,
    ) -> None:
        super().__init__(
            scenario=scenario, robot=robot, period=period, driver=driver, optional_inputs=("pose",)
        )
        self._model = HindsightModel(
            horizon=horizon, rationality=rationality, slope=slope, width=width, deviation=deviation
        )
        self.DeclareRule()

    @property
    def configuration(self) -> dict[str, Any]:
        """Costs and the model of a driver."""
        return dataclasses.asdict(self._model)

    def MakeRouteRule(self, routes: Routes) -> Hindsight:
        """The rule for ``routes``."""
        return Hindsight(
            self._model,
            routes,
            robot=self.drive,
            period=self.period,
            travel_time=self.scenario.travel_time,
        )

    def GetRouteProbability(self, context: Context) -> NDArray[np.float64]:
        """Probability (K,) of each route after this step's command."""
        probability: NDArray[np.float64] = self.state_after(context)["probability"][:, 0]
        return probability
