"""Demonstrations as data: positions of the robot over time, their scores and where they come from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.arrays import read_only
from drake_shared.common.errors import InputError


@dataclass(frozen=True, kw_only=True, eq=False)
class Demonstration:
    """One execution of the task.

    Attributes:
        times: Shape (n,), in [s], increasing, n >= 2.
        positions: Shape (n, D), in [m], world frame, D >= 1.
        yaws: Shape (n,), in [rad], or None if unknown.
        position_names: D names of the coordinates, which are columns of files. Default: "x", "y", "z" up to
            D = 3, and "p0", "p1", ... beyond.
        score: The higher the better; None if not evaluated.
        provenance: JSON-serializable record of where it comes from: what `provenance_of_trial` keeps of a
            trial, and the name ("file"), content ("sha256") and kind ("kind") of a file.
        source: What holds it, for error messages.

    Raises:
        InputError: An array has another shape or is not finite, or times do not increase.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    yaws: NDArray[np.float64] | None = None
    position_names: tuple[str, ...] = ()
    score: float | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    source: str = "demonstration"

    def __post_init__(self) -> None:
        times, positions = read_only(self.times), read_only(self.positions)
        yaws = None if self.yaws is None else read_only(self.yaws)
        if times.ndim != 1 or len(times) < 2:
            raise InputError(self.source, "t", "must hold at least 2 points", f"shape {times.shape}")
        if positions.ndim != 2 or len(positions) != len(times) or not positions.shape[1]:
            raise InputError(self.source, "positions", f"must have shape ({len(times)}, D)", positions.shape)
        names = tuple(self.position_names) or default_names(positions.shape[1])
        if len(set(names)) != positions.shape[1]:
            expected = f"must be {positions.shape[1]} different names"
            raise InputError(self.source, "position_names", expected, names)
        columns = {"t": times, **dict(zip(names, positions.T, strict=True))}
        if yaws is not None:
            if yaws.shape != times.shape:
                raise InputError(self.source, "yaw", f"must have shape {times.shape}", yaws.shape)
            columns["yaw"] = yaws
        for name, values in columns.items():
            bad = np.flatnonzero(~np.isfinite(values))
            if len(bad):
                raise InputError(self.source, name, "must be finite", f"{values[bad[0]]} at point {bad[0]}")
        stalled = np.flatnonzero(np.diff(times) <= 0.0)
        if len(stalled):
            i = int(stalled[0])
            raise InputError(
                self.source, "t", "must increase", f"{times[i]:g} then {times[i + 1]:g} at point {i + 1}"
            )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "yaws", yaws)
        object.__setattr__(self, "position_names", names)

    def __len__(self) -> int:
        return len(self.times)


@dataclass(frozen=True, kw_only=True, eq=False)
class Demonstrations:
    """The demonstrations of one task.

    Attributes:
        items: At least one demonstration; all have the same coordinates.
        metadata: What their files state of them all, such as ``{"scenario": NAME}``.
        source: What holds them, for error messages.

    Raises:
        InputError: There are none, or their coordinates differ.
    """

    items: tuple[Demonstration, ...]
    metadata: Mapping[str, Any] = field(default_factory=dict)
    source: str = "demonstrations"

    def __post_init__(self) -> None:
        object.__setattr__(self, "items", tuple(self.items))
        if not self.items:
            raise InputError(self.source, "", "must hold at least one demonstration")
        for item in self.items:
            if item.position_names != self.position_names:
                expected = f"must have the coordinates {', '.join(self.position_names)}"
                raise InputError(item.source, "positions", expected, ", ".join(item.position_names))

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Demonstration]:
        return iter(self.items)

    def __getitem__(self, index: int) -> Demonstration:
        return self.items[index]

    @property
    def scenario(self) -> str | None:
        """Name of the scenario they were made in, or None if unknown."""
        return self.metadata.get("scenario")

    @property
    def scores(self) -> NDArray[np.float64] | None:
        """Shape (m,), or None unless every demonstration has one."""
        scores = [item.score for item in self.items if item.score is not None]
        return np.array(scores, dtype=float) if len(scores) == len(self.items) else None

    @property
    def position_names(self) -> tuple[str, ...]:
        """Names of the D coordinates of a position."""
        return self.items[0].position_names

    @property
    def extent(self) -> float:
        """Longest side of the axis-aligned box around all positions, in [m]."""
        low = np.min([item.positions.min(axis=0) for item in self.items], axis=0)
        high = np.max([item.positions.max(axis=0) for item in self.items], axis=0)
        return float((high - low).max())


def default_names(size: int) -> tuple[str, ...]:
    """Names of the coordinates of positions of ``size`` D whose names are unknown."""
    return tuple("xyz"[:size]) if size <= 3 else tuple(f"p{axis}" for axis in range(size))
