"""The command line: ``drake-shared COMMAND``."""

from __future__ import annotations

import contextlib
import io
import logging
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from typing import Annotated

import tyro

from drake_shared.cli.benchmark import Benchmark
from drake_shared.cli.drive import Drive
from drake_shared.cli.evaluate import Evaluate
from drake_shared.cli.fit_operator import FitOperator
from drake_shared.cli.lineage import Lineage
from drake_shared.cli.replay import Replay
from drake_shared.cli.reproduce import Reproduce
from drake_shared.cli.simulate import Simulate
from drake_shared.cli.teach import Teach
from drake_shared.cli.train import Train
from drake_shared.common.errors import DrakeSharedError, InputError

Command = (
    Annotated[Drive, tyro.conf.subcommand("drive")]
    | Annotated[Teach, tyro.conf.subcommand("teach")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Simulate, tyro.conf.subcommand("simulate")]
    | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    | Annotated[FitOperator, tyro.conf.subcommand("fit-operator")]
    | Annotated[Lineage, tyro.conf.subcommand("lineage")]
    | Annotated[Replay, tyro.conf.subcommand("replay")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[Benchmark, tyro.conf.subcommand("benchmark")]
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command. Exit status: 0 done, 1 the run failed, 2 bad usage or bad input, 130 Ctrl-C."""
    logging.getLogger("drake").setLevel(logging.WARNING)
    try:
        with _ends_on_sigterm():
            _parse(arguments).run()
    except DrakeSharedError as error:
        print(f"drake-shared: {error}", file=sys.stderr)
        return 2 if isinstance(error, InputError) else 1
    except KeyboardInterrupt:
        return 130
    return 0


@contextlib.contextmanager
def _ends_on_sigterm() -> Iterator[None]:
    """Lets SIGTERM end the process as an exception would, so that nothing is left behind: status 143."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _parse(arguments: Sequence[str] | None) -> Command:
    """The command that ``arguments`` ask for.

    Raises:
        InputError: They are not what a command takes.
    """
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(
                Command,
                prog="drake-shared",
                description="Shared control for Drake: a person steers, a learner predicts where to.",
                args=arguments,
                config=(tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
            )
    except SystemExit as stopped:
        if stopped.code in (None, 0):
            raise
        raise InputError("usage", _one_line(said.getvalue()), "(see --help)") from None


def _one_line(box: str) -> str:
    """What the parser says in a box of several parts: the parts up to the help, in one line."""
    lines = [line.strip(" │╭╮╰╯") for line in box.splitlines()[1:]]
    told: list[str] = []
    for line in lines:
        if line.startswith(("For full helptext", "Argument helptext")):
            break
        if line.strip("─"):
            told.append(line)
    return " ".join(told)


if __name__ == "__main__":
    sys.exit(main())
