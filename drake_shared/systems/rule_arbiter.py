"""Arbiters whose arithmetic is a rule that also serves many trials at once."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, ValueProducer

from drake_shared.arbitration.blend import finite_command
from drake_shared.arbitration.rule import ArbiterInputs, ArbitrationRule, State
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.robots import Robot
from drake_shared.systems.arbiter import Arbiter
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate

T = TypeVar("T")


class RuleArbiter(Arbiter):
    """Applies an :class:`~drake_shared.arbitration.rule.ArbitrationRule`; a base class.

    A subclass implements :meth:`MakeRule`, and calls :meth:`DeclareRule` once it can. The lock-step engine
    runs the same rule for many trials.

    .. pydrake_system::

        name: RuleArbiter
        input_ports:
        - human_command
        - autonomous_command
        - confidence
        output_ports:
        - shared_command
        - human_weight

    Inputs, outputs and parameters are those of :class:`~drake_shared.systems.arbiter.Arbiter`.

    State:
        memory: The arrays of the rule's state, one after the other.

    Args:
        robot, period, driver: See :class:`~drake_shared.systems.arbiter.Arbiter`.
        optional_inputs: Of ``pose`` and ``clearance``, those that the rule uses.
        logged: Names of entries (n,) of the rule's state. Each is an output port, after this step's command,
            and a column of the log.
    """

    state_size: ClassVar[int | None] = None
    """Numbers of the state of one trial, where they depend on the learner: a Context cannot grow."""

    def __init__(
        self,
        *,
        robot: Robot | None = None,
        period: float = 0.05,
        driver: str = "shared",
        optional_inputs: Sequence[str] = (),
        logged: Sequence[str] = (),
    ) -> None:
        super().__init__(robot=robot, period=period, driver=driver, optional_inputs=optional_inputs)
        self._further_ports = {name: self.GetInputPort(name) for name in optional_inputs}
        self.logged = tuple(logged)

    def MakeRule(self, learner: Learner | None) -> ArbitrationRule:
        """The rule of trials with ``learner``; None: there is no learner."""
        raise NotImplementedError

    def DeclareRule(self) -> None:
        """Declares the rule, that of trials without a learner, its state and its updates."""
        made = _Made.of(self.MakeRule(None))
        self._size = self.state_size or sum(value.size for value in made.layout.values())
        self._rule_index = int(self.DeclareAbstractParameter(Value(_Shared(made))))
        # Unrestricted updates of abstract state come before discrete updates, such as the plant's: those
        # would act on a command of the next step.
        self._memory_index = int(self.DeclareDiscreteState(self._packed(made.layout)))
        self._step_cache = self.DeclareCacheEntry(
            "rule_step",
            ValueProducer(lambda: Value[object](), self._calc_step),
            {self.all_input_ports_ticket(), self.pa_ticket(), self.xd_ticket()},
        )
        DeclareDiscreteUpdate(self, period=self.period, update=self._update)
        for name in self.logged:
            self.DeclareVectorOutputPort(name, 1, functools.partial(self._calc_logged, name))

    def SetLearner(self, context: Context, learner: Learner) -> None:
        """Sets the rule of ``context`` to that of trials with ``learner``, at its start.

        Raises:
            InputError: The rule's state is too large.
        """
        made = _Made.of(self.MakeRule(learner))
        context.get_mutable_abstract_parameter(self._rule_index).set_value(_Shared(made))
        context.SetDiscreteState(self._memory_index, self._packed(made.layout))

    def rule(self, context: Context) -> ArbitrationRule:
        """The rule of ``context``."""
        return self._made_in(context).rule

    def state_after(self, context: Context) -> State:
        """The rule's state after this step's command, for one trial."""
        return self._step(context).after

    def DoCalcWeight(self, context: Context) -> float:
        """w of the rule."""
        return self._step(context).weight

    def DoCalcCommand(
        self, context: Context, weight: float, human: Sequence[float], autonomous: Sequence[float]
    ) -> Sequence[float]:
        """The command of the rule; the human's where w is 1."""
        return list(finite_command(human)) if weight == 1.0 else self._step(context).command

    def _made_in(self, context: Context) -> _Made:
        made: _Made = context.get_abstract_parameter(self._rule_index).get_value().content
        return made

    def _step(self, context: Context) -> _Step:
        step: _Step = self._step_cache.Eval(context).content
        return step

    def _calc_step(self, context: Context, output: Value) -> None:
        further: dict[str, Any] = {name: port.Eval(context) for name, port in self._further_ports.items()}
        inputs = ArbiterInputs(
            human=np.array(finite_command(self._human_port.Eval(context).tolist()))[:, None],
            autonomous=self._autonomous_port.Eval(context)[:, None],
            confidence=self._confidence_port.Eval(context),
            pose=further.get("pose", np.empty(0))[:, None],
            clearance=further.get("clearance", np.full(1, np.inf)),
        )
        made = self._made_in(context)
        before = _unpacked(context.get_discrete_state(self._memory_index).value(), made.layout)
        with np.errstate(invalid="ignore"):
            weight, command, after = made.rule.step(before, inputs)
        output.set_value(_Shared(_Step(weight.item(), command[:, 0].tolist(), after)))

    def _calc_logged(self, name: str, context: Context, output: BasicVector) -> None:
        output[0] = self.state_after(context)[name].item()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._memory_index, self._packed(self.state_after(context)))

    def _packed(self, state: State) -> NDArray[np.float64]:
        """The state of a rule as a vector of the size of this system's state."""
        values = np.concatenate([np.empty(0), *(state[name].ravel() for name in sorted(state))])
        if len(values) > self._size:
            expected = f"must have a state of at most {self._size} numbers"
            raise InputError(type(self).__name__, "rule", expected, len(values))
        return np.concatenate([values, np.zeros(self._size - len(values))])


def _unpacked(values: NDArray[np.float64], like: State) -> State:
    """The state of a rule, with the shapes and types of ``like``."""
    state, begin = {}, 0
    for name, value in sorted(like.items()):
        own = values[begin : begin + value.size].reshape(value.shape)
        state[name], begin = own.astype(value.dtype), begin + value.size
    return state


class _Made(NamedTuple):
    rule: ArbitrationRule
    layout: State
    """The state before the first step of one trial, which has the shapes and types of all later ones."""

    @classmethod
    def of(cls, rule: ArbitrationRule) -> _Made:
        return cls(rule, rule.initial_state(1))


class _Step(NamedTuple):
    weight: float
    command: Sequence[float]
    after: State


@dataclasses.dataclass(frozen=True, slots=True)
class _Shared(Generic[T]):
    """Content that nobody writes to, so that all Contexts can share it: Drake copies values often."""

    content: T

    def __deepcopy__(self, memo: dict[int, object]) -> _Shared[T]:
        return self
