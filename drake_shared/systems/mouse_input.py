"""A person's mouse, keys or gamepad as an operator: a virtual stick that turns into wheel speeds."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from typing import ClassVar, Protocol

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from drake_shared.robots import DiffDrive

STALE_AFTER = 0.15
"""Age, in [s], past which a sample says nothing about what the driver wants now."""

_OLDEST = 60.0  # An age is logged; a bound keeps it finite before the first sample.


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class StickSettings:
    """How displacements of the mouse move the virtual stick. The driver may change them at any time."""

    gain: float = 0.003
    """Deflection for one count of the mouse; the stick's range is [-1, 1]."""
    dead_zone: float = 0.05
    """Deflection below which an axis reads 0; from there to 1 it reads 0 to 1."""
    return_time: float = 0.0
    """Time in which the stick comes back from full deflection to its centre, in [s]; 0: it stays."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class MouseSample:
    """The newest that is known of the driver."""

    engaged: bool = False
    """Whether somebody holds the controls."""
    engagement: int = 0
    """Differs each time that somebody takes the controls."""
    x: float = 0.0
    """Counts to the right since the driver engaged."""
    y: float = 0.0
    """Counts towards the driver (down the screen) since the driver engaged."""
    forward: float = 0.0
    """What keys or a gamepad add to the stick, in [-1, 1]."""
    turn: float = 0.0
    """The same sideways, in [-1, 1], positive to the left."""
    arrival: float = -math.inf
    """When the sample came, in [s] of the clock given to MouseInput."""
    stick: StickSettings = StickSettings()


class MouseSource(Protocol):
    """Where samples come from. ``latest`` may be called from any thread and never waits."""

    def latest(self) -> MouseSample:
        """The newest sample."""


class MouseInput(LeafSystem):
    """The human input source that a person drives with.

    .. pydrake_system::

        name: MouseInput
        output_ports:
        - human_command
        - mouse
        - idle_time

    ``human_command`` (2,) is the wheel speeds [left, right] in [rad/s]. ``mouse`` (6,) is what a log
    keeps of the driver: the counters x (right) and y (towards the driver) since the driver engaged, the
    age of the sample in [s], the deflection of the stick forward and to the left in [-1, 1], and 1 while
    engaged, else 0. ``idle_time`` (1,) is the time since the mouse, the keys or the gamepad last moved, in
    [s]; samples that repeat what was known are no events. All are discrete state, sampled from outside every
    ``period``; no port has direct feedthrough, so a trial's log holds all that came in.

    A displacement moves the stick: stick = clip(stick + gain * displacement, -1, 1), where the
    displacement is the difference of the counters since the last sample. Counters lose nothing where
    the browser merges moves. Keys and gamepad add to the stick. Forward deflection is speed, sideways
    deflection is yaw rate (to the right is negative yaw), and the robot's wheels limit both alike.

    The command is 0 when nobody is engaged, when the newest sample is older than ``stale_after``, and from
    a new engagement until its first move. Letting go centres the stick; a pause in what is heard does not:
    when samples come again the stick is where the hand has it.

    Args:
        robot: Turns speed and yaw rate into wheel speeds.
        source: Read once a period.
        max_speed: Speed at full deflection, in [m/s].
        max_yaw_rate: Yaw rate at full deflection, in [rad/s].
        period: Time between samples, in [s].
        stale_after: Age past which a sample no longer drives, in [s].
        max_displacement: Largest displacement of one sample, in counts: pointer lock is known to report
            jumps that nobody made.
        clock: Time in [s], the one that stamps ``MouseSample.arrival``.

    Raises:
        ValueError: A number is not positive and finite.
    """

    log_columns: ClassVar[dict[str, tuple[str, ...]]] = {
        "mouse": ("mouse_x", "mouse_y", "mouse_age", "stick_forward", "stick_left", "engaged")
    }
    """Output ports that a log keeps beside the command, and the names of their columns."""

    def __init__(
        self,
        *,
        robot: DiffDrive,
        source: MouseSource,
        max_speed: float = 0.8,
        max_yaw_rate: float = 1.5,
        period: float = 0.005,
        stale_after: float = STALE_AFTER,
        max_displacement: float = 300.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        for name, value in (
            ("max_speed", max_speed),
            ("max_yaw_rate", max_yaw_rate),
            ("period", period),
            ("stale_after", stale_after),
            ("max_displacement", max_displacement),
        ):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        self._robot = robot
        self._source = source
        self._max_speed = max_speed
        self._max_yaw_rate = max_yaw_rate
        self._period = period
        self._stale_after = stale_after
        self._max_displacement = max_displacement
        self._clock = clock
        self._command = self.DeclareDiscreteState(2)
        self._mouse = self.DeclareDiscreteState(np.array([0.0, 0.0, _OLDEST, 0.0, 0.0, 0.0]))
        # What the next sample is compared with: engagement, counters x, y, stick forward, stick left.
        self._memory = self.DeclareDiscreteState(np.array([-1.0, 0.0, 0.0, 0.0, 0.0]))
        # Time since the last event, and what keys or gamepad gave then, forward and to the left.
        self._idle = self.DeclareDiscreteState(1)
        self._held = self.DeclareDiscreteState(2)
        self.DeclareStateOutputPort("human_command", self._command)
        self.DeclareStateOutputPort("mouse", self._mouse)
        self.DeclareStateOutputPort("idle_time", self._idle)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

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
        numbers = (sample.x, sample.y, sample.forward, sample.turn)
        if not all(map(math.isfinite, numbers)):
            # One NaN in the stick would stay there for ever.
            sample = dataclasses.replace(sample, engaged=False, x=0.0, y=0.0, forward=0.0, turn=0.0)
        stick = self._moved_stick(context, sample) if sample.engaged else (0.0, 0.0)
        heard = sample.engaged and age <= self._stale_after
        forward = _clip(stick[0] + sample.forward) if heard else 0.0
        left = _clip(stick[1] + sample.turn) if heard else 0.0
        dead_zone = sample.stick.dead_zone
        command = self._robot.wheel_speeds(
            self._max_speed * _past_dead_zone(forward, dead_zone),
            self._max_yaw_rate * _past_dead_zone(left, dead_zone),
        )
        state.set_value(self._command, command)
        state.set_value(self._mouse, [sample.x, sample.y, age, forward, left, float(sample.engaged)])
        state.set_value(self._memory, [sample.engagement, sample.x, sample.y, *stick])
        state.set_value(self._idle, [self._idle_time(context, sample)])
        state.set_value(self._held, [sample.forward, sample.turn])

    def _idle_time(self, context: Context, sample: MouseSample) -> float:
        """Time since the last event, in [s], this sample counted."""
        engagement, x, y, *_ = context.get_discrete_state(self._memory).value().tolist()
        before = [engagement, x, y, *context.get_discrete_state(self._held).value().tolist()]
        if before != [sample.engagement, sample.x, sample.y, sample.forward, sample.turn]:
            return 0.0
        return context.get_discrete_state(self._idle)[0] + self._period

    def _moved_stick(self, context: Context, sample: MouseSample) -> tuple[float, float]:
        """The stick, forward and to the left, after the displacement since the last sample."""
        engagement, last_x, last_y, forward, left = context.get_discrete_state(self._memory).value()
        if engagement != sample.engagement:
            # Counters begin at 0 when a driver engages: the very first move counts.
            last_x = last_y = forward = left = 0.0
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


def _past_dead_zone(deflection: float, dead_zone: float) -> float:
    past = max(abs(deflection) - dead_zone, 0.0) / (1.0 - dead_zone)
    return math.copysign(past, deflection)
