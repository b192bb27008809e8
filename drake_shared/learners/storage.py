"""Files of learners: safetensors, with all that is not a tensor as one JSON object in its metadata."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing, sha256_of
from drake_shared.learners.base import Learner
from drake_shared.learners.registry import find_learner

FORMAT = "drake_shared.learner"
VERSION = 1
METADATA_KEY = "drake_shared"
# Where a learner was read from is no part of it.
_OF_THE_FILE = ("id", "file")


def save_learner(learner: Learner, path: str | os.PathLike[str]) -> None:
    """Writes a learner so that `load_learner` gives it back, the same bits; the file appears whole or not.

    Raises:
        InputError: The folder cannot be written to, or the learner is of a kind that has no file.
    """
    to_file = getattr(learner, "to_file", None)
    if to_file is None:
        raise InputError(path, "learner", "must be of a kind that has a file", type(learner).__name__)
    tensors, description = to_file()
    description = {name: value for name, value in description.items() if name not in _OF_THE_FILE}
    description |= {"format": FORMAT, "version": VERSION, "learner": learner.name}
    description["confidence_gain"] = float(learner.confidence_gain)
    with replacing(path) as temporary:
        # Not by save_file, which would say of a full disk what nobody else does.
        temporary.write_bytes(
            save(
                {name: np.ascontiguousarray(tensor) for name, tensor in tensors.items()},
                metadata={METADATA_KEY: json.dumps(description)},
            )
        )


def load_learner(path: str | os.PathLike[str]) -> Learner:
    """Reads a learner. Its metadata then also say which file it is: "file", and "id" by its content.

    Raises:
        InputError: The file is missing, broken or cut short, of another format, of a version newer than known
            here, holds a learner that is not known, or weights that do not fit its architecture or are not
            finite.
    """
    description, tensors = _read(path)
    kind = find_learner(str(description.get("learner")), source=path)
    description |= {"id": learner_id(path), "file": os.fspath(path)}
    return kind.from_file(path, tensors, description)


def learner_id(path: str | os.PathLike[str]) -> str:
    """What logs call the learner of a file by: the first 16 hexadecimal digits of the content's SHA-256."""
    return sha256_of(path)[:16]


def read_description(path: str | os.PathLike[str]) -> dict[str, Any]:
    """All that a learner's file holds besides tensors; its learner need not be known here.

    Raises:
        InputError: The file is missing, broken, of another format or of a version newer than known here.
    """
    return _read(path)[0]


def _read(path: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
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
