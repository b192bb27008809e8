"""What all commands share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


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
