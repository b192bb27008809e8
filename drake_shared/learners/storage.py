"""Files of learners: safetensors, with all that is not a tensor as one JSON object in its metadata."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from drake_shared.errors import InputError
from drake_shared.files import replacing
from drake_shared.learners.cnmp import CnmpLearner, CnmpModel, Layer
from drake_shared.learners.interface import Learner

FORMAT = "drake_shared.learner"
VERSION = 1
METADATA_KEY = "drake_shared"
LEARNERS = ("cnmp",)

Path = str | os.PathLike[str]
_NUMBERS = ("scale", "sigma_floor", "doubt_reach", "doubt_gain", "confidence_gain")
_ARRAYS = ("grid", "reference", "demonstrations", "weights")


def save_learner(learner: Learner, path: Path) -> None:
    """Writes a learner so that `load_learner` gives it back, the same bits; the file appears whole or not.

    Raises:
        InputError: The folder cannot be written to, or the learner is of a kind that has no file.
    """
    if not isinstance(learner, CnmpLearner):
        raise InputError(path, "learner", f"must be one of {', '.join(LEARNERS)}", type(learner).__name__)
    model = learner.model
    tensors: dict[str, NDArray[Any]] = {
        name: np.ascontiguousarray(getattr(model, name), dtype=np.float64) for name in _ARRAYS
    }
    for part, layers in (("encoder", model.encoder), ("decoder", model.decoder)):
        for index, (weights, bias) in enumerate(layers):
            tensors[f"{part}.{index}.weight"] = weights
            tensors[f"{part}.{index}.bias"] = bias
    description = {
        **model.metadata,
        "format": FORMAT,
        "version": VERSION,
        "learner": learner.name,
        "preset": model.preset,
        "duration": learner.duration,
        "architecture": {
            "harmonics": model.harmonics,
            "aggregation": model.aggregation,
            "encoder": [int(bias.size) for _, bias in model.encoder],
            "decoder": [int(bias.size) for _, bias in model.decoder],
        },
        **{name: float(getattr(model, name)) for name in _NUMBERS},
    }
    with replacing(path) as temporary:
        save_file(tensors, temporary, metadata={METADATA_KEY: json.dumps(description)})


def load_learner(path: Path) -> CnmpLearner:
    """Reads a learner.

    Raises:
        InputError: The file is missing, broken or cut short, of another format, of a version newer than known
            here, holds a learner that is not known, or weights that do not fit its architecture or are not
            finite.
    """
    description, tensors = _read(path)
    name = description.get("learner")
    if name not in LEARNERS:
        raise InputError(path, "learner", f"must be one of {', '.join(LEARNERS)}", repr(name))
    numbers = {field: _number(path, description, field) for field in _NUMBERS}
    harmonics, encoder_widths, aggregation, decoder_widths = _architecture(path, description)
    features = 1 + 2 * harmonics
    encoder = _layers(path, tensors, "encoder", [features + 2, *encoder_widths])
    decoder = _layers(path, tensors, "decoder", [encoder_widths[-1] + features, *decoder_widths])
    grid = _tensor(path, tensors, "grid", (None,))
    steps = len(grid)
    if steps < 2 or grid[0] != 0.0 or np.any(np.diff(grid) <= 0.0):
        raise InputError(path, "grid", "must increase from 0")
    demonstrations = _tensor(path, tensors, "demonstrations", (None, steps, 2))
    if not len(demonstrations):
        raise InputError(path, "demonstrations", "must hold at least one")
    model = CnmpModel(
        preset=str(description.get("preset")),
        encoder=encoder,
        aggregation=aggregation,
        decoder=decoder,
        harmonics=harmonics,
        grid=grid,
        reference=_tensor(path, tensors, "reference", (steps, 2)),
        demonstrations=demonstrations,
        weights=_tensor(path, tensors, "weights", (len(demonstrations),)),
        metadata=description,
        **numbers,
    )
    return CnmpLearner(model)


def _read(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    if not os.path.isfile(path):
        raise InputError(path, "", "must be a file that exists")
    try:
        with safe_open(path, framework="numpy") as file:
            text = (file.metadata() or {}).get(METADATA_KEY)
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError, ValueError, TypeError) as error:
        raise InputError(path, "", f"must be a whole safetensors file ({error})") from error
    try:
        description = json.loads(text or "null")
    except ValueError:
        description = None
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise InputError(path, "format", f"must be {FORMAT}: this is no learner of drake_shared")
    version = description.get("version")
    if not isinstance(version, int) or not 1 <= version <= VERSION:
        raise InputError(path, "version", f"must be at most {VERSION}, the newest known here", version)
    return description, tensors


def _number(path: Path, description: Mapping[str, Any], field: str) -> float:
    value = description.get(field)
    positive = field != "doubt_gain"
    good = isinstance(value, int | float) and np.isfinite(value) and (value > 0.0 or not positive)
    if not good or value is None or value < 0.0:
        raise InputError(path, field, "must be a finite number above 0", repr(value))
    return float(value)


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


def _layers(path: Path, tensors: Mapping[str, NDArray[Any]], part: str, widths: list[int]) -> list[Layer]:
    count = sum(name.startswith(f"{part}.") and name.endswith(".weight") for name in tensors)
    if count != len(widths) - 1:
        raise InputError(path, part, f"must have {len(widths) - 1} layers, as its architecture says", count)
    layers = []
    for index, (inputs, outputs) in enumerate(itertools.pairwise(widths)):
        weights = _tensor(path, tensors, f"{part}.{index}.weight", (inputs, outputs))
        bias = _tensor(path, tensors, f"{part}.{index}.bias", (outputs,))
        layers.append((weights.astype(np.float32), bias.astype(np.float32)))
    return layers


def _tensor(
    path: Path, tensors: Mapping[str, NDArray[Any]], name: str, shape: tuple[int | None, ...]
) -> NDArray[Any]:
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
