"""Usage errors in one line."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterator

from drake_shared.common.errors import InputError

# What the config's dataclasses call themselves in errors, and the prefix of their options.
_PREFIXES = {
    "config": "",
    "operator": "",
    "authority": "authority.",
    "faults": "faults.",
    "feedback": "feedback.",
}
_OF_A_FIELD = re.compile(rf"({'|'.join(_PREFIXES)}): (\w[\w.]*) (.*)")


@contextlib.contextmanager
def usage_error() -> Iterator[None]:
    """Turns the parser's exit, and the box that it prints, into an InputError of one line."""
    printed = io.StringIO()
    try:
        with contextlib.redirect_stderr(printed):
            yield
    except InputError as error:
        raise _with_option(str(error)) or error from None
    except SystemExit as stopped:
        if stopped.code in (None, 0):
            raise
        raise _as_input_error(printed.getvalue()) from None


def _as_input_error(box: str) -> InputError:
    # The frame of the box is drawn in ASCII where the terminal knows no more.
    lines = [line.strip(" │╭╮╰╯|+") for line in box.splitlines()[1:]]
    lines = [line for line in lines if line.strip("─-")]
    problem: list[str] = []
    likely = ""
    for line in lines:
        if line.startswith(("For full helptext", "Argument helptext")):
            break
        if line.startswith("Perhaps you meant"):
            found = (item.split()[0].rstrip(",") for item in lines if item.startswith("--"))
            likely = next((f" (did you mean {name}?)" for name in found), "")
            break
        problem.append(line)
    text = " ".join(problem)
    return _with_option(text) or InputError("usage", f"{text}{likely}", "(see --help)")


def _with_option(text: str) -> InputError | None:
    """The error of a config's field, under the name of its option; None if the text is not one."""
    field = _OF_A_FIELD.search(text)
    if field is None:
        return None
    source, name, expected = field.groups()
    return InputError(f"--{_PREFIXES[source]}{name}".replace("_", "-"), "", expected)
