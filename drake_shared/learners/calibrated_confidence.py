"""Confidence as a probability: that a forecast is on the route which the driver means."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.learners.base import Learner

Array = NDArray[np.float64]

CALIBRATION_KEY = "confidence_calibration"
"""Entry of a learner's metadata that holds what `CalibratedConfidence.to_json` returns."""
_NEW_WAY = 0.3
LEAST_RATIO = 1e-12
"""Smaller ratios K var count as this one."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class OpenWay:
    """A way past an obstacle that is open to a driver on a demonstrated path, and was never demonstrated.

    Attributes:
        until: Time on that path after which the driver has passed it by, in [s].
        alike: Number of demonstrations that came there alike, and all took the other way.
    """

    until: float
    alike: int

    @property
    def probability(self) -> float:
        """Of its not being taken: n / (n + 0.3), where it weighs 0.3 of a demonstration, as in `fusion`."""
        return self.alike / (self.alike + _NEW_WAY)


@dataclasses.dataclass(frozen=True, kw_only=True)
class CalibratedConfidence:
    """Turns the variance of a forecast into the probability that the forecast is correct.

    On routes that were demonstrated it follows from the ratio K var of eq. (1) of Amirshirzad et al. 2022 by
    isotonic regression on held-out trials (Zadrozny and Elkan 2002): linear between points. Beyond the last
    point it falls as 1 / ratio, as c_f does. No commands tell a demonstrated route from one that has not left
    it yet, so each way past an obstacle ahead that was never demonstrated takes its share of the probability.

    Attributes:
        log_ratio: Shape (k,), log10 of K var, increasing.
        probability: Shape (k,), from 0 to 1, not increasing.
        open_ways: Of each demonstration.
    """

    log_ratio: tuple[float, ...]
    probability: tuple[float, ...]
    open_ways: tuple[tuple[OpenWay, ...], ...]

    def to_json(self) -> dict[str, Any]:
        """What a learner's metadata hold."""
        return dataclasses.asdict(self)

    @classmethod
    def from_learner(cls, learner: Learner) -> CalibratedConfidence | None:
        """The calibration in a learner's metadata; None if there is none.

        Raises:
            InputError: It is not valid.
        """
        data = learner.metadata.get(CALIBRATION_KEY)
        if data is None:
            return None
        source = f"learner {learner.name!r}: {CALIBRATION_KEY}"
        taught = 0 if learner.demonstrations is None else len(learner.demonstrations)
        if not isinstance(data, Mapping):
            raise InputError(source, "", "must be fields with values", repr(data))
        ratio = _numbers(data.get("log_ratio"), source, "log_ratio")
        probability = _numbers(data.get("probability"), source, "probability")
        if len(ratio) != len(probability) or not all(a < b for a, b in itertools.pairwise(ratio)):
            raise InputError(source, "log_ratio", "must increase, and have the length of probability", ratio)
        if not all(0.0 <= value <= 1.0 for value in probability):
            raise InputError(source, "probability", "must be from 0 to 1", probability)
        ways = data.get("open_ways")
        try:
            found = tuple(
                tuple(OpenWay(until=float(way["until"]), alike=int(way["alike"])) for way in path)
                for path in ways or ()
            )
        except (TypeError, KeyError, ValueError) as error:
            raise InputError(source, "open_ways", "must be objects of until and alike", ways) from error
        if len(found) != taught or any(way.alike < 1 for path in found for way in path):
            raise InputError(source, "open_ways", f"must be those of each of {taught} demonstrations", ways)
        return cls(log_ratio=ratio, probability=probability, open_ways=found)

    def on_demonstrated(self, ratio: Array) -> Array:
        """The probability (n,) for each ratio K var (n,), if the driver is on a demonstrated route."""
        known = np.interp(np.log10(np.maximum(ratio, LEAST_RATIO)), self.log_ratio, self.probability)
        return np.asarray(
            known * np.minimum(10.0 ** self.log_ratio[-1] / np.maximum(ratio, LEAST_RATIO), 1.0)
        )


class CalibratedForecasts:
    """`CalibratedConfidence` of the forecasts of one learner.

    Args:
        calibration: Of the learner.
        grid: Shape (N,), in [s].
        demonstrations: Shape (m, N, D), in [m].
    """

    def __init__(self, calibration: CalibratedConfidence, grid: Array, demonstrations: Array) -> None:
        self._calibration = calibration
        self._demonstrations = demonstrations
        self._share = np.ones((len(demonstrations), len(grid)))
        for share, ways in zip(self._share, calibration.open_ways, strict=True):
            for way in ways:
                share[grid <= way.until] *= way.probability

    def __call__(self, ratio: Array, paths: Array, start: int, first: NDArray[np.int64]) -> Array:
        """The probability (n,) that each forecast is correct; NaN where its variance is.

        Args:
            ratio: Shape (n,), K var.
            paths: Shape (n, Q, D), predicted from entry ``start`` of the grid on, in [m].
            start: Index of the grid.
            first: Shape (n,), the first index of each forecast, at least ``start``.
        """
        to_come = np.arange(start, start + paths.shape[1]) >= first[:, None]
        apart = np.stack(
            [np.square(paths - path[start:]).sum(axis=-1) for path in self._demonstrations], axis=1
        )
        nearest = np.where(to_come[:, None], apart, 0.0).sum(axis=-1).argmin(axis=1)
        return np.asarray(self._calibration.on_demonstrated(ratio) * self._share[nearest, first])


def _numbers(values: Any, source: str, field: str) -> tuple[float, ...]:
    is_list = isinstance(values, Sequence) and not isinstance(values, str) and bool(values)
    if not is_list or not all(
        isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        for value in values
    ):
        raise InputError(source, field, "must be finite numbers", repr(values))
    return tuple(map(float, values))
