"""Delays or corrupts the learner's output."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, State

from drake_shared.robots import DiffDrive, Robot
from drake_shared.systems.discrete_update import DeclareDiscreteUpdate
from drake_shared.systems.intention import Intention, empty_intention


class LearnerFault(LeafSystem):
    """Delays the estimator's outputs, or replaces them by NaN.

    .. pydrake_system::

        name: LearnerFault
        input_ports:
        - intention
        - confidence
        - chance
        output_ports:
        - late_intention
        - late_confidence

    Inputs:
        intention: :class:`~drake_shared.systems.intention.Intention`.
        confidence (1): c_f, from 0 to 1.
        chance (1): Uniform samples over [0, 1), fresh ones each period, as from a RandomSource.

    Outputs:
        late_intention, late_confidence: The newest that have arrived, or NaN; NaN and 0 before the first.
            They feed through where there is no delay.

    State:
        past: Intentions and confidences that are not yet due, by step.
        drawn (1): The uniform sample of this step. The first step is never NaN.

    Args:
        delay: In [s]; rounded up to whole periods.
        nan: Share of steps with NaN, from 0 to 1.
        robot: States the size of a position; the Pioneer if None.
        period: Of the control step, in [s].
    """

    def __init__(
        self, *, delay: float = 0.0, nan: float = 0.0, robot: Robot | None = None, period: float = 0.05
    ) -> None:
        super().__init__()
        self.set_name("learner_fault")
        self._empty = empty_intention(len((robot or DiffDrive()).position_names))
        self._steps = math.ceil(delay / period - 1e-6)
        self._nan, self._period = nan, period
        self._intention_port = self.DeclareAbstractInputPort("intention", Value(self._empty))
        self._confidence_port = self.DeclareVectorInputPort("confidence", 1)
        self._chance_port = self.DeclareVectorInputPort("chance", 1)
        self._past_index = self.DeclareAbstractState(Value(_Past()))
        self._drawn_index = self.DeclareDiscreteState(np.ones(1))
        prerequisites = {self.time_ticket(), self.all_state_ticket()}
        if not self._steps:
            prerequisites |= {
                self.input_port_ticket(port.get_index())
                for port in (self._intention_port, self._confidence_port)
            }
        self.DeclareAbstractOutputPort(
            "late_intention", lambda: Value(self._empty), self._calc_intention, prerequisites
        )
        self.DeclareVectorOutputPort("late_confidence", 1, self._calc_confidence, prerequisites)
        if self._steps:
            self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._remember)
            self.DeclareForcedUnrestrictedUpdateEvent(self._remember)
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    def _step(self, context: Context) -> int:
        time: float = context.get_time()
        return round(time / self._period)

    def _is_nan(self, context: Context) -> bool:
        return bool(context.get_discrete_state(self._drawn_index)[0] < self._nan)

    def _arrived(self, context: Context) -> tuple[Intention, float]:
        # Selected by step, not by place: the update of this step, which runs between log and plant, must not
        # change what they receive.
        past: _Past = context.get_abstract_state(self._past_index).get_value()
        due = self._step(context) - self._steps
        for step, intention, confidence in reversed(past.items):
            if step <= due:
                return intention, confidence
        return self._empty, 0.0

    def _calc_intention(self, context: Context, output: Value) -> None:
        if self._is_nan(context):
            output.set_value(self._empty)
        else:
            now = self._arrived(context)[0] if self._steps else self._intention_port.Eval(context)
            output.set_value(now)

    def _calc_confidence(self, context: Context, output: BasicVector) -> None:
        if self._is_nan(context):
            output[0] = math.nan
        else:
            now = self._arrived(context)[1] if self._steps else self._confidence_port.Eval(context).item()
            output[0] = now

    def _remember(self, context: Context, state: State) -> None:
        past: _Past = context.get_abstract_state(self._past_index).get_value()
        item = (
            self._step(context),
            self._intention_port.Eval(context),
            self._confidence_port.Eval(context).item(),
        )
        kept = past.items[-self._steps :]
        state.get_mutable_abstract_state(self._past_index).set_value(_Past(items=(*kept, item)))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._drawn_index, self._chance_port.Eval(context))


@dataclasses.dataclass(frozen=True)
class _Past:
    """Step, intention and confidence of each item, the newest last."""

    items: tuple[tuple[int, Intention, float], ...] = ()

    def __deepcopy__(self, memo: dict[int, object]) -> _Past:
        # Immutable, and Drake copies abstract state in every update.
        return self
