"""Options that several commands share: scenario, learner, and how control is shared."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
from collections.abc import Sequence
from typing import Annotated, Any, Literal

import tyro

from drake_shared.arbitration.fusion_model import FusionModel
from drake_shared.arbitration.person import person_path, read_person
from drake_shared.cli.command import Command, OptionalPath, OptionalText
from drake_shared.common.errors import InputError
from drake_shared.robots import Robot
from drake_shared.simulation.config import SharedControlConfig, config_for, load_config

Control = Annotated[SharedControlConfig, tyro.conf.arg(name=""), tyro.conf.FlagConversionOff]
"""Every field of the config is an option."""
_OF_THE_BLEND = ("--authority", "--confidence-gain", "--look-ahead")
"""Options that only the blend uses: they select it if no arbiter is named."""


@dataclasses.dataclass(kw_only=True)
class ControlOptions(Command):
    """Options of commands that run trials."""

    scenario: OptionalText = None
    """Scenario file, or the name of a shipped one; default: that of the learner, or two_obstacles."""
    config: OptionalPath = None
    """YAML file with the options of how control is shared; those on the command line win. Default: none."""
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

    model: OptionalPath = None
    """Learner; default: the one that ships for the scenario and preset."""
    preset: Literal["default", "paper"] = "default"
    """Which of the shipped learners. A learner of preset paper has no authority unless it is set."""

    def scenario_source(self) -> str | None:
        """What `load_scenario` takes: ``--scenario``, or else the scenario that the learner was taught.

        Raises:
            InputError: The learner names a scenario of which no file is known.
        """
        if self.scenario is not None or self.model is None:
            return self.scenario
        from pathlib import Path

        from drake_shared.learners.storage import find_file, read_description
        from drake_shared.scenario import shipped_scenarios

        taught = read_description(self.model).get("scenario")
        if not isinstance(taught, str) or taught in shipped_scenarios():
            return taught if isinstance(taught, str) else None
        for folder in (Path(find_file(self.model)).parent, Path()):
            beside = folder / f"{taught}.yaml"
            if beside.is_file():
                return str(beside)
        expected = f"must be given: {self.model} was taught scenario {taught!r}, of which no file is known"
        raise InputError("--scenario", "", expected)

    @classmethod
    def defaults(cls, arguments: Sequence[str]) -> dict[str, Any]:
        """The config of ``--config``, or the one that goes with the learner's preset and the robot."""
        given = super().defaults(arguments)
        if given:
            return given
        preset, model = _value_of("--preset", arguments), _value_of("--model", arguments)
        taught = None
        if model is not None:
            from drake_shared.learners.storage import read_description

            # A file that cannot be read is reported where it is loaded.
            with contextlib.suppress(InputError):
                description = read_description(model)
                preset, taught = description.get("preset"), description.get("scenario")
        scenario, name = _value_of("--scenario", arguments) or taught, _value_of("--robot", arguments)
        robot = _robot_of(scenario, name)
        is_blend = any(item.startswith(_OF_THE_BLEND) for item in arguments)
        changes = {"arbitration": "blend"} if is_blend else {}
        return {"control": cls.config_for(preset or "default", robot, **changes)}

    @classmethod
    def config_for(cls, preset: str, robot: Robot | None, **changes: Any) -> SharedControlConfig:
        """The config where no file gives one."""
        return config_for(preset, robot, **changes)


@dataclasses.dataclass(kw_only=True)
class PageOptions(Command):
    """Options of commands that serve the page."""

    host: str = "127.0.0.1"
    """Address that the page listens on. Anything but this machine's own shows it to the network."""
    port: int = 8080
    """Port that the page listens on; 0 takes any that is free."""
    allow_host: tuple[str, ...] = ()
    """Further names of this machine by which browsers may ask for the page; default: none."""
    behind_proxy: OptionalText = None
    """Address under which a proxy that speaks TLS shows the page, such as https://lab.example; default: no
    proxy."""
    open: bool = True
    """Open the page in this machine's browser."""

    def page(self) -> dict[str, Any]:
        """Keyword arguments of `drake_shared.cockpit.drive`."""
        return {
            "host": self.host,
            "port": self.port,
            "allowed_hosts": self.allow_host,
            "proxy": self.behind_proxy,
            "open_browser": self.open,
        }


def config_for_person(config: SharedControlConfig, name: str | None, robot: Robot) -> SharedControlConfig:
    """``config``, with what is known of the person of ``--person``, if one is named.

    Raises:
        InputError: The arbiter estimates nothing, or the person's file cannot be used.
    """
    if name is None:
        return config
    if config.arbitration != "fusion":
        raise InputError("--person", "", "requires --arbitration fusion", config.arbitration)
    person, model = read_person(person_path(name), robot), FusionModel()
    if (person.noises, person.noise_times) != (model.noises, model.noise_times):
        expected = "must be those of this version; write the file again with fit-operator"
        raise InputError(person_path(name), "noises", expected, person.noises)
    prior = " ".join(f"{value:g}" for value in person.probability)
    return dataclasses.replace(
        config, arbitration_options={**config.arbitration_options, "noise_prior": prior}
    )


def _robot_of(scenario: object, name: str | None) -> Robot | None:
    """The registered robot ``name``, or the one of a scenario, file or name.

    None if it is unknown, which is reported where it is loaded.
    """
    if name is None and not isinstance(scenario, str):
        return None
    from drake_shared.scenario import load_scenario

    with contextlib.suppress(InputError):
        task = load_scenario(scenario if isinstance(scenario, str) else None)
        if name is None:
            return task.robot
        from drake_shared.systems.robots import make_robot

        return make_robot(name, scenario=task)[0]
    return None


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
