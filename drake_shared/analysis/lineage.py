"""Where a learner comes from: its data, the learners that took part in making them, and theirs before."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.common.files import sha256_of
from drake_shared.learners.storage import learner_id, read_description

_WEIGHTS = {"human": 1.0, "agent": 0.0}
KINDS = ("human", "shared", "agent", "unknown")


@dataclasses.dataclass(frozen=True, kw_only=True)
class DataFile:
    """A file that a learner was taught by.

    Attributes:
        file: Its name when the learner was trained; None for what came from no file.
        state: "unchanged", "changed" (there is a file of that name, but with other content) or "missing".
        sources: What the training record says of each demonstration in it.
    """

    file: str | None
    state: str
    sources: tuple[dict[str, Any], ...]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Generation:
    """A learner among its ancestors.

    Attributes:
        id: By the content of its file, as logs have it.
        file: Where it was found; None if it is missing.
        description: Name, preset and scenario, as far as known.
        counts: How many of its demonstrations were driven by the "human" alone, "shared", by the "agent"
            alone, or by who is "unknown"; None if its file does not tell.
        autonomy: Share of its data that autonomy made: mean over the demonstrations of one less the human's
            mean weight; those that do not tell do not count. None if none does.
        data: Its files.
        parents: The learners that took part in its data.
        told: Whether it was told of before, further up; data and parents are left out then. So the tree stays
            small where generations share their ancestors, and ends if one were its own.
    """

    id: str
    file: str | None
    description: dict[str, Any] = dataclasses.field(default_factory=dict)
    counts: dict[str, int] | None = None
    autonomy: float | None = None
    data: tuple[DataFile, ...] = ()
    parents: tuple[Generation, ...] = ()
    told: bool = False


def lineage(model: str | os.PathLike[str], folders: Iterable[str | os.PathLike[str]] = ()) -> Generation:
    """The learner of a file with all that led to it.

    Args:
        model: Its file.
        folders: Where ancestors are looked for, by the content of the files in them.

    Raises:
        InputError: ``model`` is no learner's file, or a folder is none.
    """
    read_description(model)
    places = learners_in(folders)
    own = learner_id(model)
    places[own] = os.fspath(model)
    return trace(own, places.get, read_description)


def trace(
    id: str,
    find: Callable[[str], str | None],
    describe: Callable[[str], dict[str, Any]],
    told: set[str] | None = None,
) -> Generation:
    """The learner ``id`` with its ancestors.

    Args:
        id: Of the learner.
        find: The file of a learner, if it is known.
        describe: What a learner's file says.
        told: Learners that need not be told of again.
    """
    told = set() if told is None else told
    file = find(id)
    if file is None:
        return Generation(id=id, file=None, told=id in told)
    said = describe(file)
    description = {name: said.get(name) for name in ("learner", "preset", "scenario")}
    if id in told:
        return Generation(id=id, file=file, description=description, told=True)
    told.add(id)
    training = said.get("training")
    sources = training.get("sources") if isinstance(training, dict) else None
    if not isinstance(sources, list) or not all(isinstance(item, dict) for item in sources):
        return Generation(id=id, file=file, description=description)
    took_part = [item.get("learner_id") for item in sources if _kind(item) != "human"]
    parents = dict.fromkeys(one for one in took_part if isinstance(one, str))
    return Generation(
        id=id,
        file=file,
        description=description,
        counts={kind: sum(_kind(item) == kind for item in sources) for kind in KINDS},
        autonomy=autonomy_share(sources),
        data=_files(sources, Path(file).parent),
        parents=tuple(trace(parent, find, describe, told) for parent in parents),
    )


def autonomy_share(sources: Sequence[dict[str, Any]]) -> float | None:
    """Share of demonstrations that autonomy made: mean of one less the human's weight, where it is known."""
    weights = [item.get("human_weight", _WEIGHTS.get(_kind(item))) for item in sources]
    known = [weight for weight in weights if isinstance(weight, int | float)]
    return sum(1.0 - weight for weight in known) / len(known) if known else None


def learners_in(folders: Iterable[str | os.PathLike[str]]) -> dict[str, str]:
    """The files of learners in ``folders``, by id.

    Raises:
        InputError: One is no folder that can be read.
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
        # Eight bytes of length and a JSON object begin such a file: others, large logs say, are not read.
        with file.open("rb") as opened:
            if opened.read(9)[8:] != b"{":
                return False
        read_description(file)
    except (InputError, OSError):
        return False
    return True


def _kind(source: dict[str, Any]) -> str:
    mode = source.get("mode")
    return mode if mode in KINDS else "unknown"


def _files(sources: Sequence[dict[str, Any]], beside: Path) -> tuple[DataFile, ...]:
    grouped: dict[tuple[Any, Any], list[dict[str, Any]]] = {}
    for item in sources:
        grouped.setdefault((item.get("file"), item.get("sha256")), []).append(item)
    return tuple(
        DataFile(
            file=file,
            state="missing" if file is None else _state(Path(file), content, beside),
            sources=tuple(items),
        )
        for (file, content), items in grouped.items()
    )


def _state(file: Path, content: str | None, beside: Path) -> str:
    """Of a file, looked for where it was and beside the learner."""
    there = [place for place in (file, beside / file, beside / file.name) if place.is_file()]
    if any(sha256_of(place) == content for place in there):
        return "unchanged"
    return "changed" if there else "missing"
