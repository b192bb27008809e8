"""What all commands share."""

from __future__ import annotations

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
