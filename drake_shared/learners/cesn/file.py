"""What the file of a context-based echo state network holds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.learners.cesn.model import CesnModel
from drake_shared.learners.metadata_fields import Path, Tensors, number_of, tensor_of

_NUMBERS = (
    "scale",
    "noise",
    "reach",
    "sigma_floor",
    "sigma_scale",
    "doubt_reach",
    "doubt_gain",
    "confidence_gain",
)
_ARRAYS = (
    "grid",
    "reference",
    "modes",
    "states",
    "hidden_weights",
    "hidden_bias",
    "readout",
    "log_variance",
    "demonstrations",
    "weights",
)


def cesn_to_file(model: CesnModel) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Tensors and description of ``model``."""
    tensors: dict[str, NDArray[Any]] = {
        name: np.ascontiguousarray(getattr(model, name), dtype=np.float64) for name in _ARRAYS
    }
    description = {
        **model.metadata,
        "preset": model.preset,
        "duration": float(model.grid[-1]),
        **{name: float(getattr(model, name)) for name in _NUMBERS},
    }
    return tensors, description


def cesn_from_file(path: Path, tensors: Tensors, description: Mapping[str, Any]) -> CesnModel:
    """The model of a file.

    Raises:
        InputError: Tensors do not fit each other, or something is missing or not finite.
    """
    numbers = {field: number_of(path, description, field) for field in _NUMBERS}
    grid = tensor_of(path, tensors, "grid", (None,))
    steps = len(grid)
    # Rows of the grid are found by its spacing.
    if steps < 2 or grid[0] != 0.0 or not np.allclose(np.diff(grid), grid[-1] / (steps - 1)) or grid[-1] <= 0:
        raise InputError(path, "grid", "must increase from 0 in even steps")
    demonstrations = tensor_of(path, tensors, "demonstrations", (None, steps, 2))
    if not len(demonstrations):
        raise InputError(path, "demonstrations", "must hold at least one")
    states = tensor_of(path, tensors, "states", (None, None))
    phases, directions = states.shape
    if phases < 2:
        raise InputError(path, "states", "must be at 2 phases or more", phases)
    modes = tensor_of(path, tensors, "modes", (phases, 2, None))
    codes = 2 * modes.shape[2]
    hidden_weights = tensor_of(path, tensors, "hidden_weights", (codes, None))
    hidden = hidden_weights.shape[1]
    return CesnModel(
        preset=str(description.get("preset")),
        grid=grid,
        reference=tensor_of(path, tensors, "reference", (steps, 2)),
        modes=modes,
        states=states,
        hidden_weights=hidden_weights,
        hidden_bias=tensor_of(path, tensors, "hidden_bias", (hidden,)),
        readout=tensor_of(path, tensors, "readout", (1 + codes + hidden, 4, directions)),
        log_variance=tensor_of(path, tensors, "log_variance", (2, phases)),
        demonstrations=demonstrations,
        weights=tensor_of(path, tensors, "weights", (len(demonstrations),)),
        metadata=description,
        **numbers,
    )
