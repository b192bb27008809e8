"""Arbitration by the rule of Robot-Trajectron V2 (arXiv 2509.19954) over the learner's modes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, ValueProducer

from drake_shared.arbitration.rt_v2 import COMMAND_VARIANCE, corrected_modes, obstacle_cost
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner, MultimodalLearner
from drake_shared.robots import DiffDrive, Robot, scaled_length
from drake_shared.scenario import Scenario
from drake_shared.scenario.planar_distance import PlanarDistance
from drake_shared.systems.arbiter import Arbiter
from drake_shared.systems.discrete_update import check_positive
from drake_shared.systems.intention import Intention

# Distance beyond the body at which an obstacle begins to cost, in [m] for the Pioneer P3-DX. The published
# cost is of a world ten times as large: from further away it would outweigh what the driver wants.
_NEAR = 0.05


class RobotTrajectron(Arbiter):
    """Corrects each predicted mode by the driver's command, and drives along the best one.

    .. pydrake_system::

        name: RobotTrajectron
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        - pose
        - intention
        output_ports:
        - shared_command
        - human_weight

    Inputs, outputs and parameters are those of :class:`~drake_shared.systems.arbiter.Arbiter`. The learner
    must predict modes, as "mixture" does. The velocity of a mode is that to its position a look-ahead from
    now. See `drake_shared.arbitration.rt_v2`, which names the source. The best mode has the least cost: minus
    the logarithm of its probability, and the cost of obstacles where it leads. The published code refines the
    velocity of each mode by sampling (MPPI) under the same costs; here it is the corrected mean.

    The velocity is a convex combination of the driver's and the mode's, element by element; w is the mean of
    the driver's shares. The command is that toward where this velocity leads, and so no convex combination
    of commands.

    Args:
        scenario: Its static obstacles are known.
        look_ahead: In [s].
        command_variance: Of the noise of the driver's velocity, in [m^2/s^2] for the Pioneer P3-DX; it scales
            with the size of the robot.
        least_variance: Of the velocity of a mode, in the same unit. A narrow mode would be as unlikely as all
            others, whatever the driver does.
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.

    Raises:
        InputError: The robot is not a differential drive, or a number is not positive and finite.
    """

    def __init__(
        self,
        *,
        scenario: Scenario,
        look_ahead: float = 0.6,
        command_variance: float = COMMAND_VARIANCE,
        least_variance: float = 0.03,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
    ) -> None:
        super().__init__(robot=robot, period=period, driver=driver, optional_inputs=("pose", "intention"))
        check_positive(
            self,
            look_ahead=look_ahead,
            command_variance=command_variance,
            least_variance=least_variance,
        )
        if not isinstance(self.robot, DiffDrive):
            raise InputError("RobotTrajectron", "robot", "must be a differential drive")
        self._look_ahead, self._command_variance = float(look_ahead), float(command_variance)
        self._least_variance = float(least_variance)
        # Costs and variances are for the Pioneer P3-DX; a length in the world is this many times as large.
        self._scale = scaled_length(self.robot, 1.0)
        self._contact = self.robot.footprint_radius / self._scale
        self._distance = PlanarDistance(scenario.static_obstacles)
        self._step_cache = self.DeclareCacheEntry(
            "step", ValueProducer(lambda: Value(_HUMAN), self._calc_step), {self.all_input_ports_ticket()}
        )

    @property
    def configuration(self) -> dict[str, Any]:
        """Look-ahead and variances."""
        return {
            "look_ahead": self._look_ahead,
            "command_variance": self._command_variance,
            "least_variance": self._least_variance,
        }

    def SetLearner(self, context: Context, learner: Learner) -> None:
        """Checks the learner of a trial.

        Raises:
            InputError: It predicts no modes.
        """
        if not isinstance(learner, MultimodalLearner):
            expected = (
                "must predict modes for arbitration 'rt-v2'; train --learner mixture makes one that does"
            )
            raise InputError("arbitration", "learner", expected, repr(learner.name))

    def DoCalcWeight(self, context: Context) -> float:
        """The mean of the driver's shares in the velocity; 1 where there are no modes."""
        return self._step(context).weight

    def DoCalcCommand(
        self, context: Context, weight: float, human: Sequence[float], autonomous: Sequence[float]
    ) -> Sequence[float]:
        """The command toward where the corrected velocity of the best mode leads."""
        step = self._step(context)
        return super().DoCalcCommand(context, weight, human, autonomous) if weight == 1.0 else step.command

    def _step(self, context: Context) -> _Step:
        step: _Step = self._step_cache.Eval(context)
        return step

    def _calc_step(self, context: Context, output: Value) -> None:
        intention: Intention = self.GetInputPort("intention").Eval(context)
        pose = self.GetInputPort("pose").Eval(context).tolist()
        human = self._human_port.Eval(context).tolist()
        modes = intention.modes
        if modes is None or not math.isfinite(sum(pose) + sum(human)):
            output.set_value(_HUMAN)
            return
        ahead = int(intention.times.searchsorted(intention.time + self._look_ahead))
        ahead = min(ahead, len(intention.times) - 1)
        known = np.flatnonzero(np.isfinite(modes.mean[:, 0, 0]))
        if not len(known):
            output.set_value(_HUMAN)
            return
        time = max(float(intention.times[ahead]) - intention.time, 1e-3)
        scale = self._scale
        here = np.array(self.robot.position(pose)) / scale
        led = np.array(self.robot.rollout(pose, human, time)) / scale
        entry = ahead - intention.first
        probability, velocity, gain = corrected_modes(
            modes.probability[known, None],
            ((modes.mean[known, entry] / scale - here) / time)[..., None],
            np.maximum(modes.variance[known, entry] / (time * scale) ** 2, self._least_variance)[..., None],
            ((led - here) / time)[:, None],
            command_variance=self._command_variance,
        )
        targets = scale * (here + velocity[..., 0] * time)
        cost = -np.log(probability[:, 0])
        distance = self._distance.least(targets[:, 0], targets[:, 1]) / scale
        cost += obstacle_cost(distance, contact=self._contact, near=self._contact + _NEAR)
        best = int(cost.argmin())
        command = self.robot.command_toward(pose, targets[best].tolist(), time)
        output.set_value(_Step(float(gain[best].mean()), command))


class _Step(NamedTuple):
    weight: float
    command: Sequence[float]


_HUMAN = _Step(1.0, ())
