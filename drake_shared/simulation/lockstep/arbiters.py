"""The arbiters of many trials."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
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
from drake_shared.arbitration.blend import (
    blend,
    confidence_weight,
    finite_command,
    finite_weight,
)
from drake_shared.arbitration.rule import ArbiterInputs, ArbitrationRule, State
from drake_shared.common.elementwise import ARRAYS
from drake_shared.learners import Learner
from drake_shared.robots import DiffDrive
from drake_shared.systems.arbiter import Arbiter
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.constant_weight_blender import ConstantWeightBlender
from drake_shared.systems.rule_arbiter import RuleArbiter

Floats = NDArray[np.float64]
_DRIVER_WEIGHTS = {"shared": math.nan, "human": 1.0, "agent": 0.0}


def has_rule(arbiter: Arbiter) -> bool:
    """Whether the arithmetic of ``arbiter`` is known for many trials."""
    return isinstance(arbiter, RuleArbiter) or type(arbiter) in _RULES


class Arbitrations:
    """The arbiters of many trials, whose rules may depend on the learner.

    Args:
        arbiter: Of all trials; `has_rule` must be true.
        learners: Of each of n trials.
    """

    def __init__(self, arbiter: Arbiter, learners: Sequence[Learner | None]) -> None:
        self._which = np.zeros(len(learners), np.int64)
        self._logged: tuple[str, ...] = ()
        if isinstance(arbiter, RuleArbiter):
            found = {id(learner): learner for learner in learners}
            self._rules: list[ArbitrationRule] = [_Applied(arbiter.MakeRule(item)) for item in found.values()]
            self._logged = arbiter.logged
            order = list(found)
            self._which = np.array([order.index(id(learner)) for learner in learners])
        else:
            self._rules = [_RULES[type(arbiter)](arbiter)]
        sizes = np.bincount(self._which, minlength=len(self._rules)).tolist()
        self._states = [rule.initial_state(size) for rule, size in zip(self._rules, sizes, strict=True)]

    def step(self, inputs: ArbiterInputs) -> tuple[Floats, Floats]:
        """w (n,) and command (2, n), in [rad/s], of the next step of all trials in shared control."""
        weight, command = np.empty(inputs.human.shape[1]), np.empty_like(inputs.human)
        for index, rule in enumerate(self._rules):
            rows = np.flatnonzero(self._which == index)
            if len(rows):
                own = inputs if len(self._rules) == 1 else _of(inputs, rows)
                result = rule.step(self._states[index], own)
                weight[rows], command[:, rows], self._states[index] = result
        return weight, command

    def logged(self) -> Floats:
        """The further columns (L, n) of the log after this step's command."""
        values = np.empty((len(self._logged), len(self._which)))
        for index, state in enumerate(self._states):
            for column, name in zip(values, self._logged, strict=True):
                column[self._which == index] = state[name]
        return values

    def keep(self, rows: NDArray[np.bool_]) -> None:
        """Leaves out the trials that ``rows`` (n,) does not mark."""
        states = enumerate(self._states)
        self._states = [kept(state, rows[self._which == index]) for index, state in states]
        self._which = self._which[rows]


def kept(state: dict[str, Any], keep: NDArray[np.bool_]) -> dict[str, Any]:
    """The state of the trials that ``keep`` marks."""
    return {
        name: kept(value, keep) if isinstance(value, dict) else np.ascontiguousarray(value[..., keep])
        for name, value in state.items()
    }


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


def _of(inputs: ArbiterInputs, rows: NDArray[np.int64]) -> ArbiterInputs:
    """The inputs of some trials."""
    # Contiguous, since the layout of an array changes the last bits of its sums.
    parts = {
        field.name: np.ascontiguousarray(getattr(inputs, field.name)[..., rows])
        for field in dataclasses.fields(inputs)
    }
    return ArbiterInputs(**parts)


@dataclasses.dataclass(frozen=True)
class _Applied:
    """A rule as `RuleArbiter` applies it."""

    rule: ArbitrationRule

    def initial_state(self, count: int) -> State:
        return self.rule.initial_state(count)

    def step(self, state: State, inputs: ArbiterInputs) -> tuple[Floats, Floats, State]:
        if inputs.human.shape[1] == 1:
            # The order of a sum, and so its last bits, must not depend on the number of trials.
            twice = np.zeros(2, np.int64)
            pair = {name: np.repeat(value, 2, axis=-1) for name, value in state.items()}
            weight, command, after = self.step(pair, _of(inputs, twice))
            return weight[:1], command[:, :1], {name: value[..., :1] for name, value in after.items()}
        human = np.stack(list(finite_command(inputs.human, ARRAYS)))
        weight, command, after = self.rule.step(state, dataclasses.replace(inputs, human=human))
        weight = finite_weight(weight, inputs.autonomous, ARRAYS)
        return weight, np.where(weight == 1.0, human, command), after


@dataclasses.dataclass(frozen=True)
class _Formula:
    """The rule of an arbiter that is no `RuleArbiter`; its state is one array (k, n)."""

    initial: Callable[[int], Floats]
    divide: Callable[[Floats, ArbiterInputs], tuple[Floats, Floats, Floats]]

    def initial_state(self, count: int) -> State:
        return {"values": self.initial(count)}

    def step(self, state: State, inputs: ArbiterInputs) -> tuple[Floats, Floats, State]:
        weight, command, after = self.divide(state["values"], inputs)
        return weight, command, {"values": after}


def _of_confidence(arbiter: Arbiter) -> ArbitrationRule:
    limits = arbiter.configuration["authority"]
    if limits is not None:
        return _with_authority(Authority(**limits), arbiter)
    return _plain(lambda confidence: confidence_weight(confidence, ARRAYS))


def _constant(arbiter: Arbiter) -> ArbitrationRule:
    weight = arbiter.configuration["weight"]
    return _plain(lambda confidence: np.full_like(confidence, weight))


def _plain(weigh: Callable[[Floats], Floats]) -> ArbitrationRule:
    def divide(state: Floats, inputs: ArbiterInputs) -> tuple[Floats, Floats, Floats]:
        weight = finite_weight(weigh(inputs.confidence), inputs.autonomous, ARRAYS)
        return weight, np.stack(blend(weight, inputs.human, inputs.autonomous, ARRAYS)), state

    return _Formula(lambda count: np.zeros((0, count)), divide)


def _with_authority(authority: Authority, arbiter: Arbiter) -> ArbitrationRule:
    robot, period = arbiter.robot, arbiter.period
    assert isinstance(robot, DiffDrive)

    def initial(count: int) -> Floats:
        # A simulated operator is at the controls from the start.
        state: Any = AuthorityState.initial(len(robot.command_names), idle_time=0.0)
        return np.repeat(np.array(state.to_list())[:, None], count, axis=1)

    def divide(state: Floats, inputs: ArbiterInputs) -> tuple[Floats, Floats, Floats]:
        human, autonomous = inputs.human, inputs.autonomous
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
        weight = limited_weight(
            authority, after, confidence_weight(inputs.confidence, ARRAYS), period, ARRAYS
        )
        after.weight = finite_weight(weight, autonomous, ARRAYS)
        command = blend(after.weight, human, autonomous, ARRAYS)
        after.command = limited_command(authority, before.command, command, period, ARRAYS)
        return after.weight, np.stack(after.command), np.stack(after.to_list())

    return _Formula(initial, divide)


_RULES: Mapping[type[Arbiter], Callable[[Arbiter], ArbitrationRule]] = {
    ConfidenceBlender: _of_confidence,
    ConstantWeightBlender: _constant,
}
