"""``drake-shared benchmark``: computing times compared with alternatives."""

from __future__ import annotations

import dataclasses
import json as json_library

from drake_shared.cli.command import Command, OptionalInt, OptionalPath
from drake_shared.cli.common import print_json
from drake_shared.common.console import say
from drake_shared.common.errors import InputError
from drake_shared.common.files import check_writable, replacing


@dataclasses.dataclass(kw_only=True)
class Benchmark(Command):
    """Measures predictions, trials, training, batches, lock-step, growth and safety as ratios in one run."""

    out: OptionalPath = None
    """Folder for benchmark.json and benchmark.png; default: the results are only printed."""
    only: tuple[str, ...] = ()
    """Which groups: predict, trial, training, together, batch, lockstep, many, growth, safety, arbiters;
    default: all."""
    quick: bool = False
    """Rough results within a minute or two instead of half an hour."""
    repeats: OptionalInt = None
    """How often each contender is timed; default: 15, quick: 5."""
    demos: OptionalPath = None
    """Demonstrations to train on; default: drives of a simulated operator."""
    test_demos: OptionalPath = None
    """Demonstrations to test the trained learners with."""
    json: bool = False
    """Print everything as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.experiments.benchmark.common import Setup
        from drake_shared.experiments.benchmark.groups import GROUPS, run_benchmark

        unknown = [name for name in self.only if name not in GROUPS]
        if unknown:
            raise InputError("benchmark", "only", f"must be among {', '.join(GROUPS)}", repr(unknown[0]))
        if self.repeats is not None and self.repeats < 1:
            raise InputError("benchmark", "repeats", "must be at least 1", self.repeats)
        if (self.demos is None) != (self.test_demos is None):
            raise InputError("benchmark", "demos", "must be given together with --test-demos")
        if self.out is not None:
            check_writable(self.out)
        setup = Setup(
            quick=self.quick,
            repeats=self.repeats or (5 if self.quick else 15),
            training_file=self.demos,
            test_file=self.test_demos,
            progress=say,
        )
        # Invalid files are reported before anything is measured.
        setup.read_files()
        report = run_benchmark(setup, self.only or tuple(GROUPS))
        if self.json:
            print_json(report.to_json())
        else:
            from drake_shared.experiments.benchmark.table import describe

            print("\n".join(describe(report)))
        if self.out is not None:
            from drake_shared.experiments.benchmark.figure import write_figure

            with replacing(self.out / "benchmark.json") as temporary:
                text = json_library.dumps(report.to_json(), indent=1, allow_nan=False)
                temporary.write_text(text + "\n", encoding="utf-8")
            write_figure(report, self.out / "benchmark.png")
            say(f"wrote {self.out / 'benchmark.json'} and benchmark.png")
