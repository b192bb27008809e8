"""The course of a training: learning rate, least standard deviation, and when it ends."""

from __future__ import annotations

import math
import time

from drake_shared.learners.cnmp.parameters import TrainingParameters

WARM_UP = 0.1
"""Share of a one-cycle schedule in which the learning rate rises."""
CHECKS = 50
"""Number of times in a training that the loss is checked for improvement."""
MIN_IMPROVEMENT = 0.02
"""In nats per point."""
COOL_DOWN = 0.2
"""Share of the plan that is left to a training that is cut short, for the learning rate to fall."""


class Schedule:
    """The course of one training.

    Attributes:
        planned: Iterations at the beginning; with a loss threshold their limit.
        total: Iterations after which the training ends, as planned now.

    Args:
        parameters: Of the training.
        planned: Iterations.
        deadline: By `time.perf_counter`, if any; the plan is cut if it would be missed.
    """

    def __init__(self, parameters: TrainingParameters, *, planned: int, deadline: float | None) -> None:
        self._parameters = parameters
        self._deadline = deadline
        self._start = time.perf_counter()
        self._best, self._best_at = math.inf, 0
        self.planned = self.total = planned

    def cycle(self, iteration: int) -> tuple[bool, float]:
        """Whether a cycle after the first begins, and the share of the present one that is done."""
        begin, length = 0, self._parameters.cycle or self.total
        while iteration >= begin + length:
            begin, length = begin + length, 2 * length
        return iteration == begin > 0, (iteration - begin) / min(length, self.total - begin)

    def learning_rate(self, done: float) -> float:
        """The learning rate after a share of a cycle."""
        peak = self._parameters.learning_rate
        if self._parameters.schedule == "constant":
            return peak
        if done < WARM_UP:
            return peak * (0.05 + 0.95 * done / WARM_UP)
        return peak * (0.5 * (1.0 + math.cos(math.pi * (done - WARM_UP) / (1.0 - WARM_UP))) + 1e-4)

    def beta(self, done: float) -> float:
        """Of the beta-NLL loss after a share of a cycle."""
        return 0.0 if done >= 1.0 - self._parameters.plain_share else self._parameters.beta

    def floor_fallen(self, done: float) -> float:
        """How far the least standard deviation has fallen, from 0 to 1, after a share of a cycle."""
        p = self._parameters
        return 1.0 if p.first_floor == 0.0 else min(done / p.floor_share, 1.0)

    def keep_time(self, done: int) -> None:
        """Cuts the plan if more than 2% of it would be left at the deadline, after ``done`` iterations."""
        if self._deadline is not None:
            now = time.perf_counter()
            left = int((self._deadline - now) * done / (now - self._start))
            if done + left < 0.98 * self.total:
                self.total = done + max(left, 0)

    def is_check(self, done: int) -> bool:
        """Whether `check` is due."""
        return self._parameters.patience > 0.0 and done % max(1, self.planned // CHECKS) == 0

    def check(self, done: int, loss: float) -> None:
        """Cuts the plan if the loss has not improved for long enough.

        Args:
            done: Iterations.
            loss: Of all learners, in nats per point.
        """
        if loss < self._best - MIN_IMPROVEMENT:
            self._best, self._best_at = loss, done
        elif done - self._best_at > self._parameters.patience * self.planned:
            self.total = min(self.total, done + int(COOL_DOWN * self.planned))
            self._best_at = self.planned
