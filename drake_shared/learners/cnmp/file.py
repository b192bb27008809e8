"""What the file of a CNMP holds."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.common.errors import InputError
from drake_shared.learners.cnmp.model import CnmpModel, Layer
from drake_shared.learners.metadata_fields import Path, Tensors, number_of, tensor_of

_NUMBERS = ("scale", "sigma_floor", "sigma_scale", "doubt_reach", "doubt_gain", "confidence_gain")
_ARRAYS = ("grid", "reference", "demonstrations", "weights")


def cnmp_to_file(model: CnmpModel) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Tensors and description of ``model``."""
    tensors: dict[str, NDArray[Any]] = {
        name: np.ascontiguousarray(getattr(model, name), dtype=np.float64) for name in _ARRAYS
    }
    for part, layers in (("encoder", model.encoder), ("decoder", model.decoder)):
        for index, (weights, bias) in enumerate(layers):
            tensors[f"{part}.{index}.weight"] = weights
            tensors[f"{part}.{index}.bias"] = bias
    description = {
        **model.metadata,
        "preset": model.preset,
        "duration": float(model.grid[-1]),
        "architecture": {
            "harmonics": model.harmonics,
            "aggregation": model.aggregation,
            "encoder": [int(bias.size) for _, bias in model.encoder],
            "decoder": [int(bias.size) for _, bias in model.decoder],
        },
        **{name: float(getattr(model, name)) for name in _NUMBERS},
    }
    return tensors, description


def cnmp_from_file(path: Path, tensors: Tensors, description: Mapping[str, Any]) -> CnmpModel:
    """The model of a file.

    Raises:
        InputError: Weights do not fit the architecture, or something is missing or not finite.
    """
    numbers = {
        field: number_of(path, description, field, may_be_zero=field == "doubt_gain") for field in _NUMBERS
    }
    harmonics, encoder_widths, aggregation, decoder_widths = _architecture(path, description)
    features = 1 + 2 * harmonics
    encoder = _layers(path, tensors, "encoder", [features + 2, *encoder_widths])
    decoder = _layers(path, tensors, "decoder", [encoder_widths[-1] + features, *decoder_widths])
    grid = tensor_of(path, tensors, "grid", (None,))
    steps = len(grid)
    if steps < 2 or grid[0] != 0.0 or np.any(np.diff(grid) <= 0.0):
        raise InputError(path, "grid", "must increase from 0")
    demonstrations = tensor_of(path, tensors, "demonstrations", (None, steps, 2))
    if not len(demonstrations):
        raise InputError(path, "demonstrations", "must hold at least one")
    return CnmpModel(
        preset=str(description.get("preset")),
        encoder=encoder,
        aggregation=aggregation,
        decoder=decoder,
        harmonics=harmonics,
        grid=grid,
        reference=tensor_of(path, tensors, "reference", (steps, 2)),
        demonstrations=demonstrations,
        weights=tensor_of(path, tensors, "weights", (len(demonstrations),)),
        metadata=description,
        **numbers,
    )


def cnmps_to_file(
    models: Sequence[CnmpModel], part: str
) -> tuple[dict[str, NDArray[Any]], list[dict[str, Any]]]:
    """Tensors of several models, each under the name of its ``part`` and number, and their descriptions."""
    tensors: dict[str, NDArray[Any]] = {}
    descriptions = []
    for index, model in enumerate(models):
        own, description = cnmp_to_file(model)
        tensors |= {f"{part}.{index}.{name}": tensor for name, tensor in own.items()}
        descriptions.append(description)
    return tensors, descriptions


def cnmps_from_file(
    path: Path, tensors: Tensors, description: Mapping[str, Any], part: str
) -> list[CnmpModel]:
    """The models that `cnmps_to_file` wrote as ``part``, described in the field of its plural.

    Raises:
        InputError: Something in one of them does not fit, there is none, or their grids differ.
    """
    field = f"{part}s"
    described = description.get(field)
    if not isinstance(described, list) or not described or not all(isinstance(d, dict) for d in described):
        raise InputError(path, field, f"must describe at least one {part}")
    models = []
    for index, one in enumerate(described):
        prefix = f"{part}.{index}."
        own = {name.removeprefix(prefix): t for name, t in tensors.items() if name.startswith(prefix)}
        models.append(cnmp_from_file(path, own, one))
    if any(not np.array_equal(model.grid, models[0].grid) for model in models):
        raise InputError(path, field, "must share one grid")
    return models


def _architecture(path: Path, description: Mapping[str, Any]) -> tuple[int, list[int], str, list[int]]:
    architecture = description.get("architecture")
    expected = "must give harmonics, aggregation, and the widths of encoder and of decoder (ending in 4)"
    if not isinstance(architecture, dict):
        raise InputError(path, "architecture", expected, repr(architecture))
    harmonics: Any = architecture.get("harmonics")
    encoder: Any = architecture.get("encoder")
    decoder: Any = architecture.get("decoder")
    good = isinstance(harmonics, int) and 0 <= harmonics <= 1000
    for widths in (encoder, decoder):
        good = good and isinstance(widths, list) and len(widths) >= 1
        good = good and all(isinstance(width, int) and width > 0 for width in widths)
    aggregation: Any = architecture.get("aggregation")
    good = good and (aggregation == "mean" or (aggregation == "bayesian" and encoder[-1] % 2 == 0))
    if not good or decoder[-1] != 4:
        raise InputError(path, "architecture", expected, architecture)
    return harmonics, encoder, aggregation, decoder


def _layers(path: Path, tensors: Tensors, part: str, widths: list[int]) -> list[Layer]:
    count = sum(name.startswith(f"{part}.") and name.endswith(".weight") for name in tensors)
    if count != len(widths) - 1:
        raise InputError(path, part, f"must have {len(widths) - 1} layers, as its architecture says", count)
    layers = []
    for index, (inputs, outputs) in enumerate(itertools.pairwise(widths)):
        weights = tensor_of(path, tensors, f"{part}.{index}.weight", (inputs, outputs))
        bias = tensor_of(path, tensors, f"{part}.{index}.bias", (outputs,))
        layers.append((weights.astype(np.float32), bias.astype(np.float32)))
    return layers
