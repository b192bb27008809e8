"""Files of learners: safetensors, with a JSON object in their metadata."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from drake_shared.common.errors import DrakeSharedError, InputError
from drake_shared.common.files import models_directory, replacing, sha256_of
from drake_shared.common.suggestions import suggestion
from drake_shared.learners.base import Learner
from drake_shared.learners.check import check_learner
from drake_shared.learners.registry import find_learner

FORMAT = "drake_shared.learner"
VERSION = 1
METADATA_KEY = "drake_shared"
# `load_learner` sets these.
_OF_THE_FILE = ("id", "file")


def save_learner(learner: Learner, path: str | os.PathLike[str]) -> None:
    """Writes a learner so that `load_learner` returns it, bit for bit; the write is atomic.

    Raises:
        InputError: The folder is not writable, or the learner has no method ``to_file`` or one that fails;
            see `drake_shared.learners.registry`.
    """
    to_file = getattr(learner, "to_file", None)
    if to_file is None:
        raise InputError(path, "learner", "must have a method to_file", type(learner).__name__)
    try:
        tensors, description = to_file()
        description = {name: value for name, value in description.items() if name not in _OF_THE_FILE}
        description |= {
            "duration": float(learner.duration),
            "format": FORMAT,
            "version": VERSION,
            "learner": learner.name,
            "confidence_gain": float(learner.confidence_gain),
        }
        arrays = {name: np.ascontiguousarray(tensor) for name, tensor in tensors.items()}
        content = save(arrays, metadata={METADATA_KEY: json.dumps(description)})
    except Exception as error:  # A learner of another package may fail in any way.
        expected = (
            f"must return tensors and a JSON-serializable description ({type(error).__name__}: {error})"
        )
        raise InputError(f"learner {learner.name!r}", "to_file", expected) from error
    with replacing(path) as temporary:
        # save_file would report a full disk in its own way.
        temporary.write_bytes(content)


def load_learner(path: str | os.PathLike[str]) -> Learner:
    """Reads a learner, and sets "id" (a hash of its content) and "file" in its metadata.

    Args:
        path: A file, or the name of a shipped learner, such as "two_obstacles_paper". The name of a scenario
            stands for its learner of the preset "default".

    Raises:
        InputError: There is no such file or name; the file is broken, of another format or of a newer
            version; it holds an unknown kind of learner; its content is inconsistent; or the learner fails
            `check_learner`.
    """
    path = find_file(path)
    description, tensors = _read(path)
    kind = find_learner(str(description.get("learner")), source=path)
    origin = {"id": learner_id(path), "file": os.fspath(path)}
    try:
        learner: Learner = kind.from_file(path, tensors, description | origin)
    except DrakeSharedError:
        raise
    except Exception as error:  # A learner of another package may fail in any way.
        expected = f"cannot be read as {description['learner']!r} ({type(error).__name__}: {error})"
        raise InputError(path, "", expected) from error
    check_learner(learner, source=os.fspath(path))
    if any(learner.metadata.get(name) != value for name, value in origin.items()):
        # A learner of another package need not forward the description.
        try:
            learner.metadata = {**learner.metadata, **origin}  # type: ignore[misc]
        except AttributeError as error:
            expected = "must be an attribute that can be set, or contain id and file of the description"
            raise InputError(path, "metadata", expected) from error
    return learner


def shipped_learners() -> dict[str, Path]:
    """The files in models/learners by the names under which `load_learner` finds them."""
    return {file.stem: file for file in sorted((models_directory() / "learners").glob("*.safetensors"))}


def find_file(path: str | os.PathLike[str]) -> str | os.PathLike[str]:
    """The file of a learner that is given by its path or, if shipped, by its name; see `load_learner`.

    Raises:
        InputError: There is no such file or name.
    """
    if os.path.isfile(path):
        return path
    shipped = shipped_learners()
    name = os.fspath(path)
    if name in shipped or f"{name}_default" in shipped:
        return shipped.get(name) or shipped[f"{name}_default"]
    names = f", or the name of a shipped learner: {', '.join(shipped)}" if Path(name).name == name else ""
    names += suggestion(name, shipped)
    raise InputError(path, "", f"must be a file that exists{names}")


def learner_id(path: str | os.PathLike[str]) -> str:
    """The identifier of a learner in logs: the first 16 hexadecimal digits of its file's SHA-256."""
    return sha256_of(find_file(path))[:16]


def read_description(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The JSON object of a learner's file, given as to `load_learner`; its kind may be unknown.

    Raises:
        InputError: The file is missing, broken, of another format or of a newer version.
    """
    return _read(find_file(path))[0]


def _read(path: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
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
        raise InputError(path, "format", f"must be {FORMAT}: this is not a learner of drake_shared")
    version = description.get("version")
    if not isinstance(version, int) or not 1 <= version <= VERSION:
        raise InputError(path, "version", f"must be at most {VERSION}, the newest supported", version)
    return description, tensors
