"""How the fields of a learner are written to a file and read from it.

A field of a `drake_shared.learners.stored.StoredLearner` is annotated with one of these, for example
``reference: Annotated[Array, Tensor("N", "D")]``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError

Tensors = dict[str, NDArray[Any]]
Layer = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Weights (inputs, outputs) and biases (outputs,) of a layer of a network."""


@dataclass(frozen=True, kw_only=True)
class Content:
    """The content of a learner's file, or of the part of it that one of several learners has.

    Attributes:
        path: Of the file, for error messages.
        tensors: By name.
        description: The JSON object of the metadata.
        sizes: Sizes found so far, by their symbols.
    """

    path: str | os.PathLike[str]
    tensors: Mapping[str, NDArray[Any]]
    description: Mapping[str, Any]
    sizes: dict[str, int] = field(default_factory=dict)

    def tensor(self, name: str, shape: tuple[int | None, ...]) -> NDArray[Any]:
        """The tensor of that name; None in its shape stands for any size.

        Raises:
            InputError: It is missing, has another shape, or is not finite.
        """
        if name not in self.tensors:
            have = ", ".join(sorted(self.tensors)) or "none"
            raise InputError(self.path, name, "must be among the tensors", have)
        tensor = self.tensors[name]
        sizes = zip(shape, tensor.shape, strict=False)
        if tensor.ndim != len(shape) or any(size not in (None, got) for size, got in sizes):
            wanted = ", ".join("any" if size is None else str(size) for size in shape)
            raise InputError(self.path, name, f"must have shape ({wanted})", tensor.shape)
        if not tensor.size or tensor.dtype.kind != "f" or not np.isfinite(tensor).all():
            raise InputError(self.path, name, "must hold finite numbers, at least one")
        return tensor


class FieldType(Protocol):
    """Writes and reads one field."""

    def write(self, name: str, value: Any) -> tuple[Tensors, dict[str, Any]]:
        """Tensors and description of the field's value."""
        ...

    def read(self, name: str, content: Content) -> Any:
        """The field's value.

        Raises:
            InputError: It is missing or invalid.
        """
        ...


@dataclass(frozen=True)
class Number:
    """A finite number above 0, or 0 as well."""

    may_be_zero: bool = False

    def write(self, name: str, value: float) -> tuple[Tensors, dict[str, Any]]:
        """See `FieldType`."""
        return {}, {name: float(value)}

    def read(self, name: str, content: Content) -> float:
        """See `FieldType`."""
        value = content.description.get(name)
        valid = isinstance(value, int | float) and np.isfinite(value)
        if valid and value is not None and (value > 0.0 or (self.may_be_zero and value == 0.0)):
            return float(value)
        raise InputError(content.path, name, "must be a finite number above 0", repr(value))


class Text:
    """A string."""

    def write(self, name: str, value: str) -> tuple[Tensors, dict[str, Any]]:
        """See `FieldType`."""
        return {}, {name: value}

    def read(self, name: str, content: Content) -> str:
        """See `FieldType`."""
        return str(content.description.get(name))


class Tensor:
    """An array of float64.

    Args:
        shape: A size is a symbol, which stands for the same in all tensors of a learner, or a sum of numbers
            and multiples of symbols, such as "1 + 2K".
    """

    def __init__(self, *shape: str) -> None:
        self._shape = shape

    def write(self, name: str, value: NDArray[np.float64]) -> tuple[Tensors, dict[str, Any]]:
        """See `FieldType`."""
        return {name: np.ascontiguousarray(value, dtype=np.float64)}, {}

    def read(self, name: str, content: Content) -> NDArray[np.float64]:
        """See `FieldType`."""
        tensor = content.tensor(name, tuple(_size(size, content.sizes) for size in self._shape))
        symbols = zip(self._shape, tensor.shape, strict=True)
        content.sizes.update({size: got for size, got in symbols if size.isalpha()})
        return tensor.astype(np.float64, copy=False)


class Layers:
    """A stack of `Layer`, as float32."""

    def write(self, name: str, value: tuple[Layer, ...]) -> tuple[Tensors, dict[str, Any]]:
        """See `FieldType`."""
        tensors: Tensors = {}
        for index, (weights, bias) in enumerate(value):
            tensors |= {f"{name}.{index}.weight": weights, f"{name}.{index}.bias": bias}
        return tensors, {}

    def read(self, name: str, content: Content) -> tuple[Layer, ...]:
        """See `FieldType`."""
        layers: list[Layer] = []
        inputs = None
        while not layers or f"{name}.{len(layers)}.weight" in content.tensors:
            prefix = f"{name}.{len(layers)}"
            weights = content.tensor(f"{prefix}.weight", (inputs, None))
            inputs = weights.shape[1]
            bias = content.tensor(f"{prefix}.bias", (inputs,))
            layers.append((weights.astype(np.float32), bias.astype(np.float32)))
        return tuple(layers)


class Parts:
    """Several learners, such as the members of an ensemble; the field is named in the plural.

    Args:
        kind: Their class, a `drake_shared.learners.stored.StoredLearner`.
    """

    def __init__(self, kind: Any) -> None:
        self._kind = kind

    def write(self, name: str, value: tuple[Any, ...]) -> tuple[Tensors, dict[str, Any]]:
        """See `FieldType`."""
        tensors: Tensors = {}
        descriptions = []
        for index, part in enumerate(value):
            own, description = part.to_file()
            tensors |= {f"{name[:-1]}.{index}.{key}": tensor for key, tensor in own.items()}
            descriptions.append(description)
        return tensors, {name: descriptions}

    def read(self, name: str, content: Content) -> tuple[Any, ...]:
        """See `FieldType`."""
        descriptions = content.description.get(name)
        described = isinstance(descriptions, list) and all(isinstance(one, dict) for one in descriptions)
        if not described or not descriptions:
            raise InputError(content.path, name, f"must describe at least one {name[:-1]}")
        parts = []
        for index, description in enumerate(descriptions):
            prefix = f"{name[:-1]}.{index}."
            own = {
                key.removeprefix(prefix): tensor
                for key, tensor in content.tensors.items()
                if key.startswith(prefix)
            }
            parts.append(self._kind.read(replace(content, tensors=own, description=description, sizes={})))
        if any(not np.array_equal(part.grid, parts[0].grid) for part in parts):
            raise InputError(content.path, name, "must have the same grid")
        content.sizes["C"] = len(parts)
        return tuple(parts)


def _size(expression: str, sizes: Mapping[str, int]) -> int | None:
    """The value of a size; None if it is a symbol that is still unknown."""
    total = 0
    for number, symbol in re.findall(r"(\d*)([A-Za-z]*)", expression.replace(" ", "")):
        if symbol and symbol not in sizes:
            return None
        if number or symbol:
            total += int(number or 1) * (sizes[symbol] if symbol else 1)
    return total
