"""Options as version 0.1.0 spelled them."""

from __future__ import annotations

from collections.abc import Sequence

from drake_shared.common.console import say
from drake_shared.common.errors import InputError

_RENAMED = {"--mode": "--driver", "--safety": "--safety-clearance"}
_NESTED = {"--authority": "--authority", "--fault": "--faults"}


def translate(arguments: Sequence[str]) -> list[str]:
    """Replaces old spellings in the options of a command, and says so once on standard error.

    Raises:
        InputError: The value of an old option is invalid.
    """
    translated: list[str] = []
    old: list[str] = []
    new: list[str] = []
    rest = list(arguments)
    while rest:
        option, equals, value = rest.pop(0).partition("=")
        if option not in _RENAMED and option not in _NESTED:
            translated.append(f"{option}{equals}{value}")
            continue
        if not equals:
            if not rest:
                raise InputError(option, "", "must be followed by a value")
            value = rest.pop(0)
        given = [_RENAMED[option], value] if option in _RENAMED else _fields(option, value)
        old.append(f"{option} {value}")
        new += given
        translated += given
    if old:
        say(f"warning: {' '.join(old)} is now {' '.join(new)}")
    return translated


def _fields(option: str, text: str) -> list[str]:
    """The options for "on", "off" or "name=value,..."."""
    prefix = _NESTED[option]
    if option == "--authority" and text in ("on", "off"):
        return [f"{prefix}.enabled", str(text == "on")]
    given: dict[str, str] = {}
    for part in text.split(","):
        name, equals, value = (item.strip() for item in part.partition("="))
        if not (name and equals and value) or name in given:
            raise InputError(option, "", "must be name=value,..., each name once", repr(text))
        given[name] = "None" if value == "off" else value
    if option == "--authority":
        given = {"enabled": "True", **given}
    return [item for name, value in given.items() for item in (f"{prefix}.{name}", value)]
