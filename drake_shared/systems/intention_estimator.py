"""Conditions a learner on the robot's position at every step, and computes the confidence."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort, LeafSystem, OutputPort

from drake_shared.arbitration.path_repair import PathRepair
from drake_shared.common.errors import InputError, RunError
from drake_shared.learners import Learner, Modes
from drake_shared.robots import DiffDrive, Robot, check_robot, scaled_length
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate, check_positive
from drake_shared.systems.intention import Intention, empty_intention
from drake_shared.systems.prepared_learner import MOMENTS, PreparedLearner

LEAST_DISTANCE = 0.05
"""A command that leads less far than this, in [m] for the Pioneer P3-DX, is not an observation."""
REACH = 0.8
"""Time ahead at which a command is an observation, in [s]."""


@dataclasses.dataclass(kw_only=True, eq=False)
class _Estimate(Intention):
    """An intention with the values of the other outputs and of the state.

    A cache entry of its own would cost one more call from C++ to Python and back in every step.
    """

    confidence: float
    mean_variance: float
    expected: NDArray[np.float64]
    by_command: float


def _unknown(now: float, grid: NDArray[np.float64], first: int, size: int) -> _Estimate:
    """The estimate for a pose that is not finite."""
    return _Estimate(
        time=now,
        times=grid,
        mean=np.full((len(grid), size), math.nan),
        variance=np.full((len(grid), size), math.inf),
        first=first,
        confidence=0.0,
        mean_variance=math.inf,
        expected=np.full(size * MOMENTS, math.nan),
        by_command=0.0,
    )


class IntentionEstimator(LeafSystem):
    """Predicts the trajectory that the person is heading along, and the confidence of the prediction.

    .. pydrake_system::

        name: IntentionEstimator
        input_ports:
        - pose
        - human_command
        output_ports:
        - intention
        - confidence
        - mean_variance
        - influence
        - modes

    Inputs:
        pose: Configuration of the robot, such as [x, y, yaw] in [m, m, rad], world frame. Where an element is
            NaN or infinite, the intention is NaN and c_f is 0. The estimator cannot see the age of a pose: a
            localisation that may freeze must send NaN once its pose is too old.
        human_command (M): Command of the human, in the robot's units; may be left open. An observation for
            learners whose metadata have "evidence": "pose+command", ignored for others.

    Outputs:
        intention: :class:`~drake_shared.systems.intention.Intention`. Direct feedthrough.
        confidence (1): c_f of eq. (1) of Amirshirzad et al. 2022, in [0, 1]; NaN where the variance is. For
            learners whose metadata have "confidence_calibration", the probability that the intention is
            correct.
        mean_variance (1): Mean variance of the steps to come, over the D coordinates, in [m^2].
        influence (2): How far the pose and how far the human's command moved the expected path in this step:
            root mean square over the steps to come, in [m].
        modes: `drake_shared.learners.Modes` of the prediction: the routes that are still possible, from entry
            ``intention.first`` on; None where the prediction is not finite or the learner knows no
            demonstrations. For learners that predict no modes of their own, those of
            `drake_shared.learners.route_modes.RouteModes`. Computed only where something reads it.

    Parameters (of the Context, so that trials may differ in them):
        learner: See :meth:`SetLearner`.
        confidence_gain: K of eq. (1), in [1/m^2].

    State:
        progress (1): Time of the demonstrated point that was reached, in [s]; for learners whose metadata
            have "clock": "progress". Updated once a period.
        expected (8 D): Positions expected from the pose alone at 8 moments of the task, in [m].

    All outputs come from one cached estimate, computed once for each change of an input, a parameter or time.

    Once the agent has the control, the human's command cannot change the pose, and an estimate from the pose
    alone would never notice it (compare Aronson and Short, arXiv 2408.12103). The position to which the
    command leads in ``reach`` s is therefore a second observation, at the time of the nearest demonstrated
    point. It moves the mean; the variance is the largest of those with and without it and of the squared
    distance between both means. A command along one of several modes thus selects that mode without taking
    control from the human; a command elsewhere gives the control back.

    Args:
        learner: See :class:`drake_shared.learners.Learner`.
        robot: Gives the sizes of the inputs, and where a command leads.
        period: Control step, in [s].
        reach: Time ahead at which a command is an observation, in [s].
        repair: Keeps paths of intention and modes clear of known obstacles. The square of how far it moves
            a point is added to the variance there, which lowers the confidence.

    Raises:
        InputError: An argument is out of range, or learner and robot differ in the size of positions.

    While it runs, a prediction of another shape or with a variance that is not positive, and an exception in
    the learner, raise a RunError that names the learner and the time.
    """

    def __init__(
        self,
        *,
        learner: Learner,
        robot: Robot | None = None,
        period: float = 0.05,
        reach: float = REACH,
        repair: PathRepair | None = None,
    ) -> None:
        super().__init__()
        self.set_name("intention_estimator")
        robot = DiffDrive() if robot is None else robot
        check_robot(robot)
        check_positive(self, reach=reach)
        self._robot = robot
        self._reach = reach
        self._repair = repair
        self._least_distance = scaled_length(robot, LEAST_DISTANCE)
        self._size = len(robot.position_names)
        self._pose_port = self.DeclareVectorInputPort("pose", len(robot.configuration_names))
        self._human_port = self.DeclareVectorInputPort("human_command", len(robot.command_names))
        # Access by int takes half the time of access by Drake's index types.
        self._prepared = PreparedLearner(learner, robot)
        self._learner_index = int(self.DeclareAbstractParameter(Value(self._prepared)))
        self._gain_index = int(self.DeclareNumericParameter(BasicVector([learner.confidence_gain])))
        self._progress_index = int(self.DeclareDiscreteState(1))
        self._expected_index = int(self.DeclareDiscreteState(np.full(self._size * MOMENTS, math.nan)))
        prerequisites = {
            self.time_ticket(),
            self.xd_ticket(),
            self.all_parameters_ticket(),
            self.input_port_ticket(self._pose_port.get_index()),
            self.input_port_ticket(self._human_port.get_index()),
        }
        self._intention_port = self.DeclareAbstractOutputPort(
            "intention", lambda: Value(empty_intention(self._size)), self._calc_estimate, prerequisites
        )
        self._confidence_port = self.DeclareVectorOutputPort(
            "confidence", 1, self._calc_confidence, prerequisites
        )
        self.DeclareVectorOutputPort("mean_variance", 1, self._calc_mean_variance, prerequisites)
        self.DeclareVectorOutputPort("influence", 2, self._calc_influence, prerequisites)
        self.DeclareAbstractOutputPort("modes", lambda: Value[object](None), self._calc_modes, prerequisites)
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    def get_pose_input_port(self) -> InputPort:
        """The port ``pose``."""
        return self._pose_port

    def get_human_command_input_port(self) -> InputPort:
        """The port ``human_command``."""
        return self._human_port

    def get_intention_output_port(self) -> OutputPort:
        """The port ``intention``."""
        return self._intention_port

    def get_confidence_output_port(self) -> OutputPort:
        """The port ``confidence``."""
        return self._confidence_port

    def SetLearner(
        self,
        context: Context,
        learner: Learner,
        *,
        confidence_gain: float | None = None,
        use_human_command: bool = True,
    ) -> None:
        """Sets the learner of ``context``.

        Args:
            context: Of this system.
            learner: See :class:`drake_shared.learners.Learner`.
            confidence_gain: K of eq. (1), in [1/m^2]; the learner's own if None.
            use_human_command: Whether the human's command may be an observation.

        Raises:
            InputError: Learner and robot differ in the size of positions.
        """
        prepared = self._prepared
        if learner is not prepared.learner or not use_human_command:
            prepared = PreparedLearner(learner, self._robot, use_human_command=use_human_command)
        context.get_mutable_abstract_parameter(self._learner_index).set_value(prepared)
        gain = learner.confidence_gain if confidence_gain is None else confidence_gain
        context.get_mutable_numeric_parameter(self._gain_index)[0] = gain

    set_learner = SetLearner

    def _calc_estimate(self, context: Any, output: Any) -> None:
        prepared: PreparedLearner = context.get_abstract_parameter(self._learner_index).get_value()
        gain = context.get_numeric_parameter(self._gain_index)[0]
        pose = self._pose_port.Eval(context).tolist()
        position = self._robot.position(pose)
        if prepared.clock is None:
            now = min(context.get_time(), prepared.duration)
        else:
            reached = context.get_discrete_state(self._progress_index)[0]
            now = prepared.clock.advance(reached, *position)
        first = prepared.first_after(now)
        later = prepared.later[first]
        if not math.isfinite(sum(pose)):
            # The robot may be moving: to continue from the last pose would be a guess. The human drives.
            output.set_value(_unknown(now, prepared.grid, first, self._size))
            return
        times, positions = [now], [position]
        pointed = self._pointed(context, pose) if prepared.uses_command else None
        if pointed is not None:
            times.append(
                now + self._reach if prepared.clock is None else prepared.clock.advance(now, *pointed)
            )
            positions.append(pointed)
        try:
            predictions, modes = prepared.predict(times, positions, later)
        except Exception as error:  # Learners from outside this package may raise anything.
            reason = str(error) if isinstance(error, InputError) else f"{prepared.source} raised {error!r}"
            raise RunError(f"{reason}, at t = {context.get_time():.3f} s") from error
        mean, variance = predictions[0]
        whole_mean = prepared.padded(mean)
        expected = whole_mean.take(prepared.moments)
        by_command = 0.0
        if pointed is not None:
            mean_with, variance_with = predictions[1]
            moved = mean_with - mean
            moved *= moved
            whole_mean = prepared.padded(mean_with)
            variance = np.maximum(np.maximum(variance, variance_with), moved)
            by_command = math.sqrt(self._size * float(np.add.reduce(moved, axis=None)) / moved.size)
        if modes is not None:
            # The agent helps along the mode that the driver follows, not along the mean between two.
            whole_mean = prepared.padded(modes.mean[modes.aim])
        if self._repair is not None:
            times_to_come = context.get_time() + later - now
            path, moved, modes = self._repaired(
                self._repair, pose, whole_mean[first:], times_to_come, context.get_time(), modes
            )
            whole_mean = prepared.padded(path)
            variance = variance + np.square(moved)[:, None]
        # Every query is later than now: this is the mean of eq. (1). A method of the array is slower.
        spread = float(np.add.reduce(variance, axis=None)) / variance.size
        output.set_value(
            _Estimate(
                time=now,
                times=prepared.grid,
                mean=whole_mean,
                variance=prepared.padded(variance),
                first=first,
                modes=modes,
                confidence=prepared.confidence(spread, gain, whole_mean[first:], first),
                mean_variance=spread,
                expected=expected,
                by_command=by_command,
            )
        )

    @staticmethod
    def _repaired(
        repair: PathRepair,
        pose: list[float],
        path: NDArray[np.float64],
        times: NDArray[np.float64],
        now: float,
        modes: Modes | None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], Modes | None]:
        """Path (Q, 2) to assist, how far its points were moved (Q,), and the modes."""
        paths = path[None] if modes is None else modes.mean
        count = len(paths)
        poses = np.repeat([pose], count, axis=0)
        paths, moved = repair(poses, paths, np.repeat(times[None], count, axis=0), np.full(count, now))
        if modes is None:
            return paths[0], moved[0], None
        variance = modes.variance + np.square(moved)[..., None]
        return (
            paths[modes.aim],
            moved[modes.aim],
            dataclasses.replace(modes, mean=paths, variance=variance),
        )

    def _pointed(self, context: Context, pose: list[float]) -> tuple[float, ...] | None:
        """Position to which the human's command leads in ``reach`` s, in [m]; None if it hardly moves."""
        if not self._human_port.HasValue(context):
            return None
        command = self._human_port.Eval(context).tolist()
        if not math.isfinite(sum(command)):
            return None
        if self._robot.speed(command) * self._reach < self._least_distance:
            return None
        return self._robot.rollout(pose, command, self._reach)

    def _calc_confidence(self, context: Context, output: BasicVector) -> None:
        output[0] = self._intention_port.Eval(context).confidence

    def _calc_mean_variance(self, context: Context, output: BasicVector) -> None:
        output[0] = self._intention_port.Eval(context).mean_variance

    def _calc_influence(self, context: Context, output: BasicVector) -> None:
        estimate = self._intention_port.Eval(context)
        before = context.get_discrete_state(self._expected_index).value()
        moved = (estimate.expected - before).tolist()
        # The difference is NaN for NaN and infinite offsets.
        known = [offset * offset for offset in moved if offset - offset == 0.0]
        output[0] = math.sqrt(self._size * sum(known) / len(known)) if known else 0.0
        output[1] = estimate.by_command

    def _calc_modes(self, context: Any, output: Any) -> None:
        estimate = self._intention_port.Eval(context)
        modes = estimate.modes
        if modes is None and math.isfinite(estimate.mean_variance):
            prepared: PreparedLearner = context.get_abstract_parameter(self._learner_index).get_value()
            split, first = prepared.route_modes, estimate.first
            if split is not None:
                position = self._robot.position(self._pose_port.Eval(context).tolist())
                modes = split(
                    estimate.time, position, first, estimate.mean[first:], estimate.variance[first:]
                )
        output.set_value(modes)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        estimate = self._intention_port.Eval(context)
        state.set_value(self._progress_index, np.array([estimate.time]))
        state.set_value(self._expected_index, estimate.expected)
