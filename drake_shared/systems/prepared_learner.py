"""A learner with its clock, its queries and checks of its predictions."""

from __future__ import annotations

import math
from bisect import bisect_right
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.demonstrations.progress_clock import TOLERANCE, ProgressClock
from drake_shared.learners import (
    Learner,
    Modes,
    MultimodalLearner,
    PrefixLearner,
    check_prediction,
    confidence,
)
from drake_shared.learners.base import Prediction
from drake_shared.learners.calibrated_confidence import CalibratedConfidence, CalibratedForecasts
from drake_shared.learners.route_modes import RouteModes
from drake_shared.robots import Robot, scaled_length

Array = NDArray[np.float64]

MOMENTS = 8
"""Number of moments, evenly spread over the task, at which the expected position is compared."""


class PreparedLearner:
    """A learner as the intention estimator uses it.

    Args:
        learner: Its metadata choose the clock ("clock": "progress" or "time"), the evidence ("evidence":
            "pose+command" lets the human's command count as an observation) and what the confidence is
            ("confidence_calibration": a probability, see `drake_shared.learners.calibrated_confidence`).
        robot: Gives D, the size of a position, and the scale of tolerances.
        use_human_command: False ignores the human's command whatever the metadata choose.

    Raises:
        InputError: The learner has demonstrations of another size of position.
    """

    def __init__(self, learner: Learner, robot: Robot, *, use_human_command: bool = True) -> None:
        self.learner = learner
        self.source = f"learner {learner.name!r}"
        self.grid = np.asarray(learner.grid)
        self.duration = float(self.grid[-1])
        self._times = self.grid.tolist()
        # The queries that are still to come, from each index on: views made once rather than in every step.
        self.later = [self.grid[first:] for first in range(len(self.grid))]
        size = self._size = len(robot.position_names)
        taught = learner.demonstrations
        if taught is not None and taught.shape[-1] != size:
            expected = f"must predict positions of size {size}, as {type(robot).__name__} has"
            raise InputError(f"learner {learner.name!r}", "", expected, taught.shape[-1])
        self.clock = None
        if learner.metadata.get("clock") == "progress" and taught is not None:
            self.clock = ProgressClock(self.grid, taught, tolerance=scaled_length(robot, TOLERANCE))
        self._multimodal = learner if isinstance(learner, MultimodalLearner) else None
        self._prefix = learner if isinstance(learner, PrefixLearner) else None
        self.uses_command = use_human_command and learner.metadata.get("evidence") == "pose+command"
        moments = np.linspace(0, len(self.grid) - 1, MOMENTS + 1).round().astype(int)[1:]
        # Indices of the coordinates at the moments in a flat array of a whole grid.
        self.moments = (size * moments[:, None] + np.arange(size)).ravel()
        calibration = CalibratedConfidence.from_learner(learner)
        self.calibrated = (
            None
            if calibration is None or taught is None
            else CalibratedForecasts(calibration, self.grid, taught)
        )
        self._unknown = np.full((len(self.grid), size), math.nan)

    def predict(
        self, times: list[float], positions: list[tuple[float, ...]], later: Array
    ) -> tuple[list[Prediction], Modes | None]:
        """Predictions after the first observation, after the first two, and so on.

        Args:
            times: Of the observations, in [s].
            positions: Positions (D,) of the observations, in [m].
            later: Shape (Q,), query times, in [s].

        Returns:
            Mean (Q, D), in [m], and variance (Q, D), in [m^2], of each prediction; the modes after all
            observations, if the learner predicts several.

        Raises:
            InputError: The last prediction, which stands for all, has another shape or a variance that is not
                positive, or shares memory with the first one.
        """
        seen_times, seen = np.array(times), np.array(positions)
        counts = range(1, len(times) + 1)
        modes = None
        if self._multimodal is not None:
            predict = self._multimodal.predict_modes
            every = [predict(seen_times[:n], seen[:n], later) for n in counts]
            predictions, modes = [(mean, variance) for mean, variance, _ in every], every[-1][2]
        elif self._prefix is not None:
            predictions = self._prefix.predict_prefixes(seen_times, seen, later)
        else:
            predictions = [self.learner.predict(seen_times[:n], seen[:n], later) for n in counts]
        mean, variance = predictions[-1]
        check_prediction(mean, variance, (len(later), self._size), source=self.source)
        if len(predictions) > 1 and np.may_share_memory(predictions[0][0], mean):
            raise InputError(self.source, "predict", "must return new arrays, not views of a buffer")
        return predictions, modes

    def confidence(self, variance: float, gain: float, path: Array, first: int) -> float:
        """c_f of eq. (1), or, if the learner's metadata hold a calibration, a probability.

        Args:
            variance: Mean variance, in [m^2].
            gain: K, in [1/m^2].
            path: Shape (Q, D), predicted from entry ``first`` of the grid on, in [m].
            first: Index of the grid.
        """
        if self.calibrated is None:
            return float(confidence(variance, gain))
        ratio = np.array([gain * variance])
        return float(self.calibrated(ratio, path[None], first, np.array([first]))[0])

    @cached_property
    def route_modes(self) -> RouteModes | None:
        """Splits predictions into routes; None if the demonstrations are unknown."""
        return None if self.learner.demonstrations is None else RouteModes(self.learner)

    def first_after(self, now: float) -> int:
        """Index of the first query later than ``now``, in [s]; the last index if there is none."""
        return min(bisect_right(self._times, now + 1e-9), len(self._times) - 1)

    def padded(self, later: Array) -> Array:
        """A whole grid (N, D) that ends with the rows ``later`` (Q, D) and holds NaN before them."""
        whole = self._unknown.copy()
        whole[len(whole) - len(later) :] = later
        return whole

    def __deepcopy__(self, memo: dict[int, object]) -> PreparedLearner:
        # A Context is cloned with its parameters; a learner never changes, so that one object serves all.
        return self
