"""Arbitration: how much of the command is the person's."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from drake_shared.arbitration.authority import Authority
from drake_shared.robots import DiffDrive

MODES = ("shared", "human", "agent")

# A turn counts as much as a speed by this lever, in [m], when the angle between two twists is taken.
_LEVER = 0.5
# A command slower than this, in [m/s] of that measure, points nowhere, and one below it in [rad/s] is none.
_POINTING, _NOTHING = 0.05, 1e-6


class ConfidenceBlender(LeafSystem):
    """Blends both commands, the agent's by how sure it is: eq. (2) of Amirshirzad et al. 2022.

    .. pydrake_system::

        name: ConfidenceBlender
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        - idle_time
        output_ports:
        - shared_command
        - human_weight

    Inputs:
        human_command (2): Wheel speeds [left, right] in [rad/s].
        autonomous_command (2): The same, of the agent.
        confidence (1): c_f, in [0, 1].
        idle_time (1): Time since the human last touched the controls, in [s]; may be left open. Only with an
            authority.

    Outputs:
        shared_command (2): w human + (1 - w) autonomous, in [rad/s]. Feeds through.
        human_weight (1): w = 1 - c_f, from 0 (the agent drives) to 1 (the human drives). Feeds through.

    Where confidence or the agent's command is no number, the human drives alone (w = 1). A human command
    that is no number counts as zero.

    Parameters (of the Context):
        mode: "shared", or "human" (w = 1) or "agent" (w = 0) for comparison; see :meth:`set_mode`.

    With an :class:`~drake_shared.arbitration.authority.Authority` there is, in mode "shared", more to w than
    confidence:

    - It is never below the floor.
    - Commands are compared as twists (v, lever * yaw rate) with a lever of 0.5 m. Once they have pointed
      apart for the conflict time, w goes to 1, and comes back after they have agreed for the agreement time.
    - Once the human has given nothing for the hands-off time, w goes to 1 as well, and a human who commands
      nothing stands still. With an ``idle_time`` it is that which counts, and the command must be zero;
      without, how long the command has been zero.
    - w changes no faster than its rate, from 1 at the start. Only where the agent's command is no number
      is w = 1 at once.
    - The shared command moves straight towards the blend, each wheel no faster than its rate, from rest at
      the start. So it lies between both commands only once it has caught up; until then it lies between the
      command before and the blend. It goes beyond neither, and where both commands agree, not beyond them.

    State, with an authority:
        before (7): w and the shared command, in [rad/s], of the step before; how long the commands have
            pointed apart, how long they have agreed again, in [s], and 1 while the agent has let go for
            that; how long the human has given nothing, in [s].

    Nothing lags: w follows the confidence of the same step.

    Args:
        authority: What is left to the human; None: what the confidence says.
        robot: For the twist that a command means.
        period: Of the control step, in [s].
    """

    def __init__(
        self, *, authority: Authority | None = None, robot: DiffDrive | None = None, period: float = 0.05
    ) -> None:
        super().__init__()
        self._authority = authority
        self._robot = robot or DiffDrive()
        self._period = period
        self._human_port = self.DeclareVectorInputPort("human_command", 2)
        self._autonomous_port = self.DeclareVectorInputPort("autonomous_command", 2)
        self._confidence_port = self.DeclareVectorInputPort("confidence", 1)
        self._mode_index = self.DeclareAbstractParameter(Value("shared"))
        human, autonomous, confidence = (
            self.input_port_ticket(port.get_index())
            for port in (self._human_port, self._autonomous_port, self._confidence_port)
        )
        mode = self.pa_ticket()
        if authority is None:
            self._weight_port = self.DeclareVectorOutputPort(
                "human_weight", 1, self._calc_weight, {autonomous, confidence, mode}
            )
            self.DeclareVectorOutputPort(
                "shared_command", 2, self._calc_command, {human, autonomous, confidence, mode}
            )
            return
        self._idle_port = self.DeclareVectorInputPort("idle_time", 1)
        self._before_index = self.DeclareDiscreteState(np.array(_BlendState().to_list()))
        idle = self.input_port_ticket(self._idle_port.get_index())
        prerequisites = {human, autonomous, confidence, idle, mode, self.xd_ticket()}
        self._held = self.DeclareCacheEntry(
            "held", ValueProducer(lambda: Value(_BlendState()), self._calc_held), prerequisites
        )
        from_held = {self._held.ticket()}
        self.DeclareVectorOutputPort("human_weight", 1, self._calc_held_weight, from_held)
        self.DeclareVectorOutputPort("shared_command", 2, self._calc_held_command, from_held)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    @property
    def configuration(self) -> dict[str, Any]:
        """What a log says of it."""
        return {"authority": None if self._authority is None else self._authority.to_json()}

    def set_mode(self, context: Context, mode: str) -> None:
        """Sets who takes part: "shared", "human" or "agent".

        Raises:
            ValueError: It is none of these.
        """
        if mode not in MODES:
            raise ValueError(f"mode must be one of {', '.join(MODES)}, got {mode!r}")
        context.get_mutable_abstract_parameter(self._mode_index).set_value(mode)

    def let_go(self, context: Context) -> str | None:
        """Why the agent leaves the control to the human now, whatever its confidence.

        Returns:
            "hands_off" (the robot comes to rest), "conflict", or None.
        """
        if (
            self._authority is None
            or context.get_abstract_parameter(self._mode_index).get_value() != "shared"
        ):
            return None
        held: _BlendState = self._held.Eval(context)
        if held.released:
            return "conflict"
        return "hands_off" if self._is_hands_off(held) else None

    def _is_hands_off(self, held: _BlendState) -> bool:
        assert self._authority is not None
        time = self._authority.hands_off_time
        return time is not None and held.still >= time - 1e-9

    def _calc_weight(self, context: Context, output: BasicVector) -> None:
        mode = context.get_abstract_parameter(self._mode_index).get_value()
        weight = 1.0 if mode == "human" else 0.0
        if mode == "shared":
            weight = 1.0 - min(max(self._confidence_port.Eval(context).item(), 0.0), 1.0)
        output[0] = finite_weight(weight, self._autonomous_port.Eval(context).tolist())

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        weight = self._weight_port.Eval(context).item()
        human = self._human_port.Eval(context).tolist()
        output.set_value(blend(weight, human, self._autonomous_port.Eval(context).tolist()))

    def _calc_held(self, context: Context, output: Value) -> None:
        """What is applied now, and with it what the next step goes on from."""
        before = _BlendState(*context.get_discrete_state(self._before_index).value().tolist())
        human = self._human_port.Eval(context).tolist()
        autonomous = self._autonomous_port.Eval(context).tolist()
        mode = context.get_abstract_parameter(self._mode_index).get_value()
        held = self._watched(before, human, autonomous, self._idle(context))
        if mode == "shared":
            weight = self._weighed(before, held, self._confidence_port.Eval(context).item())
        else:
            weight = 1.0 if mode == "human" else 0.0
        held.weight = finite_weight(weight, autonomous)
        command = blend(held.weight, human, autonomous)
        held.left, held.right = self._caught_up(before, command) if mode == "shared" else command
        output.set_value(held)

    def _idle(self, context: Context) -> float | None:
        return self._idle_port.Eval(context).item() if self._idle_port.HasValue(context) else None

    def _watched(
        self, before: _BlendState, human: Sequence[float], agent: Sequence[float], idle: float | None
    ) -> _BlendState:
        """How long what has lasted, by now."""
        authority, period = self._authority, self._period
        assert authority is not None
        angle = self._angle(human, agent)
        apart = before.apart + period if angle > authority.conflict_angle else 0.0
        # What points nowhere neither agrees nor contradicts.
        agreed = before.agreed + period if angle < authority.agreement_angle else 0.0
        released = before.released
        if authority.conflict_time is not None:
            if released:
                released = float(agreed < authority.agreement_time - 1e-9)
            else:
                released = float(apart >= authority.conflict_time - 1e-9)
        left, right = human
        gives = math.isfinite(left + right) and max(abs(left), abs(right)) > _NOTHING
        still = 0.0 if gives else (before.still + period if idle is None else idle)
        return _BlendState(apart=apart, agreed=agreed, released=released, still=still)

    def _angle(self, human: Sequence[float], agent: Sequence[float]) -> float:
        """Between both commands as twists, in [rad]; NaN if one of them points nowhere."""
        speed, yaw_rate = self._robot.twist(*human)
        other_speed, other_yaw_rate = self._robot.twist(*agent)
        turn, other_turn = _LEVER * yaw_rate, _LEVER * other_yaw_rate
        if not min(math.hypot(speed, turn), math.hypot(other_speed, other_turn)) > _POINTING:
            return math.nan
        across = speed * other_turn - turn * other_speed
        return abs(math.atan2(across, speed * other_speed + turn * other_turn))

    def _weighed(self, before: _BlendState, held: _BlendState, confidence: float) -> float:
        """w, by confidence and authority, no further from that before than its rate allows."""
        authority = self._authority
        assert authority is not None
        weight = 1.0 - min(max(confidence, 0.0), 1.0) if not math.isnan(confidence) else 1.0
        weight, rate = max(weight, authority.floor), authority.weight_rate
        if held.released or self._is_hands_off(held):
            weight = 1.0
            rate = 1.0 / (authority.release_time if held.released else authority.stop_time)
        if rate is None:
            return weight
        most = rate * self._period
        return min(max(weight, before.weight - most), before.weight + most)

    def _caught_up(self, before: _BlendState, command: Sequence[float]) -> tuple[float, float]:
        """As far from the command before towards ``command``, [left, right], as the rate allows."""
        assert self._authority is not None
        left, right = command
        if self._authority.command_rate is None:
            return left, right
        furthest = max(abs(left - before.left), abs(right - before.right))
        most = self._authority.command_rate * self._period
        if furthest <= most:
            return left, right
        share = most / furthest
        return before.left + share * (left - before.left), before.right + share * (right - before.right)

    def _calc_held_weight(self, context: Context, output: BasicVector) -> None:
        output[0] = self._held.Eval(context).weight

    def _calc_held_command(self, context: Context, output: BasicVector) -> None:
        held: _BlendState = self._held.Eval(context)
        output.set_value(np.array([held.left, held.right]))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._before_index, self._held.Eval(context).to_list())


@dataclasses.dataclass(slots=True)
class _BlendState:
    """What one step hands to the next; see the State of :class:`ConfidenceBlender`."""

    weight: float = 1.0
    left: float = 0.0
    right: float = 0.0
    apart: float = 0.0
    agreed: float = 0.0
    released: float = 0.0
    still: float = 0.0

    def to_list(self) -> list[float]:
        return [
            *(self.weight, self.left, self.right),
            *(self.apart, self.agreed, self.released, self.still),
        ]


def finite_weight(weight: float, autonomous: Sequence[float]) -> float:
    """The human's weight, 1 where it or the agent's command, [left, right], is no finite number."""
    left, right = autonomous
    # A sum with what is no finite number is none either.
    return weight if math.isfinite(weight + left + right) else 1.0


def blend(weight: float, human: Sequence[float], autonomous: Sequence[float]) -> tuple[float, float]:
    """w human + (1 - w) autonomous, [left, right]; a human command that is no number is zero."""
    left, right = human
    if not math.isfinite(left + right):
        left = right = 0.0
    if weight < 1.0:
        other_left, other_right = autonomous
        left = weight * left + (1.0 - weight) * other_left
        right = weight * right + (1.0 - weight) * other_right
    return left, right
