"""Operator that a person drives by mouse, keys or gamepad: a virtual stick with two axes."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping
from typing import ClassVar, Protocol

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem, OutputPort

from drake_shared.robots import Robot, check_robot, scaled_length
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate, check_positive

STALE_AFTER = 0.15
"""Age, in [s], after which a sample no longer drives."""

_NO_ENGAGEMENT = -1.0
_OLDEST = 60.0  # Ages are logged; this bound keeps them finite before the first sample.
# Speed at full deflection, in [m/s], of the Pioneer P3-DX.
_SPEED = 0.8


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class StickSettings:
    """How displacements of the mouse move the virtual stick; the driver may change it at any time."""

    gain: float = 0.003
    """Deflection for one count of the mouse; the stick's range is [-1, 1]."""
    dead_zone: float = 0.05
    """Deflection below which an axis reads 0; from there to 1 it reads 0 to 1."""
    return_time: float = 0.0
    """Time in which the stick returns from full deflection to its centre, in [s]; 0: it stays."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class MouseSample:
    """The newest input of the driver."""

    engaged: bool = False
    """Whether a driver holds the controls."""
    engagement: int = 0
    """A number that differs each time a driver takes the controls."""
    x: float = 0.0
    """Counts to the right since the driver engaged."""
    y: float = 0.0
    """Counts toward the driver (down the screen) since the driver engaged."""
    forward: float = 0.0
    """Deflection that keys or a gamepad add forward, in [-1, 1]."""
    turn: float = 0.0
    """Deflection that keys or a gamepad add to the left, in [-1, 1]."""
    up: float = 0.0
    """Deflection that wheel and keys give upward, in [-1, 1]; for an arm."""
    vertical: bool = False
    """Whether the stick moves up and sideways rather than forward and sideways; for an arm."""
    arrival: float = -math.inf
    """Time of arrival, in [s], by the clock given to MouseInput."""
    stick: StickSettings = StickSettings()
    braking: bool = False
    """Whether the driver asks for a stop: the command is zero."""
    centrings: int = 0
    """A number that differs each time the driver centres the stick."""


class MouseSource(Protocol):
    """Source of samples. ``latest`` may be called from any thread and never blocks."""

    def latest(self) -> MouseSample:
        """The newest sample."""


class MouseInput(LeafSystem):
    """Converts a person's mouse, keys or gamepad into commands.

    .. pydrake_system::

        name: MouseInput
        output_ports:
        - human_command
        - mouse
        - idle_time

    Outputs (all are discrete state, sampled from outside once a period, without direct feedthrough):
        human_command (M): In the robot's units.
        mouse (6): Values for the log: the counters x (right) and y (toward the driver) since the driver
            engaged, the age of the sample in [s], the deflection of the stick forward and to the left in
            [-1, 1], and 1 while engaged, else 0.
        idle_time (1): Time since the mouse, the keys or the gamepad last changed, in [s]; infinite until a
            driver first touches them. Samples that repeat the previous one are not events, nor are changes of
            keys or gamepad inside the dead zone: the noise of a gamepad at rest.

    A displacement moves the stick: stick = clip(stick + gain * displacement, -1, 1), where the displacement
    is the difference of the counters since the last sample. Counters lose nothing where the browser merges
    moves. Keys and gamepad add to the stick. The robot turns the deflections into a command; for the
    differential drive, forward is speed and sideways is yaw rate (to the right is negative yaw), and its
    wheels limit both by the same factor.

    The command is 0 when nobody is engaged, while the driver asks for a stop, when the newest sample is older
    than ``stale_after``, and from a new engagement until its first move. Disengaging centres the stick; a gap
    in the samples does not: when samples come again the stick is where the hand has moved it.

    Args:
        robot: Turns deflections into commands.
        source: Read once a period.
        max_speed: Speed at full deflection, in [m/s]; if None, 0.8 for the Pioneer P3-DX, scaled with the
            robot.
        max_yaw_rate: Yaw rate at full deflection, in [rad/s].
        period: Time between samples, in [s].
        stale_after: Age past which a sample no longer drives, in [s].
        max_displacement: Largest displacement of one sample, in counts: pointer lock is known to report
            jumps that nobody made.
        clock: Time in [s], the one that stamps ``MouseSample.arrival``.

    Raises:
        InputError: A number is not positive and finite, or ``robot`` is not a Robot.
    """

    log_columns: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "mouse": ("mouse_x", "mouse_y", "mouse_age", "stick_forward", "stick_left", "engaged")
    }
    """Output ports that are logged beside the command, and the names of their columns."""

    def __init__(
        self,
        *,
        robot: Robot,
        source: MouseSource,
        max_speed: float | None = None,
        max_yaw_rate: float = 1.5,
        period: float = 0.005,
        stale_after: float = STALE_AFTER,
        max_displacement: float = 300.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self.set_name("mouse_input")
        check_robot(robot)
        max_speed = scaled_length(robot, _SPEED) if max_speed is None else max_speed
        check_positive(
            self,
            max_speed=max_speed,
            max_yaw_rate=max_yaw_rate,
            stale_after=stale_after,
            max_displacement=max_displacement,
        )
        self._robot = robot
        self._source = source
        self._max_speed = max_speed
        self._max_yaw_rate = max_yaw_rate
        self._period = period
        self._stale_after = stale_after
        self._max_displacement = max_displacement
        self._clock = clock
        self._command = self.DeclareDiscreteState(len(robot.command_names))
        self._mouse = self.DeclareDiscreteState(np.array([0.0, 0.0, _OLDEST, 0.0, 0.0, 0.0]))
        # The last sample, to compare the next one with: engagement, counters x, y, stick forward, stick left,
        # and the number of centrings.
        self._memory = self.DeclareDiscreteState(np.array([_NO_ENGAGEMENT, *np.zeros(5)]))
        # Time since the last event, and the deflections by keys or gamepad past the dead zone then.
        self._idle = self.DeclareDiscreteState(np.array([math.inf]))
        self._held = self.DeclareDiscreteState(3)
        self._command_port = self.DeclareStateOutputPort("human_command", self._command)
        self.DeclareStateOutputPort("mouse", self._mouse)
        self._idle_port = self.DeclareStateOutputPort("idle_time", self._idle)
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    def get_human_command_output_port(self) -> OutputPort:
        """The port ``human_command``."""
        return self._command_port

    def get_idle_time_output_port(self) -> OutputPort:
        """The port ``idle_time``."""
        return self._idle_port

    @property
    def max_speed(self) -> float:
        """Speed at full deflection, in [m/s]."""
        return self._max_speed

    @property
    def max_yaw_rate(self) -> float:
        """Yaw rate at full deflection, in [rad/s]."""
        return self._max_yaw_rate

    def _update(self, context: Context, state: DiscreteValues) -> None:
        sample = self._source.latest()
        age = min(max(self._clock() - sample.arrival, 0.0), _OLDEST)
        numbers = (sample.x, sample.y, sample.forward, sample.turn, sample.up)
        if not all(map(math.isfinite, numbers)):
            # A NaN would stay in the stick forever.
            sample = MouseSample(
                engagement=sample.engagement,
                vertical=sample.vertical,
                arrival=sample.arrival,
                centrings=sample.centrings,
            )
        stick = self._moved_stick(context, sample) if sample.engaged else (0.0, 0.0)
        drives = sample.engaged and not sample.braking and age <= self._stale_after
        forward = _clip(stick[0] + sample.forward) if drives else 0.0
        left = _clip(stick[1] + sample.turn) if drives else 0.0
        dead_zone = sample.stick.dead_zone
        deflections = (forward, left, sample.up if drives else 0.0)
        command = self._command_of(sample, *(_past_dead_zone(value, dead_zone) for value in deflections))
        state.set_value(self._command, command)
        state.set_value(self._mouse, [sample.x, sample.y, age, forward, left, float(sample.engaged)])
        state.set_value(self._memory, [sample.engagement, sample.x, sample.y, *stick, sample.centrings])
        state.set_value(self._idle, [self._idle_time(context, sample)])
        state.set_value(self._held, _deflected(sample))

    def _command_of(self, sample: MouseSample, forward: float, left: float, up: float) -> tuple[float, ...]:
        """The command (M,) of deflections past the dead zone; ``up`` and planes are those of a subclass."""
        return self._robot.stick_command(
            forward, left, max_speed=self._max_speed, max_yaw_rate=self._max_yaw_rate
        )

    def _idle_time(self, context: Context, sample: MouseSample) -> float:
        """Time since the last event, in [s], this sample included."""
        engagement, x, y, *_ = context.get_discrete_state(self._memory).value().tolist()
        before = [engagement, x, y, *context.get_discrete_state(self._held).value().tolist()]
        changed = before != [sample.engagement, sample.x, sample.y, *_deflected(sample)]
        # The first sample differs from the initial memory: it is an event only if a driver is there.
        if changed and (sample.engaged or engagement != _NO_ENGAGEMENT):
            return 0.0
        idle: float = context.get_discrete_state(self._idle)[0] + self._period
        return idle

    def _moved_stick(self, context: Context, sample: MouseSample) -> tuple[float, float]:
        """The stick, forward and to the left, after the displacement since the last sample."""
        memory = context.get_discrete_state(self._memory).value()
        engagement, last_x, last_y, forward, left, centrings = memory
        if engagement != sample.engagement:
            # Counters start at 0 when a driver engages, so that the first move counts.
            last_x = last_y = forward = left = 0.0
        if centrings != sample.centrings:
            last_x, last_y, forward, left = sample.x, sample.y, 0.0, 0.0
        settings = sample.stick
        if settings.return_time > 0:
            back = self._period / settings.return_time
            forward = math.copysign(max(abs(forward) - back, 0.0), forward)
            left = math.copysign(max(abs(left) - back, 0.0), left)
        limit = self._max_displacement
        dx = min(max(sample.x - last_x, -limit), limit)
        dy = min(max(sample.y - last_y, -limit), limit)
        return _clip(forward - settings.gain * dy), _clip(left - settings.gain * dx)


def _clip(deflection: float) -> float:
    return min(max(deflection, -1.0), 1.0)


def _deflected(sample: MouseSample) -> list[float]:
    """Deflections by keys, gamepad or wheel, forward, to the left and up, past the dead zone."""
    values = (sample.forward, sample.turn, sample.up)
    return [_past_dead_zone(value, sample.stick.dead_zone) for value in values]


def _past_dead_zone(deflection: float, dead_zone: float) -> float:
    past = max(abs(deflection) - dead_zone, 0.0) / (1.0 - dead_zone)
    return math.copysign(past, deflection)
