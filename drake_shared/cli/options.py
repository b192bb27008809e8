"""Options that several commands share: scenario, learner, and how control is shared."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from drake_shared.cli.command import Command
from drake_shared.common.errors import InputError
from drake_shared.simulation.config import SharedControlConfig, config_for, load_config

Control = Annotated[SharedControlConfig, tyro.conf.arg(name=""), tyro.conf.FlagConversionOff]
"""Every field of the config is an option."""


@dataclasses.dataclass(kw_only=True)
class ControlOptions(Command):
    """Options of commands that run trials."""

    scenario: str | None = None
    """Scenario file, or the name of a shipped one."""
    config: Path | None = None
    """YAML file with the options below; those on the command line win."""
    control: Control = dataclasses.field(default_factory=SharedControlConfig)

    @classmethod
    def defaults(cls, arguments: Sequence[str]) -> dict[str, Any]:
        """Defaults of fields that depend on other options.

        Raises:
            InputError: The file of ``--config`` is not valid.
        """
        file = _value_of("--config", arguments)
        return {} if file is None else {"control": load_config(file)}


@dataclasses.dataclass(kw_only=True)
class LearnerOptions(ControlOptions):
    """Options of commands that run trials with a learner."""

    model: Path | None = None
    """Learner; default: the one that ships for the scenario and preset."""
    preset: Literal["default", "paper"] = "default"
    """Which of the shipped learners. A learner of preset paper has no authority unless it is set."""

    @classmethod
    def defaults(cls, arguments: Sequence[str]) -> dict[str, Any]:
        """The config of ``--config``, or the one that goes with the learner's preset."""
        given = super().defaults(arguments)
        if given:
            return given
        preset, model = _value_of("--preset", arguments), _value_of("--model", arguments)
        if model is not None:
            from drake_shared.learners.storage import read_description

            # A file that cannot be read is reported where it is loaded.
            with contextlib.suppress(InputError):
                preset = read_description(model).get("preset")
        return {"control": config_for(preset or "default")}


def _value_of(option: str, arguments: Sequence[str]) -> str | None:
    """The value of one option, before the others are parsed."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument(option, dest="value")
    try:
        found, _ = parser.parse_known_args(list(arguments))
    except argparse.ArgumentError:
        return None
    value: str | None = found.value
    return value
