"""The command line: ``drake-shared COMMAND``."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import importlib
import importlib.metadata
import logging
import operator
import signal
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

import tyro

from drake_shared.cli.command import Command
from drake_shared.cli.messages import usage_error
from drake_shared.cli.old_spellings import translate
from drake_shared.common.console import say, tolerant_streams
from drake_shared.common.errors import DrakeSharedError, InputError
from drake_shared.common.suggestions import suggestion

# A module is imported only when its command is used or all are listed, so that --help stays quick.
COMMANDS = {
    "drive": "drive:Drive",
    "teach": "teach:Teach",
    "train": "train:Train",
    "simulate": "simulate:Simulate",
    "evaluate": "evaluate:Evaluate",
    "fit-operator": "fit_operator:FitOperator",
    "lineage": "lineage:Lineage",
    "list": "list:List",
    "show": "show:Show",
    "study": "study:StudyCommand",
    "export": "export:Export",
    "replay": "replay:Replay",
    "reproduce": "reproduce:Reproduce",
    "compare": "compare:Compare",
    "benchmark": "benchmark:Benchmark",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command. Exit status: 0 done, 1 the run failed, 2 bad usage or bad input, 130 Ctrl-C."""
    logging.getLogger("drake").setLevel(logging.WARNING)
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with tolerant_streams(), _ends_on_signals():
            _check_encoding(given)
            if given == ["--version"]:
                print(f"drake-shared {importlib.metadata.version('drake_shared')}")
            else:
                parse(given).run()
    except DrakeSharedError as error:
        say(f"drake-shared: {error}")
        return 2 if isinstance(error, InputError) else 1
    except KeyboardInterrupt:
        return 130
    return 0


def _check_encoding(arguments: Sequence[str]) -> None:
    """Refuses file names that are not UTF-8: files and messages that name them could not be written."""
    for argument in arguments:
        try:
            argument.encode()
        except UnicodeEncodeError:
            raise InputError(ascii(argument), "", "must be UTF-8, like all names of files") from None


def parse(arguments: Sequence[str]) -> Command:
    """The command that ``arguments`` describe, with its options.

    Raises:
        InputError: A command or option is unknown, or a value is invalid.
    """
    name, options = (arguments[0], translate(arguments[1:])) if arguments else ("", [])
    known = name in COMMANDS
    if not known and name not in ("-h", "--help"):
        got = f", got {name!r}{suggestion(name, COMMANDS)}" if name else ""
        raise InputError(
            "usage", f"the first argument must be one of {', '.join(COMMANDS)}{got}", "(see --help)"
        )
    kind: Any = _class_of(name) if known else functools.reduce(operator.or_, _subcommands())
    defaults = kind.defaults(options) if known else {}
    with usage_error():
        command: Command = tyro.cli(
            kind,
            prog=f"drake-shared {name}" if known else "drake-shared",
            description=None
            if known
            else "Shared control for Drake: a person steers, a learner predicts where to.",
            args=options if known else list(arguments),
            **({"default": _with_defaults(kind, defaults)} if defaults else {}),
            config=(tyro.conf.OmitSubcommandPrefixes,),
        )
    return command


def _with_defaults(kind: Any, defaults: Mapping[str, Any]) -> Any:
    required = [
        field.name
        for field in dataclasses.fields(kind)
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
    ]
    return kind(**dict.fromkeys(required, tyro.MISSING), **defaults)


def _class_of(name: str) -> type[Command]:
    module, _, kind = COMMANDS[name].partition(":")
    found: type[Command] = getattr(importlib.import_module(f"drake_shared.cli.{module}"), kind)
    return found


def _subcommands() -> list[Any]:
    return [Annotated[_class_of(name), tyro.conf.subcommand(name)] for name in COMMANDS]


@contextlib.contextmanager
def _ends_on_signals() -> Iterator[None]:
    """Lets SIGTERM and SIGHUP raise SystemExit with 128 + number as status, so that every cleanup runs."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # One that is ignored stays so: nohup ignores SIGHUP.
    numbers = (signal.SIGTERM, signal.SIGHUP)
    before = {n: handler for n in numbers if (handler := signal.getsignal(n)) is not signal.SIG_IGN}
    for number in before:
        signal.signal(number, lambda received, _: sys.exit(128 + received))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


if __name__ == "__main__":
    sys.exit(main())
