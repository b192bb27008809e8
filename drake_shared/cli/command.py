"""What all commands share."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import tyro

# An option that may be left out: its help says what then happens, in place of "(default: None)".
OptionalPath = Annotated[Path | None, tyro.conf.arg(metavar="PATH", help_behavior_hint="")]
OptionalText = Annotated[str | None, tyro.conf.arg(metavar="STR", help_behavior_hint="")]
OptionalInt = Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")]
OptionalFloat = Annotated[float | None, tyro.conf.arg(metavar="FLOAT", help_behavior_hint="")]


class Command:
    """A command; its subclasses are dataclasses whose fields are the options."""

    @classmethod
    def defaults(cls, arguments: Sequence[str]) -> dict[str, Any]:
        """Defaults of fields that depend on other options, which are in ``arguments``."""
        return {}

    def run(self) -> None:
        """Runs the command.

        Raises:
            InputError: An option or a file is not valid.
            RunError: The run failed.
        """
        raise NotImplementedError


@dataclasses.dataclass(kw_only=True)
class TaskCommand(Command):
    """A command that runs many tasks and writes a report."""

    out: Path
    """Folder for the report and for the results of every task; must be empty or new."""
    workers: OptionalInt = None
    """Number of processes; the results do not depend on it. Default: one for each processor."""
    resume: bool = False
    """Continue the run that is in the folder."""
    force: bool = False
    """Overwrite the run that is in the folder."""

    @property
    def processes(self) -> int:
        """Number of processes."""
        return (os.cpu_count() or 1) if self.workers is None else self.workers
