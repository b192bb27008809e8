"""The value that travels from the estimator to the controller, the visualizer and some arbiters."""

from __future__ import annotations

import dataclasses
import math
import warnings

import numpy as np
from numpy.typing import NDArray

from drake_shared.learners import Modes


# Not frozen: that would double the time in which one is made, which happens in every step.
@dataclasses.dataclass(kw_only=True, eq=False)
class Intention:
    """The trajectory that the person is expected to follow; to be read only, since systems share it.

    Attributes:
        time: Time now on the clock of ``times``, in [s]: since the start of the trial, or the progress along
            the demonstrations.
        times: Shape (N,), grid of the predictions, in [s]; the same array at every step.
        mean: Shape (N, D), expected positions, in [m], world frame; NaN up to ``time``. If the learner
            predicts several modes, those of the mode that the driver follows.
        variance: Shape (N, D), in [m^2], within and between modes; NaN up to ``time``.
        first: Index of the first entry that is later than ``time`` (the last one at the end).
        modes: The modes of the prediction, from entry ``first`` on, if the learner predicts several.
    """

    time: float
    times: NDArray[np.float64]
    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    first: int
    modes: Modes | None = None

    def position_at(self, time: float) -> tuple[float, ...]:
        """Expected position (D,), in [m], world frame, at an absolute time on the clock of ``times``.

        Linear between the entries. A time before the first entry that is known gives the position of that
        entry; a time after the last one gives the last position: the robot is expected to stay there.

        Args:
            time: In [s]; an offset ``d`` from now is ``intention.time + d``.
        """
        times, mean = self.times, self.mean
        after = min(max(int(times.searchsorted(time)), self.first), len(times) - 1)
        end: list[float] = mean[after].tolist()
        end_time = times.item(after)
        if after == self.first or end_time <= time:
            return tuple(end)
        share = (end_time - time) / (end_time - times.item(after - 1))
        start = mean[after - 1].tolist()
        return tuple([x + share * (before - x) for x, before in zip(end, start, strict=True)])

    def position(self, time: float) -> tuple[float, ...]:
        """Former name of `position_at`."""
        warnings.warn("Intention.position is now position_at", DeprecationWarning, stacklevel=2)
        return self.position_at(time)


def empty_intention(size: int) -> Intention:
    """An intention without a prediction: one entry, with mean NaN and infinite variance.

    Args:
        size: D, size of a position.
    """
    return Intention(
        time=0.0,
        times=np.zeros(1),
        mean=np.full((1, size), math.nan),
        variance=np.full((1, size), math.inf),
        first=0,
    )
