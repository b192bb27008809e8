"""Arbitration by the posterior of the driver's route and noise."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context

from drake_shared.arbitration.fusion import STILL, Fusion
from drake_shared.arbitration.fusion_model import FusionModel
from drake_shared.arbitration.routes import Routes
from drake_shared.common.errors import InputError
from drake_shared.robots import Robot
from drake_shared.scenario import Scenario
from drake_shared.systems.route_arbiter import RouteArbiter


class PosteriorFusion(RouteArbiter):
    """Infers the driver's route and noise from the commands, and fuses them with the command of each route.

    .. pydrake_system::

        name: PosteriorFusion
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        - pose
        - clearance
        output_ports:
        - shared_command
        - human_weight
        - driver_noise
        - another_driver

    Inputs, outputs and parameters are those of :class:`~drake_shared.systems.arbiter.Arbiter`. The routes are
    those of the learner's demonstrations, and one for each further way of passing the known obstacles; see
    `drake_shared.arbitration.fusion`. The agent's own command and confidence play no part.

    Further outputs, which are columns of the log:
        driver_noise (1): Mean of the noise on each wheel's command, in [rad/s]; see :meth:`GetNoise`.
        another_driver (1): 1 while somebody else than the person of ``noise_prior`` is found to drive, by
            `drake_shared.arbitration.driver_change`, and the estimate starts from the prior of anybody.

    State:
        The joint probability of route, noise and its time constant, and what the next update compares with.

    Args:
        scenario: Start, goal and static obstacles.
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.
        model: Of a driver, see :class:`~drake_shared.arbitration.fusion_model.FusionModel`.
        noise_prior: Its field of that name, as numbers with spaces between them.

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
        model: FusionModel | None = None,
        noise_prior: str = "",
    ) -> None:
        super().__init__(
            scenario=scenario,
            robot=robot,
            period=period,
            driver=driver,
            optional_inputs=("pose", "clearance"),
            logged=("driver_noise", "another_driver"),
        )
        self._model = model or FusionModel()
        if noise_prior:
            self._model = dataclasses.replace(self._model, noise_prior=_numbers(noise_prior))
        self.DeclareRule()

    @property
    def configuration(self) -> dict[str, Any]:
        """The model of a driver."""
        return dataclasses.asdict(self._model)

    def MakeRouteRule(self, routes: Routes) -> Fusion:
        """The fusion with ``routes``."""
        return Fusion(self._model, routes, scenario=self.scenario, robot=self.drive, period=self.period)

    def release_reason(self, context: Context) -> str | None:
        """ "hands_off" while there is no command: the robot stands still."""
        command = self.GetInputPort("human_command").Eval(context)
        return None if np.abs(command).max() > STILL else "hands_off"

    def GetRouteProbability(self, context: Context) -> NDArray[np.float64]:
        """Probability (K + J + 1,) after this step's command of each route, each goal and none of them."""
        return self._fusion(context).route_probability(self.state_after(context))[:, 0]

    def GetNoise(self, context: Context) -> NDArray[np.float64]:
        """Mean and standard deviation (2,), in [rad/s], of the noise on the driver's wheel commands."""
        return self._fusion(context).noise(self.state_after(context))[:, 0]

    def GetNoiseTime(self, context: Context) -> NDArray[np.float64]:
        """Mean and standard deviation (2,), in [s], of the time constant of that noise."""
        return self._fusion(context).noise_time(self.state_after(context))[:, 0]

    def _fusion(self, context: Context) -> Fusion:
        fusion = self.rule(context)
        assert isinstance(fusion, Fusion)
        return fusion


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split())
    except ValueError as error:
        raise InputError("fusion", "noise_prior", "must be numbers with spaces between them", text) from error
