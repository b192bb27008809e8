"""Functions with which one formula computes numbers or arrays of them.

A formula takes `FLOATS` for single numbers, where numpy would be ten times slower, and `ARRAYS` for arrays.
It has no branches that differ from trial to trial: both results of a condition are computed, and ``where``
chooses.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Real = Any
"""A float or an array of them."""
Reals = Sequence[Real] | NDArray[Any]
"""Several of them, such as the elements of a command; for arrays also one array with them as its rows."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Elementwise:
    """The functions that differ between numbers and arrays, named as in numpy.

    Attributes:
        remainder: IEEE 754 remainder of a division, as `math.remainder`.
        largest: The largest of several numbers or, element by element, arrays.
        all, any: Of an array of conditions, or of one condition: whether a case can be left out.
    """

    where: Callable[[Any, Real, Real], Real]
    minimum: Callable[[Real, Real], Real]
    maximum: Callable[[Real, Real], Real]
    hypot: Callable[[Real, Real], Real]
    sin: Callable[[Real], Real]
    cos: Callable[[Real], Real]
    arctan2: Callable[[Real, Real], Real]
    copysign: Callable[[Real, Real], Real]
    isfinite: Callable[[Real], Any]
    remainder: Callable[[Real, Real], Real]
    largest: Callable[[Iterable[Real]], Real]
    all: Callable[[Any], bool]
    any: Callable[[Any], bool]


FLOATS = Elementwise(
    where=lambda condition, a, b: a if condition else b,
    minimum=min,
    maximum=max,
    hypot=math.hypot,
    sin=math.sin,
    cos=math.cos,
    arctan2=math.atan2,
    copysign=math.copysign,
    isfinite=math.isfinite,
    remainder=math.remainder,
    largest=max,
    all=bool,
    any=bool,
)
ARRAYS = Elementwise(
    where=np.where,
    minimum=np.minimum,
    maximum=np.maximum,
    hypot=np.hypot,
    sin=np.sin,
    cos=np.cos,
    arctan2=np.arctan2,
    copysign=np.copysign,
    isfinite=np.isfinite,
    remainder=lambda x, y: x - y * np.rint(x / y),
    largest=lambda values: functools.reduce(np.maximum, values),
    all=np.all,
    any=np.any,
)
