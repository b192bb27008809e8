"""Reading what a learner's file says, with one line for what is wrong."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError

Path = str | os.PathLike[str]
Tensors = Mapping[str, NDArray[Any]]


def number_of(path: Path, description: Mapping[str, Any], field: str, *, may_be_zero: bool = False) -> float:
    """A number of the description.

    Raises:
        InputError: It is missing, not finite or not above 0.
    """
    value = description.get(field)
    good = isinstance(value, int | float) and np.isfinite(value) and (value > 0.0 or may_be_zero)
    if not good or value is None or value < 0.0:
        raise InputError(path, field, "must be a finite number above 0", repr(value))
    return float(value)


def tensor_of(path: Path, tensors: Tensors, name: str, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """A tensor of ``shape``, in which None stands for any size.

    Raises:
        InputError: It is missing, has another shape, or is not finite.
    """
    if name not in tensors:
        raise InputError(path, name, "must be among the tensors", ", ".join(sorted(tensors)) or "none")
    tensor = tensors[name]
    fits = len(tensor.shape) == len(shape) and all(
        want in (None, have) for want, have in zip(shape, tensor.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if size is None else str(size) for size in shape)
        raise InputError(path, name, f"must have shape ({wanted})", tensor.shape)
    if tensor.dtype.kind != "f" or not np.isfinite(tensor).all():
        raise InputError(path, name, "must hold finite numbers")
    return tensor
