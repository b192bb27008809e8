"""The command line: ``drake-shared COMMAND``."""

from __future__ import annotations

import logging
import sys
from collections.abc import Sequence
from typing import Annotated

import tyro

from drake_shared.commands.benchmark import Benchmark
from drake_shared.commands.drive import Drive
from drake_shared.commands.evaluate import Evaluate
from drake_shared.commands.lineage import Lineage
from drake_shared.commands.replay import Replay
from drake_shared.commands.simulate import Simulate
from drake_shared.commands.teach import Teach
from drake_shared.commands.train import Train
from drake_shared.errors import DrakeSharedError, InputError

Command = (
    Annotated[Drive, tyro.conf.subcommand("drive")]
    | Annotated[Teach, tyro.conf.subcommand("teach")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Simulate, tyro.conf.subcommand("simulate")]
    | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    | Annotated[Lineage, tyro.conf.subcommand("lineage")]
    | Annotated[Replay, tyro.conf.subcommand("replay")]
    | Annotated[Benchmark, tyro.conf.subcommand("benchmark")]
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command. Exit status: 0 done, 1 the run failed, 2 bad usage or bad input."""
    logging.getLogger("drake").setLevel(logging.WARNING)
    try:
        command = tyro.cli(
            Command,
            prog="drake-shared",
            description="Shared control for Drake: a person steers, a learner predicts where to.",
            args=arguments,
            config=(tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
        )
        command.run()
    except DrakeSharedError as error:
        print(f"drake-shared: {error}", file=sys.stderr)
        return 2 if isinstance(error, InputError) else 1
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
