"""Demonstrations on one grid of times, with their normalization."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.arrays import path_at
from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations, demonstration_weights
from drake_shared.demonstrations.weights import DEFAULT_WIDTH

SPACING = 0.1
"""Of the grid, in [s]; half of it changes the human's weight by less than 0.005."""
MIN_STEPS, MAX_STEPS = 20, 2_000
"""Bounds on the grid, for tasks of less than 2 s or more than 200 s, which determine the spacing there."""

_SOURCE_FIELDS = (
    "kind",
    "file",
    "sha256",
    "operator",
    "route",
    "seed",
    "mode",
    "human_weight",
    "learner_id",
    "pauses",
    "time_factor",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Dataset:
    """Demonstrations on a grid.

    Attributes:
        grid: Shape (N,), from 0 to T, in [s].
        positions: Shape (m, N, D), in [m].
        weights: Shape (m,), Pd of Alg. 1, summing to 1.
        mean_path: Shape (N, D), the even mean of the demonstrations, in [m].
        spread: Root of the mean variance about it, over time and coordinates, in [m]; positive.
        extent: Longest side of the box around all positions, in [m].
        digest: SHA-256 of times, positions and scores, which identifies the data.
    """

    grid: NDArray[np.float64]
    positions: NDArray[np.float64]
    weights: NDArray[np.float64]
    mean_path: NDArray[np.float64]
    spread: float
    extent: float
    digest: str


def scale_of(positions: NDArray[np.float64]) -> tuple[float, float]:
    """Spread and extent, in [m], of demonstrations (m, N, D) on one grid, in [m]; see `Dataset`."""
    extent = float(np.ptp(positions, axis=(0, 1)).max())
    spread = float(np.sqrt(np.square(positions - positions.mean(axis=0)).mean()))
    # One demonstration, or equal ones, have no spread: a fiftieth of the extent then serves as the scale.
    # A robot that stands still has no extent either, and any length serves.
    return max(spread, 0.02 * extent) or 1e-3, extent


def make_dataset(
    demonstrations: Demonstrations,
    *,
    weighted: bool = True,
    duration: float | None = None,
    score_width: float = DEFAULT_WIDTH,
) -> Dataset:
    """Resamples demonstrations of any rate and length on one grid.

    Time counts from each demonstration's first point. One that ends before the longest stays where it ended,
    as a robot does at its goal.

    Args:
        demonstrations: At least one.
        weighted: Whether scores, where all have one, determine the weights; else they are even.
        duration: T, in [s]; default: that of the longest demonstration.
        score_width: Of `demonstration_weights`.

    Raises:
        InputError: A score is not finite, or ``duration`` or ``score_width`` is not positive and finite.
    """
    longest = max(float(item.times[-1] - item.times[0]) for item in demonstrations)
    length = longest if duration is None else float(duration)
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(demonstrations.source, "duration", "must be positive and finite", length)
    grid = make_grid(length)
    positions = np.stack([resample(item, grid) for item in demonstrations])
    mean_path = positions.mean(axis=0)
    spread, extent = scale_of(positions)
    return Dataset(
        grid=grid,
        positions=positions,
        weights=demonstration_weights(demonstrations, weighted=weighted, width=score_width),
        mean_path=mean_path,
        spread=spread,
        extent=extent,
        digest=_digest(demonstrations),
    )


def data_record(demonstrations: Demonstrations, dataset: Dataset) -> dict[str, Any]:
    """The part of a training record that identifies the data, for lineage.

    Returns:
        ``data_sha256``; ``demonstrations``, their number; ``sources``, of each what is known of file, sha256,
        kind, operator, route, seed, mode, human_weight and learner_id, and the changes of `align`.
    """
    return {
        "data_sha256": dataset.digest,
        "demonstrations": len(demonstrations),
        "sources": [_source(item.provenance) for item in demonstrations],
    }


def make_grid(duration: float) -> NDArray[np.float64]:
    """Times from 0 to ``duration`` in steps of about 0.1 s, shape (N,)."""
    steps = int(np.clip(round(duration / SPACING), MIN_STEPS, MAX_STEPS))
    return np.linspace(0.0, duration, steps + 1)


def resample(demonstration: Demonstration, grid: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions of a demonstration at ``grid`` (N,) after its first point, shape (N, D)."""
    times = demonstration.times - demonstration.times[0]
    return path_at(demonstration.positions, times, grid)


def normalization(dataset: Dataset, *, centred: bool) -> tuple[float, NDArray[np.float64]]:
    """Unit of normalized positions, in [m], and the path that they are counted from, shape (N, D)."""
    if centred:
        return dataset.spread, dataset.mean_path
    middle = 0.5 * (dataset.positions.min(axis=(0, 1)) + dataset.positions.max(axis=(0, 1)))
    return dataset.spread, np.broadcast_to(middle, dataset.mean_path.shape).copy()


def _source(provenance: Mapping[str, Any]) -> dict[str, Any]:
    known = {name: provenance[name] for name in _SOURCE_FIELDS if provenance.get(name) is not None}
    return {
        name: value.item() if isinstance(value, np.generic) else value
        for name, value in known.items()
        if isinstance(value, str | int | float | np.generic)
    }


def _digest(demonstrations: Demonstrations) -> str:
    digest = hashlib.sha256()
    for item in demonstrations:
        digest.update(np.ascontiguousarray(item.times).tobytes())
        digest.update(np.ascontiguousarray(item.positions).tobytes())
        digest.update(repr(item.score).encode())
    return digest.hexdigest()
