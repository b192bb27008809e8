"""The arbiters of many trials."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.authority import (
    Authority,
    AuthorityState,
    limited_command,
    limited_weight,
    next_times,
)
from drake_shared.arbitration.blend import blend, confidence_weight, finite_weight, traded_weight
from drake_shared.common.elementwise import ARRAYS
from drake_shared.robots import DiffDrive
from drake_shared.systems.arbiter import Arbiter
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.constant_weight_blender import ConstantWeightBlender
from drake_shared.systems.traded_control import TradedControl

Floats = NDArray[np.float64]
_DRIVER_WEIGHTS = {"shared": math.nan, "human": 1.0, "agent": 0.0}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Arbitration:
    """Divides the control of many trials as a system of this package does that of one.

    Attributes:
        initial: The state at the start, given the number of trials.
        step: Maps state (k, n), human and autonomous command (2, n) in [rad/s], and confidence (n,) to w
            (n,) and command (2, n) in shared control, and the state of the next step.
    """

    initial: Callable[[int], Floats]
    step: Callable[[Floats, Floats, Floats, Floats], tuple[Floats, Floats, Floats]]


def make_arbitration(arbiter: Arbiter, robot: DiffDrive) -> Arbitration | None:
    """The arithmetic of ``arbiter``; None if it is unknown."""
    configuration = arbiter.configuration
    if type(arbiter) is ConfidenceBlender:
        limits = configuration["authority"]
        if limits is not None:
            return _with_authority(Authority(**limits), robot, arbiter.period)
        return _plain(lambda confidence: confidence_weight(confidence, ARRAYS))
    if type(arbiter) is ConstantWeightBlender:
        return _plain(lambda confidence: np.full_like(confidence, configuration["weight"]))
    if type(arbiter) is TradedControl:
        return _traded(**configuration)
    return None


def driver_weights(drivers: Sequence[str]) -> Floats:
    """The constant w of each driver; NaN for shared control."""
    return np.array([_DRIVER_WEIGHTS[driver] for driver in drivers])


def apply_driver(
    fixed: Floats, weight: Floats, command: Floats, human: Floats, autonomous: Floats
) -> tuple[Floats, Floats]:
    """w (n,) and command (2, n), where one of the two drives alone in some trials.

    Args:
        fixed: Of `driver_weights`.
        weight, command: In shared control.
        human, autonomous: Shape (2, n), in [rad/s].
    """
    alone = np.isfinite(fixed)
    if not alone.any():
        return weight, command
    own = finite_weight(fixed, autonomous, ARRAYS)
    return np.where(alone, own, weight), np.where(alone, blend(own, human, autonomous, ARRAYS), command)


def _plain(weigh: Callable[[Floats], Floats]) -> Arbitration:
    def step(
        state: Floats, human: Floats, autonomous: Floats, confidence: Floats
    ) -> tuple[Floats, Floats, Floats]:
        weight = finite_weight(weigh(confidence), autonomous, ARRAYS)
        return weight, np.stack(blend(weight, human, autonomous, ARRAYS)), state

    return Arbitration(initial=lambda count: np.zeros((0, count)), step=step)


def _traded(threshold: float, margin: float) -> Arbitration:
    def step(
        state: Floats, human: Floats, autonomous: Floats, confidence: Floats
    ) -> tuple[Floats, Floats, Floats]:
        weight = traded_weight(confidence, state[0], threshold, margin, ARRAYS)
        weight = finite_weight(weight, autonomous, ARRAYS)
        return weight, np.stack(blend(weight, human, autonomous, ARRAYS)), 1.0 - weight[None]

    return Arbitration(initial=lambda count: np.zeros((1, count)), step=step)


def _with_authority(authority: Authority, robot: DiffDrive, period: float) -> Arbitration:
    def initial(count: int) -> Floats:
        # A simulated operator is at the controls from the start.
        state: Any = AuthorityState.initial(len(robot.command_names), idle_time=0.0)
        return np.repeat(np.array(state.to_list())[:, None], count, axis=1)

    def step(
        state: Floats, human: Floats, autonomous: Floats, confidence: Floats
    ) -> tuple[Floats, Floats, Floats]:
        before = AuthorityState.from_list(list(state))
        after = next_times(
            authority,
            before,
            angle=robot.conflict_angle(human, autonomous, ARRAYS),
            human=human,
            idle_time=None,
            period=period,
            xp=ARRAYS,
        )
        weight = limited_weight(authority, after, confidence_weight(confidence, ARRAYS), period, ARRAYS)
        after.weight = finite_weight(weight, autonomous, ARRAYS)
        command = blend(after.weight, human, autonomous, ARRAYS)
        after.command = limited_command(authority, before.command, command, period, ARRAYS)
        return after.weight, np.stack(after.command), np.stack(after.to_list())

    return Arbitration(initial=initial, step=step)
