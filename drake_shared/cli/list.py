"""``drake-shared list``: what can be named on the command line."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import re
from collections.abc import Callable
from typing import Annotated, Any, Literal, get_args

import tyro

from drake_shared.cli.command import Command
from drake_shared.cli.common import print_json
from drake_shared.cli.table import wrapped
from drake_shared.common.entry_points import load_registered, registered_names
from drake_shared.common.errors import InputError

Kind = Literal["scenarios", "learners", "models", "arbiters", "operators", "robots"]


@dataclasses.dataclass(kw_only=True)
class List(Command):
    """Lists what can be named on the command line, with a line about each, registered ones included."""

    kinds: Annotated[tuple[Kind, ...], tyro.conf.Positional] = ()
    """What to list; default: everything."""
    json: bool = False
    """Print everything as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        listed = {kind: _KINDS[kind][1]() for kind in self.kinds or _ALL}
        if self.json:
            print_json(listed)
            return
        width = max(len(name) for names in listed.values() for name in names) + 2
        for kind, names in listed.items():
            print(f"{kind} ({_KINDS[kind][0]})")
            for name, text in names.items():
                print("\n".join(wrapped(f"  {name}", text, width)))


def _scenarios() -> dict[str, str]:
    from drake_shared.scenario import shipped_scenarios

    found = {}
    for name, file in shipped_scenarios().items():
        first = file.read_text(encoding="utf-8").partition("\n")[0]
        found[name] = first.removeprefix("#").strip() if first.startswith("#") else ""
    return found


def _learners() -> dict[str, str]:
    from drake_shared.learners.registry import GROUP, find_learner, learner_names

    return {name: _described(name, GROUP, functools.partial(find_learner, name)) for name in learner_names()}


def _models() -> dict[str, str]:
    from drake_shared.learners.storage import read_description, shipped_learners

    found = {}
    for name, file in shipped_learners().items():
        described = read_description(file)
        kind, preset, scenario = (described.get(key) for key in ("learner", "preset", "scenario"))
        found[name] = f"{kind} of preset {preset} for {scenario}"
    return found


def _arbiters() -> dict[str, str]:
    from drake_shared.systems.arbiters import GROUP, arbiter_names, find_arbiter

    alone = {"human": "The human drives alone.", "agent": "The agent drives alone."}
    return {
        name: alone.get(name) or _described(name, GROUP, functools.partial(find_arbiter, name))
        for name in arbiter_names()
    }


def _operators() -> dict[str, str]:
    from drake_shared.operators.named import ARM_OPERATORS, OPERATORS
    from drake_shared.systems.operators import GROUP, registered_operators

    found = {
        "mouse": "A person on the page (drive, teach).",
        "surrogate": "The simulated operator that the options describe, such as --delay and --noise.",
    }
    found |= {name: f"Simulated: {named.model}." for name, named in OPERATORS.items()}
    found |= {name: f"Simulated, of an arm: {named.model}." for name, named in ARM_OPERATORS.items()}
    return found | {
        name: _described(name, GROUP, functools.partial(load_registered, GROUP, name, source="operator"))
        for name in registered_operators()
    }


def _robots() -> dict[str, str]:
    from drake_shared.common.files import models_directory
    from drake_shared.systems.robots import GROUP, registered_robots

    folder = models_directory() / "robots"
    wheeled, arms = sorted(folder.glob("*.sdf")), sorted(folder.glob("*.urdf"))
    found = {file.name: "Differential drive." for file in wheeled} | {file.name: "Arm." for file in arms}
    return found | {
        name: _described(name, GROUP, functools.partial(load_registered, GROUP, name, source="robot"))
        for name in registered_robots()
    }


def _described(name: str, group: str, load: Callable[[], Any]) -> str:
    """The first sentence of the docstring of what has a name."""
    try:
        text = " ".join((inspect.getdoc(load()) or "").partition("\n\n")[0].split())
        text = re.split(r"(?<=\.) (?=A `)", text)[0]  # Learners end with the contract that they fulfil.
    except InputError as error:
        text = str(error)
    registered = " (registered by another package)" if name in registered_names(group) else ""
    return text + registered


_ALL: tuple[Kind, ...] = get_args(Kind)
_KINDS: dict[Kind, tuple[str, Callable[[], dict[str, str]]]] = {
    "scenarios": ("--scenario NAME", _scenarios),
    "learners": ("train --learner NAME", _learners),
    "models": ("--model NAME", _models),
    "arbiters": ("--arbitration NAME", _arbiters),
    "operators": ("--operator NAME", _operators),
    "robots": ("robot: {model: NAME} in a scenario; registered ones: simulate --robot NAME", _robots),
}
