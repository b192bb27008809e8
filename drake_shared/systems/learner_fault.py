"""A learner that answers late, or says nothing of use."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, State

from drake_shared.robots import DiffDrive, Robot
from drake_shared.systems.intention import Intention, empty_intention


class LearnerFault(LeafSystem):
    """Passes what the estimator says on late, or NaN in its place.

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
        intention: :class:`~drake_shared.systems.intention_estimator.Intention`.
        confidence (1): c_f, in [0, 1].
        chance (1): Samples spread evenly over [0, 1), fresh ones each period, as from a RandomSource.

    Outputs:
        late_intention, late_confidence: The newest that have arrived, or NaN; NaN and 0 before the first.
            Feed through where nothing is late.

    State:
        past: What was said, and when, of the steps that are still on their way.
        drawn (1): What chance says of this step. The first is never NaN.

    Args:
        delay: In [s]; rounded up to whole periods.
        nan: Share of steps in which NaN arrives.
        robot: States the size of a position; the Pioneer if None.
        period: Of the control step, in [s].
    """

    def __init__(
        self, *, delay: float = 0.0, nan: float = 0.0, robot: Robot | None = None, period: float = 0.05
    ) -> None:
        super().__init__()
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
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _step(self, context: Context) -> int:
        return round(context.get_time() / self._period)

    def _is_nan(self, context: Context) -> bool:
        return context.get_discrete_state(self._drawn_index)[0] < self._nan

    def _arrived(self, context: Context) -> tuple[Intention, float]:
        # By the time it was said, not by its place: the update of this very step, which comes between the log
        # and the plant, must not change what both are given.
        past: _Past = context.get_abstract_state(self._past_index).get_value()
        due = self._step(context) - self._steps
        for step, intention, confidence in reversed(past.said):
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
        said = (
            self._step(context),
            self._intention_port.Eval(context),
            self._confidence_port.Eval(context)[0],
        )
        kept = past.said[-self._steps :]
        state.get_mutable_abstract_state(self._past_index).set_value(_Past(said=(*kept, said)))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._drawn_index, self._chance_port.Eval(context))


@dataclasses.dataclass(frozen=True)
class _Past:
    """Steps with the intention and the confidence of each, the newest last."""

    said: tuple[tuple[int, Intention, float], ...] = ()

    def __deepcopy__(self, memo: dict) -> _Past:
        # Frozen, and Drake copies abstract state in every update.
        return self
