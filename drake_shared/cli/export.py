"""``drake-shared export``: logs for other tools."""

from __future__ import annotations

import dataclasses
import importlib
from pathlib import Path
from typing import Annotated, Literal

import tyro

from drake_shared.cli.command import Command
from drake_shared.cli.common import parquet_files
from drake_shared.common.console import say
from drake_shared.common.errors import InputError

_WRITERS = {"csv": "tables:write_csv", "mcap": "mcap_files:write_mcap", "lerobot": "lerobot:write_lerobot"}


@dataclasses.dataclass(kw_only=True)
class Export(Command):
    """Writes logs as CSV tables, MCAP files or a LeRobot dataset."""

    logs: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Logs, folders of them, or a study."""
    format: Literal["csv", "mcap", "lerobot"]
    """"csv": a table a trial, with a README of the columns; "mcap": for Foxglove and Rerun (extra mcap);
    "lerobot": LeRobotDataset v3.0."""
    out: Path
    """Folder to write; empty or new."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.analysis.export import export
        from drake_shared.simulation.log import read_logs

        module, _, function = _WRITERS[self.format].partition(":")
        try:
            write = getattr(importlib.import_module(f"drake_shared.analysis.export.{module}"), function)
        except ModuleNotFoundError as error:
            expected = f"needs {error.name}: pip install 'drake_shared[{self.format}]'"
            raise InputError("--format", "", expected) from error
        logs = []
        for folder in self.logs:
            study = sorted(folder.glob("data/P*/*.parquet"))
            for file in study or parquet_files([folder]):
                stem = f"{file.parent.name}_{file.stem}" if study else file.stem
                found = read_logs(file)
                logs += [
                    (stem if len(found) == 1 else f"{stem}_{n:05d}", trial) for n, trial in found.items()
                ]
        export(logs, self.out, write)
        say(f"wrote {len(logs)} trials to {self.out}")
