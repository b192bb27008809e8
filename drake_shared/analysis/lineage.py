"""Lineage of a learner: its training data, the learners that took part in recording them, and so on."""

from __future__ import annotations

import dataclasses
import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.common.files import sha256_of
from drake_shared.learners.storage import learner_id, read_description

SIMULATED_OPERATOR = "SurrogateOperator"
"""Operator named in the provenance of demonstrations by a simulated operator."""
# A system from elsewhere may be either, so that only its name is known.
_OPERATORS = {
    SIMULATED_OPERATOR: "simulated operator",
    "MouseInput": "person",
    "RecordedInput": "recorded commands",
}
KINDS = ("human", "shared", "agent", "unknown")
_HUMAN_WEIGHTS = {"human": 1.0, "agent": 0.0}


@dataclasses.dataclass(frozen=True, kw_only=True)
class DataFile:
    """A file that a learner was trained on.

    Attributes:
        file: Its name at the time of training; None for demonstrations that were not read from a file.
        state: "unchanged", "changed" (a file of that name has other content) or "missing".
        sources: Provenance of each demonstration in it, from the training record.
    """

    file: str | None
    state: str
    sources: tuple[dict[str, Any], ...]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Generation:
    """A learner among its ancestors.

    Attributes:
        id: Hash of its file, as in logs.
        file: Path; None if the file was not found.
        description: Name, preset and scenario, as far as known.
        counts: Number of its demonstrations by mode ("human" alone, "shared", "agent" alone, "unknown"); None
            if its file does not hold their provenance.
        drivers: The same by driver; see `driver_of`.
        autonomy: Share of its data that is due to autonomy: mean of 1 - mean human weight over the
            demonstrations with a known weight; None if there are none.
        data: The files that it was trained on.
        parents: The learners that took part in recording these.
        told: Whether this learner is listed before, further up; data and parents are omitted then. This keeps
            the tree small if generations share ancestors, and finite if a learner were its own ancestor.
    """

    id: str
    file: str | None
    description: dict[str, Any] = dataclasses.field(default_factory=dict)
    counts: dict[str, int] | None = None
    drivers: dict[str, int] | None = None
    autonomy: float | None = None
    data: tuple[DataFile, ...] = ()
    parents: tuple[Generation, ...] = ()
    told: bool = False


def lineage(model: str | os.PathLike[str], folders: Iterable[str | os.PathLike[str]] = ()) -> Generation:
    """The learner of a file with its data and ancestors.

    Args:
        model: The learner's file.
        folders: Where to search for ancestors, by the content of the files.

    Raises:
        InputError: ``model`` is not the file of a learner, or a folder cannot be read.
    """
    read_description(model)
    files = learners_in(folders)
    own = learner_id(model)
    files[own] = os.fspath(model)
    return trace(own, files.get, read_description)


def trace(
    id: str,
    find: Callable[[str], str | None],
    describe: Callable[[str], dict[str, Any]],
    listed: set[str] | None = None,
) -> Generation:
    """The learner ``id`` with its data and ancestors.

    Args:
        id: The learner's id.
        find: Returns the file of a learner, or None.
        describe: Returns the description in a learner's file.
        listed: Learners that were listed before; is extended.
    """
    listed = set() if listed is None else listed
    file = find(id)
    if file is None:
        return Generation(id=id, file=None, told=id in listed)
    described = describe(file)
    description = {name: described.get(name) for name in ("learner", "preset", "scenario")}
    if id in listed:
        return Generation(id=id, file=file, description=description, told=True)
    listed.add(id)
    training = described.get("training")
    sources = training.get("sources") if isinstance(training, dict) else None
    if not isinstance(sources, list) or not all(isinstance(item, dict) for item in sources):
        return Generation(id=id, file=file, description=description)
    took_part = [item.get("learner_id") for item in sources if item.get("mode") != "human"]
    modes = [_mode(item) for item in sources]
    parents = dict.fromkeys(one for one in took_part if isinstance(one, str))
    return Generation(
        id=id,
        file=file,
        description=description,
        counts={kind: modes.count(kind) for kind in KINDS},
        drivers=dict(Counter(map(driver_of, sources))),
        autonomy=autonomy_share(sources),
        data=_files(sources, Path(file).parent),
        parents=tuple(trace(parent, find, describe, listed) for parent in parents),
    )


def autonomy_share(sources: Sequence[dict[str, Any]]) -> float | None:
    """Mean of 1 - human weight over the demonstrations with a known weight; None if there are none."""
    weights = [item.get("human_weight", _HUMAN_WEIGHTS.get(str(item.get("mode")))) for item in sources]
    known = [weight for weight in weights if isinstance(weight, int | float)]
    return sum(1.0 - weight for weight in known) / len(known) if known else None


def learners_in(folders: Iterable[str | os.PathLike[str]]) -> dict[str, str]:
    """The files of learners in ``folders``, by id.

    Raises:
        InputError: A folder cannot be read.
    """
    found: dict[str, str] = {}
    for folder in folders:
        try:
            files = sorted(item for item in Path(folder).iterdir() if item.is_file())
        except OSError as error:
            raise InputError(folder, "", f"must be a folder to read ({error.strerror})") from error
        for file in files:
            if _is_learner(file):
                found.setdefault(learner_id(file), os.fspath(file))
    return found


def _is_learner(file: Path) -> bool:
    try:
        # A safetensors file starts with eight bytes of length and a JSON object; others are not read.
        with file.open("rb") as opened:
            if opened.read(9)[8:] != b"{":
                return False
        read_description(file)
    except (InputError, OSError):
        return False
    return True


def driver_of(source: dict[str, Any]) -> str:
    """Who drove a demonstration, from its provenance.

    Returns:
        "simulated operator", "person", "recorded commands", "operator NAME" for another system, or "unknown
        operator"; the same with "shared with" before it for shared control; "agent"; or "unknown".
    """
    mode = _mode(source)
    if mode not in ("human", "shared"):
        return mode
    operator = source.get("operator")
    human = _OPERATORS.get(operator, f"operator {operator}") if operator else "unknown operator"
    return human if mode == "human" else f"shared with {human}"


def _mode(source: dict[str, Any]) -> str:
    mode = source.get("mode")
    return mode if mode in KINDS else "unknown"


def _files(sources: Sequence[dict[str, Any]], folder: Path) -> tuple[DataFile, ...]:
    grouped: dict[tuple[Any, Any], list[dict[str, Any]]] = {}
    for item in sources:
        grouped.setdefault((item.get("file"), item.get("sha256")), []).append(item)
    return tuple(
        DataFile(
            file=file,
            state="missing" if file is None else _state(Path(file), sha256, folder),
            sources=tuple(items),
        )
        for (file, sha256), items in grouped.items()
    )


def _state(file: Path, sha256: str | None, folder: Path) -> str:
    """State of a file, which is searched at its path and in the learner's folder."""
    found = [path for path in (file, folder / file, folder / file.name) if path.is_file()]
    if any(sha256_of(path) == sha256 for path in found):
        return "unchanged"
    return "changed" if found else "missing"
