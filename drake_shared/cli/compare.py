"""``drake-shared compare``: all arbiters under the frozen benchmark."""

from __future__ import annotations

import dataclasses
import shlex
from typing import Any

from drake_shared.cli.command import OptionalInt, TaskCommand
from drake_shared.cli.common import print_json
from drake_shared.common.console import say


@dataclasses.dataclass(kw_only=True)
class Compare(TaskCommand):
    """Compares arbiters on the same trials with simulated operators, in shipped and generated scenes."""

    quick: bool = False
    """Few scenes and learners: minutes instead of hours, with wider intervals."""
    arbiters: tuple[str, ...] = ()
    """Names of arbiters; default: all that are registered. The human and the agent alone always take part."""
    scenes: OptionalInt = None
    """Number of generated scenes, of 50."""
    learners: OptionalInt = None
    """Number of learners in each shipped scenario."""
    demonstrations: tuple[int, ...] = ()
    """Numbers of demonstrations with which learners are taught; default: 3 10 60."""
    conditions: tuple[str, ...] = ()
    """Names of simulated operators, such as "noise 1.2"; default: all seven."""
    moving: bool = True
    """Whether obstacles that cross take part; these trials run in Drake, which takes longer."""
    json: bool = False
    """Print table and claims as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.experiments.compare import QUICK, Plan, compare, scene_set_hash
        from drake_shared.experiments.compare_scenes import SCENES

        base = QUICK if self.quick else Plan()
        given: dict[str, Any] = {
            "arbiters": self.arbiters or None,
            "scenes": self.scenes,
            "learners": self.learners,
            "demonstrations": self.demonstrations or None,
            "conditions": self.conditions or None,
            "moving": None if self.moving else False,
        }
        given = {name: value for name, value in given.items() if value is not None}
        plan = dataclasses.replace(base, **given)
        options = [f"--{name} {_text(value)}" for name, value in given.items() if name != "moving"]
        options += ["--no-moving"] if not self.moving else []
        section = compare(
            self.out,
            plan,
            workers=self.processes,
            resume=self.resume,
            force=self.force,
            command=" ".join(
                ["drake-shared compare --out DIR", *(["--quick"] if self.quick else []), *options]
            ),
            say=say,
        )
        (table,) = section.tables
        if self.json:
            print_json(
                {
                    "report": str(self.out / "report.html"),
                    "scenes": {"name": SCENES, "hash": scene_set_hash()},
                    "table": [dict(zip(table.head, row, strict=True)) for row in table.rows],
                    "claims": [dataclasses.asdict(claim) for claim in section.claims],
                }
            )
            return
        for row in [table.head, *table.rows]:
            print("\t".join(row))


def _text(value: object) -> str:
    return shlex.join(map(str, value if isinstance(value, tuple) else (value,)))
