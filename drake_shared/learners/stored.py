"""Base classes of learners: dataclasses whose fields are what a file holds."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self, get_type_hints

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drake_shared.common.arrays import path_at, read_only
from drake_shared.common.errors import InputError
from drake_shared.learners.base import Array, Prediction, check_query
from drake_shared.learners.fields import Content, FieldType, Number, Tensor, Tensors, Text
from drake_shared.learners.ood_variance import OodVariance

# Fields of a description that are not metadata: `save_learner` derives them.
_DERIVED = ("format", "version", "learner", "duration", "architecture")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class StoredLearner:
    """A learner whose annotated fields are written to files; see `drake_shared.learners.fields`.

    Attributes:
        name: Under which it is registered.
        preset: By which it was trained.
        confidence_gain: K of eq. (1), in [1/m^2].
        metadata: See `drake_shared.learners.Learner`.
    """

    name: ClassVar[str]
    preset: Annotated[str, Text()] = "default"
    confidence_gain: Annotated[float, Number()] = 1.0
    metadata: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, kind in _fields_of(type(self)).items():
            if isinstance(kind, Tensor):
                object.__setattr__(self, name, read_only(getattr(self, name)))

    def __repr__(self) -> str:
        """Without arrays, which fill pages."""
        scenario = self.metadata.get("scenario")
        return f"{type(self).__name__}({scenario!r}, {self.preset!r}, K={self.confidence_gain:.4g})"

    def to_file(self) -> tuple[Tensors, dict[str, Any]]:
        """Tensors and JSON-serializable description of a file; see `drake_shared.learners.save_learner`."""
        tensors: Tensors = {}
        description = dict(self.metadata)
        for name, kind in _fields_of(type(self)).items():
            own, described = kind.write(name, getattr(self, name))
            tensors |= own
            description |= described
        return tensors, description

    @classmethod
    def from_file(
        cls, path: str | os.PathLike[str], tensors: Mapping[str, NDArray[Any]], description: Mapping[str, Any]
    ) -> Self:
        """The learner of a file; see `drake_shared.learners.load_learner`.

        Raises:
            InputError: Something is missing or invalid.
        """
        return cls.read(Content(path=path, tensors=tensors, description=description))

    @classmethod
    def read(cls, content: Content) -> Self:
        """The learner of a file's content; raises as `from_file`."""
        known = {*_fields_of(cls), *_DERIVED}
        metadata = {name: value for name, value in content.description.items() if name not in known}
        return cls(**cls._read(content), metadata=metadata)

    @classmethod
    def _read(cls, content: Content) -> dict[str, Any]:
        """The values of the fields."""
        return {name: kind.read(name, content) for name, kind in _fields_of(cls).items()}


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class GridLearner(StoredLearner):
    """A learner that keeps its demonstrations on a grid of times.

    Attributes:
        grid: Shape (N,), evenly spaced from 0, in [s].
        demonstrations: Shape (m, N, D), in [m].
    """

    grid: Annotated[Array, Tensor("N")]
    demonstrations: Annotated[Array, Tensor("m", "N", "D")]

    @property
    def duration(self) -> float:
        """T, in [s]."""
        return float(self.grid[-1])

    @cached_property
    def position_size(self) -> int:
        """D."""
        return int(self.demonstrations.shape[2])

    @classmethod
    def _read(cls, content: Content) -> dict[str, Any]:
        values = super()._read(content)
        grid = values["grid"]
        # `check_learner` tests the rest.
        if not np.allclose(grid, np.linspace(0.0, grid[-1], len(grid))):
            raise InputError(content.path, "grid", "must increase from 0 in even steps")
        return values


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class RegressionLearner(GridLearner):
    """A learner that predicts offsets from a reference path, in units of a scale.

    Without observations it predicts the demonstrations' own weighted mean and their variance about it. Far
    from all demonstrations `OodVariance` adds to the variance.

    Attributes:
        reference: Shape (N, D), the path from which normalized positions are counted, in [m].
        weights: Shape (m,), sampling probabilities of the demonstrations.
        scale: Unit of normalized positions, in [m].
        sigma_floor: Least standard deviation.
        sigma_scale: Factor on all standard deviations, found on held-out data; 1 after training.
        doubt_reach, doubt_gain: ``reach`` and ``gain`` of `OodVariance`.
    """

    reference: Annotated[Array, Tensor("N", "D")]
    weights: Annotated[Array, Tensor("m")]
    scale: Annotated[float, Number()]
    sigma_floor: Annotated[float, Number()]
    sigma_scale: Annotated[float, Number()] = 1.0
    doubt_reach: Annotated[float, Number()]
    doubt_gain: Annotated[float, Number(may_be_zero=True)]

    def scaled(self, factor: float, *, confidence_gain: float | None = None) -> Self:
        """A copy with all standard deviations times ``factor``, and K of its own if given."""
        gain = self.confidence_gain if confidence_gain is None else confidence_gain
        return dataclasses.replace(self, sigma_scale=self.sigma_scale * factor, confidence_gain=gain)

    def predict(self, times: ArrayLike, positions: ArrayLike, query_times: ArrayLike) -> Prediction:
        """Mean (Q, D) in [m] and variance (Q, D) in [m^2] at ``query_times`` (Q,); see `Learner.predict`."""
        seen_times, seen, queries = check_query(times, positions, query_times, self.position_size)
        if len(seen_times):
            return self._condition(seen_times, seen, queries)
        mean, variance = self._prior
        return path_at(mean, self.grid, queries), path_at(variance, self.grid, queries)

    def _condition(self, times: Array, positions: Array, queries: Array) -> Prediction:
        """`predict` for at least one observation."""
        raise NotImplementedError

    @property
    def _floor(self) -> float:
        """The least standard deviation, in [m]."""
        return self.sigma_floor

    @cached_property
    def _prior(self) -> Prediction:
        """Mean and variance (N, D) of the demonstrations themselves."""
        mean = (self.weights[:, None, None] * self.demonstrations).sum(axis=0)
        # Scores say what is desirable, not what a driver may want: all demonstrations count alike.
        variance = np.square(self.demonstrations - mean).mean(axis=0) + self._floor**2
        return mean, variance * self.sigma_scale**2

    @cached_property
    def _ood_variance(self) -> OodVariance:
        return OodVariance(
            grid=self.grid,
            demonstrations=self.demonstrations,
            reach=self.doubt_reach,
            gain=self.doubt_gain,
        )


def _fields_of(kind: type[StoredLearner]) -> dict[str, FieldType]:
    """The fields of a class that files hold."""
    hints = get_type_hints(kind, include_extras=True)
    return {
        field.name: hints[field.name].__metadata__[0]
        for field in dataclasses.fields(kind)
        if hasattr(hints[field.name], "__metadata__")
    }
