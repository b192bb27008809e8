"""Tests whether learners fulfil their contract."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_shared.common.errors import InputError
from drake_shared.learners.base import Array, Learner, MultimodalLearner, PrefixLearner
from drake_shared.learners.no_learner import NoLearner

_ATTRIBUTES = ("name", "preset", "confidence_gain", "grid", "duration", "demonstrations", "metadata")
_CHOICES = {"clock": ("time", "progress"), "evidence": ("pose", "pose+command")}


def check_learner(learner: Learner, *, source: str | None = None) -> None:
    """Checks that an object is a `Learner` that can be relied on.

    It is called for learners that are trained or loaded, and costs a few predictions. A `NoLearner` passes.

    Args:
        learner: Any object.
        source: File or option that it comes from, for error messages; default: its name.

    Raises:
        InputError: An attribute is missing or invalid, K is not positive and finite, the grid does not
            increase from 0 to T, or a prediction along its demonstrations has another shape or type, is not
            finite, has a variance that is not positive, or changes in a later call. Names what is wrong.
    """
    if isinstance(learner, NoLearner):
        return
    source = source or f"learner {getattr(learner, 'name', type(learner).__name__)!r}"
    missing = [name for name in (*_ATTRIBUTES, "predict") if not hasattr(learner, name)]
    if missing:
        raise InputError(source, missing[0], "must be an attribute of a learner")
    gain = learner.confidence_gain
    if not (isinstance(gain, int | float | np.number) and math.isfinite(gain) and gain > 0.0):
        raise InputError(source, "confidence_gain", "must be positive and finite", gain)
    grid = np.asarray(learner.grid)
    increasing = grid.ndim == 1 and len(grid) > 1 and grid[0] == 0.0 and bool(np.all(np.diff(grid) > 0.0))
    if not increasing or not math.isfinite(grid[-1]) or grid[-1] != learner.duration:
        raise InputError(source, "grid", "must increase from 0 to the duration")
    _check_metadata(learner, source)
    data = learner.demonstrations
    is_known = isinstance(data, np.ndarray) and data.dtype.kind == "f" and data.ndim == 3 and len(data) > 0
    if data is not None and not (is_known and data.shape[1] == len(grid) and np.isfinite(data).all()):
        expected = f"must be a finite array of shape (m, {len(grid)}, D)"
        raise InputError(source, "demonstrations", expected, getattr(data, "shape", type(data).__name__))
    _check_predictions(learner, grid, np.zeros((1, len(grid), 2)) if data is None else data, source)


def check_prediction(mean: Array, variance: Array, shape: tuple[int, int], *, source: str) -> None:
    """Checks the shape and the variance of a prediction at run time; takes 1 us.

    Args:
        mean, variance: Returned by `Learner.predict`.
        shape: (Q, D).
        source: Name of the learner, for the error message.

    Raises:
        InputError: A shape is another, or a variance is 0 or less. NaN passes.
    """
    if mean.shape != shape or variance.shape != shape:
        got = f"{mean.shape} and {variance.shape}"
        raise InputError(source, "predict", f"must return mean and variance of shape {shape}", got)
    # Three times faster than the minimum itself.
    if variance.size and variance.item(variance.argmin()) <= 0.0:
        raise InputError(source, "predict", "must return a positive variance", variance.min())


def _check_metadata(learner: Learner, source: str) -> None:
    if not isinstance(learner.metadata, Mapping):
        raise InputError(source, "metadata", "must be a mapping", type(learner.metadata).__name__)
    for key, choices in _CHOICES.items():
        value = learner.metadata.get(key, choices[0])
        if value not in choices:
            raise InputError(source, f"metadata[{key!r}]", f"must be one of {', '.join(choices)}", value)
    if learner.metadata.get("clock") == "progress" and learner.demonstrations is None:
        raise InputError(source, "demonstrations", "must be known where the clock is 'progress'")


def _check_predictions(learner: Learner, grid: Array, data: Array, source: str) -> None:
    middle, late = len(grid) // 2, 3 * len(grid) // 4
    cases = [([0], grid[1:]), ([middle], grid[middle + 1 :]), ([len(grid) - 1], grid[-1:])]
    cases += [([], grid), ([middle, late], grid)]
    returned: list[tuple[Array, Array]] = []
    for steps, queries in cases:
        arguments = (grid[steps], data[0, steps], queries) if steps else (grid[:0], data[0, :0], queries)
        answer = _call(learner, "predict", arguments, source)
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise InputError(source, "predict", "must return mean and variance", type(answer).__name__)
        for name, values in zip(("mean", "variance"), answer, strict=True):
            if not isinstance(values, np.ndarray) or values.dtype != np.float64:
                got = getattr(values, "dtype", type(values).__name__)
                raise InputError(source, "predict", f"must return the {name} as a float64 array", got)
        mean, variance = answer
        check_prediction(mean, variance, (len(queries), data.shape[2]), source=source)
        if not (np.isfinite(mean).all() and np.isfinite(variance).all()):
            raise InputError(source, "predict", "must return finite numbers along the demonstrations")
        for earlier, copy in returned:
            if any(np.shares_memory(earlier, values) for values in answer):
                raise InputError(source, "predict", "must return new arrays, not views of a work buffer")
            if not np.array_equal(earlier, copy):
                raise InputError(source, "predict", "must not change what it returned before")
        if np.shares_memory(mean, variance) or any(np.shares_memory(values, data) for values in answer):
            raise InputError(source, "predict", "must return new arrays, not views of its data")
        returned += [(values, values.copy()) for values in answer]
        _check_capabilities(learner, arguments, answer, source)


def _check_capabilities(
    learner: Learner, arguments: tuple[Array, Array, Array], expected: tuple[Array, Array], source: str
) -> None:
    """The optional methods must agree with `predict`."""
    if isinstance(learner, PrefixLearner):
        prefixes = _call(learner, "predict_prefixes", arguments, source)
        same = len(prefixes) == len(arguments[0]) and (
            not prefixes or np.allclose(prefixes[-1], expected, rtol=1e-4, atol=1e-6)
        )
        if not same:
            raise InputError(source, "predict_prefixes", "must end with what predict returns")
    if isinstance(learner, MultimodalLearner):
        mean, variance, modes = _call(learner, "predict_modes", arguments, source)
        count = len(modes.probability)
        shape = (count, *expected[0].shape)
        if modes.mean.shape != shape or modes.variance.shape != shape or not 0 <= modes.aim < count:
            raise InputError(source, "predict_modes", f"must return modes of shape {shape}", modes.mean.shape)
        if not math.isclose(modes.probability.sum(), 1.0, abs_tol=1e-6) or modes.probability.min() < 0.0:
            expected_sum = "must return probabilities that sum to 1"
            raise InputError(source, "predict_modes", expected_sum, modes.probability)
        if not np.allclose((mean, variance), expected, rtol=1e-4, atol=1e-6):
            raise InputError(source, "predict_modes", "must return the mean and variance of predict")


def _call(learner: Any, method: str, arguments: tuple[Array, Array, Array], source: str) -> Any:
    try:
        return getattr(learner, method)(*arguments)
    except Exception as error:  # A learner of another package may fail in any way.
        times, positions, queries = (values.shape for values in arguments)
        expected = f"must take arrays of shapes {times}, {positions} and {queries}"
        raise InputError(source, method, f"{expected} ({type(error).__name__}: {error})") from error
