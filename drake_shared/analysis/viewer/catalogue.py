"""Which trials and demonstrations the files of a folder hold."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from drake_shared.analysis.lineage import driver_of
from drake_shared.common.errors import InputError
from drake_shared.demonstrations import LOG_FORMAT, METADATA_KEY
from drake_shared.demonstrations.log_table import TRIALS


@dataclasses.dataclass(frozen=True, kw_only=True)
class Entry:
    """A trial or a demonstration, as far as the metadata of its file tell.

    Attributes:
        file: That holds it.
        number: Of the trial or demonstration in a file of several; None in a log of one trial.
        kind: "log" or "demonstration".
        name: Shown on the page.
        status: How the trial ended; empty for a demonstration.
        driver: Who drove it; see `drake_shared.analysis.lineage.driver_of`.
        route: That was meant; empty if unknown.
        scenario: Its name; empty if unknown.
        seed: None if unknown.
        duration: In [s]; None if it is not known without the rows.
    """

    file: Path
    number: int | None
    kind: str
    name: str
    status: str = ""
    driver: str = ""
    route: str = ""
    scenario: str = ""
    seed: int | None = None
    duration: float | None = None

    def to_json(self) -> dict[str, Any]:
        """All fields but the file, whose name is part of ``name``."""
        fields = dataclasses.asdict(self)
        del fields["file"], fields["number"]
        return fields


class Catalogue:
    """The trials and demonstrations in a folder and the folders in it, or in one file, found one by one.

    Args:
        path: Folder or file.

    Attributes:
        entries: Those found so far.
        skipped: Files that hold neither, with the reason.

    Raises:
        InputError: There is no such path, or a folder without Parquet files.
    """

    def __init__(self, path: Path) -> None:
        if path.is_dir():
            self._root = path
            self._files = sorted(path.rglob("*.parquet"))
            if not self._files:
                raise InputError(path, "", "must hold logs or demonstrations; there is no Parquet file in it")
        elif path.is_file():
            self._root, self._files = path.parent, [path]
        else:
            raise InputError(path, "", "must be a log, a file of demonstrations, or a folder of them")
        self.entries: list[Entry] = []
        self.skipped: dict[str, str] = {}

    @property
    def files(self) -> int:
        """Number of files."""
        return len(self._files)

    def read(self) -> Iterator[Entry]:
        """Reads the metadata of one file after another, and yields what it holds."""
        for file in self._files:
            try:
                found = list(self._entries_of(file))
            except InputError as error:
                self.skipped[str(file.relative_to(self._root))] = str(error)
                continue
            self.entries += found
            yield from found

    def _entries_of(self, file: Path) -> Iterator[Entry]:
        name = str(file.relative_to(self._root))
        metadata, rows, columns = _read_metadata(file)
        if metadata.get("format") != LOG_FORMAT:
            if not {"demonstration", "t"} <= set(columns):
                raise InputError(file, "", "must hold a log or demonstrations")
            yield from _demonstrations(file, name, metadata)
        elif TRIALS in metadata:
            own = metadata[TRIALS]
            for number in sorted(own, key=int):
                yield _log(file, f"{name}#{number}", metadata | own[number], int(number), None)
        else:
            yield _log(file, name, metadata, None, rows)


def _read_metadata(file: Path) -> tuple[dict[str, Any], int, list[str]]:
    """The metadata of a Parquet file, its number of rows, and the names of its columns."""
    try:
        with pq.ParquetFile(file) as opened:
            schema, rows = opened.schema_arrow, opened.metadata.num_rows
    except (OSError, pa.ArrowException) as error:
        raise InputError(file, "", "cannot be read as Parquet") from error
    try:
        metadata = json.loads((schema.metadata or {}).get(METADATA_KEY, b"{}"))
    except ValueError as error:
        raise InputError(file, "metadata", "must be JSON") from error
    if not isinstance(metadata, dict):
        raise InputError(file, "metadata", "must be a JSON object")
    return metadata, rows, schema.names


def _log(file: Path, name: str, metadata: Mapping[str, Any], number: int | None, rows: int | None) -> Entry:
    scenario = metadata.get("scenario")
    scenario = scenario if isinstance(scenario, dict) else {}
    period = scenario.get("control_period")
    duration = None
    if isinstance(period, int | float) and rows is not None:
        duration = round((rows - 1) * period, 6)
    return Entry(
        file=file,
        number=number,
        kind="log",
        name=name,
        status=_text(metadata.get("status")),
        driver=driver_of(dict(metadata)),
        route=_text(metadata.get("route")),
        scenario=_text(scenario.get("name")),
        seed=metadata.get("seed") if isinstance(metadata.get("seed"), int) else None,
        duration=duration,
    )


def _demonstrations(file: Path, name: str, metadata: Mapping[str, Any]) -> Iterator[Entry]:
    provenance = metadata.get("provenance")
    if isinstance(provenance, list) and provenance:
        origins = [item if isinstance(item, dict) else {} for item in provenance]
    else:
        column = pq.read_table(file, columns=["demonstration"])["demonstration"]
        origins = [{}] * len(column.unique())
    scenario = metadata.get("scenario")
    for index, origin in enumerate(origins):
        yield Entry(
            file=file,
            number=index,
            kind="demonstration",
            name=f"{name}: demonstration {index}",
            driver=driver_of(origin),
            route=_text(origin.get("route")),
            scenario=_text(scenario.get("name") if isinstance(scenario, dict) else scenario),
            seed=origin.get("seed") if isinstance(origin.get("seed"), int) else None,
        )


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""
