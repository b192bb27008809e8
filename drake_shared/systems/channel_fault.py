"""Channel faults: delay, jitter, loss, freezing and NaN."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from drake_shared.systems.discrete_update import DeclareDiscreteUpdate


class ChannelFault(LeafSystem):
    """Delays, loses, freezes or corrupts the samples of a vector.

    .. pydrake_system::

        name: ChannelFault
        input_ports:
        - sent
        - chance
        output_ports:
        - received

    Inputs:
        sent (size): One sample a period, which must be state of its sender.
        chance (3): Uniform samples over [0, 1), fresh ones each period, as from a RandomSource.

    Outputs:
        received (size): The newest sample that has arrived; zero before the first. Feeds through.

    A sample that arrives after a newer one is dropped. While nothing arrives, the last one is held.

    State:
        drawn (3): The uniform samples of this period: loss, jitter, NaN. The first sample is never lost.
        past (n, 1 + size): Arrival times of the last samples, in [s], and the samples, the newest first.
        held (size): The last sample received.

    Args:
        delay: Of every sample, in [s].
        jitter: Further delay, uniform from 0 to this, in [s].
        loss: Share of samples that are lost, from 0 to 1.
        freeze_time, freeze: Time from which nothing arrives, and for how long, in [s].
        nan: Share of steps in which NaN is received, from 0 to 1.
        size: Of the vector.
        period: Between samples, in [s].

    Raises:
        InputError: ``period`` is not positive and finite.
    """

    def __init__(
        self,
        *,
        delay: float = 0.0,
        jitter: float = 0.0,
        loss: float = 0.0,
        freeze_time: float = 0.0,
        freeze: float = 0.0,
        nan: float = 0.0,
        size: int = 2,
        period: float = 0.05,
    ) -> None:
        super().__init__()
        self.set_name("channel_fault")
        self._delay, self._jitter, self._loss, self._nan = delay, jitter, loss, nan
        # Times of steps are sums with rounding errors, which must not move one past a bound.
        self._slack = 1e-6 * period
        self._frozen = (freeze_time - self._slack, freeze_time + freeze - self._slack)
        self._shape = (int((delay + jitter) / period) + 1, 1 + size)
        self._sent_port = self.DeclareVectorInputPort("sent", size)
        self._chance_port = self.DeclareVectorInputPort("chance", 3)
        self._drawn_index = self.DeclareDiscreteState(np.array([1.0, 0.0, 1.0]))
        nothing = np.full(self._shape, math.inf)
        self._past_index = self.DeclareDiscreteState(nothing.ravel())
        self._held_index = self.DeclareDiscreteState(size)
        self.DeclareVectorOutputPort(
            "received",
            size,
            self._calc_received,
            {
                self.time_ticket(),
                self.xd_ticket(),
                self.input_port_ticket(self._sent_port.get_index()),
            },
        )
        DeclareDiscreteUpdate(self, period=period, update=self._update)

    def _now(self, context: Context) -> np.ndarray:
        """Shape (n + 1, 1 + size): arrival time and sample, the one sent now before those of the past."""
        lost, late, _ = context.get_discrete_state(self._drawn_index).value().tolist()
        arrival = context.get_time() + self._delay + late * self._jitter if lost >= self._loss else math.inf
        past = context.get_discrete_state(self._past_index).value().reshape(self._shape)
        return np.vstack(([arrival, *self._sent_port.Eval(context).tolist()], past))

    def _arrived(self, context: Context, samples: np.ndarray) -> np.ndarray:
        """Shape (size,): the newest sample that has arrived, before it is corrupted."""
        now = context.get_time()
        if not self._frozen[0] <= now < self._frozen[1]:
            arrived = np.flatnonzero(samples[:, 0] <= now + self._slack)
            if arrived.size:
                return samples[arrived[0], 1:]
        held: np.ndarray = context.get_discrete_state(self._held_index).value()
        return held

    def _calc_received(self, context: Context, output: BasicVector) -> None:
        if context.get_discrete_state(self._drawn_index)[2] < self._nan:
            output.set_value(np.full(output.size(), math.nan))
        else:
            output.set_value(self._arrived(context, self._now(context)))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        samples = self._now(context)
        state.set_value(self._held_index, self._arrived(context, samples))
        state.set_value(self._past_index, samples[: self._shape[0]].ravel())
        state.set_value(self._drawn_index, self._chance_port.Eval(context))
