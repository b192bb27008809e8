"""The frozen benchmark: every arbiter on the same trials in the same scenes, as a table and a figure."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from drake_shared.analysis.statistics import POINTS, Claim, judge, larger
from drake_shared.common.errors import InputError
from drake_shared.experiments.compare_figure import picture, table
from drake_shared.experiments.compare_scenes import COUNT, KINDS, SCENES, TUNING
from drake_shared.experiments.compare_trials import AGENT, CONDITIONS, HUMAN, run_case
from drake_shared.experiments.compare_tuning import BUDGET, tune
from drake_shared.experiments.measures import by_learner
from drake_shared.experiments.report import remove_report, write_report
from drake_shared.experiments.section import Rows, Section
from drake_shared.experiments.text import paragraphs
from drake_shared.scenario.files import scene_set, scene_set_file
from drake_shared.simulation.config import config_for
from drake_shared.simulation.runner import JsonStore, Progress, Task, run_tasks
from drake_shared.simulation.runner.identity import identity
from drake_shared.systems.arbiters import arbiter_names

SHIPPED = ("two_obstacles", "three_obstacles", "doorway")
TITLE = "Arbiters compared"
_LEAST = 2.0
"""Smallest difference of intent success of interest, in points."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan:
    """What is compared.

    Attributes:
        arbiters: Their names; the human alone is always among them.
        scenes: Number of generated scenes, from the first on, each with one learner for each number of
            demonstrations.
        learners: Number of learners in each shipped scenario, for each number of demonstrations.
        demonstrations: Numbers of demonstrations.
        moving: Whether scenes with moving obstacles take part; these trials run in Drake, which takes longer.
        conditions: Names of simulated operators in scenes as they were taught.

    Raises:
        InputError: A value is out of range, or an arbiter is unknown.
    """

    arbiters: tuple[str, ...] = ()
    scenes: int = COUNT
    learners: int = 20
    demonstrations: tuple[int, ...] = (3, 10, 60)
    moving: bool = True
    conditions: tuple[str, ...] = tuple(CONDITIONS)

    def __post_init__(self) -> None:
        known = arbiter_names()
        others = [name for name in known if name not in (HUMAN, AGENT)]
        chosen = [name for name in (self.arbiters or others) if name not in (HUMAN, AGENT)]
        for name in chosen:
            if name not in known:
                raise InputError("compare", "arbiters", f"must be among {', '.join(known)}", repr(name))
        object.__setattr__(self, "arbiters", (HUMAN, AGENT, *chosen))
        if not 0 <= self.scenes <= COUNT:
            raise InputError("compare", "scenes", f"must be from 0 to {COUNT}", self.scenes)
        if self.learners < 0 or self.learners + self.scenes == 0:
            raise InputError("compare", "learners", "must be at least 1 where there are no scenes")
        unknown = [name for name in self.conditions if name not in CONDITIONS]
        if unknown or not self.conditions:
            expected = f"must be among {', '.join(CONDITIONS)}"
            raise InputError("compare", "conditions", expected, ", ".join(unknown))
        if not self.demonstrations or not all(1 <= count <= 1000 for count in self.demonstrations):
            raise InputError("compare", "demonstrations", "must be from 1 to 1000", self.demonstrations)

    def cases(self) -> list[dict[str, Any]]:
        """Arguments of `run_case` for each scene and learner, without arbiters: the units of all tests."""
        pairs = [(scene, index) for index in range(self.learners) for scene in SHIPPED]
        pairs += [(f"{SCENES}/scene_{number:02d}", number) for number in range(self.scenes)]
        return [
            {
                "scene": scene,
                "changes": self._changes(scene, index),
                "index": index,
                "demonstrations": count,
                "conditions": list(self.conditions),
            }
            for count in self.demonstrations
            for scene, index in pairs
        ]

    def _changes(self, scene: str, number: int) -> dict[str, str]:
        kind = KINDS[number % len(KINDS)]
        if scene in SHIPPED or (kind == "moving" and not self.moving):
            return {}
        return {kind: f"{scene}_{kind}"}


QUICK = Plan(scenes=3, learners=1, demonstrations=(3,), moving=False)


def scene_set_hash() -> str:
    """The first 12 hexadecimal digits of the SHA-256 of the file of the scenes: results name it."""
    return hashlib.sha256(scene_set_file(SCENES).read_bytes()).hexdigest()[:12]


def compare(
    out: str | os.PathLike[str],
    plan: Plan,
    *,
    workers: int = 1,
    resume: bool = False,
    force: bool = False,
    command: str = "drake-shared compare --out DIR",
    progress: Progress | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Section:
    """Tunes the arbiters, runs all trials, and writes table, figure and rows to ``out``; see `write_report`.

    Args:
        out: Folder; it also holds the result of every task, so that a run can be resumed.
        plan: What is compared.
        workers: Number of local processes; the results do not depend on it.
        resume: Resume the run in ``out``.
        force: Overwrite the run in ``out``.
        command: That runs it again, for the report.
        progress: See `run_tasks`.
        say: Receives messages.

    Raises:
        InputError: See `JsonStore.open` and `run_tasks`.
        RunError: See `run_tasks`; or the report cannot be written.
    """
    start = time.perf_counter()
    description = {"plan": dataclasses.asdict(plan), "scenes": [SCENES, scene_set_hash()]}
    store = JsonStore.open(out, description, resume=resume, force=force)
    if force:
        remove_report(Path(out))
    reserved = [f"{SCENES}/{name}" for name in list(scene_set(SCENES)) if name in TUNING]
    tuning = [
        Task.of(tune, arbiter=name, scenes=reserved, demonstrations=plan.demonstrations[0])
        for name in plan.arbiters
        if name not in (HUMAN, AGENT)
    ]
    say(f"{len(tuning)} arbiters to tune, then {len(plan.cases())} cases with {len(plan.arbiters)} arbiters")
    tuned = run_tasks(tuning, store, workers=workers, progress=progress)
    chosen = [HUMAN, AGENT, *(found["arbiter"] for found in tuned)]
    tasks = [Task.of(run_case, arbiters=chosen, **case) for case in plan.cases()]
    results = run_tasks(tasks, store, workers=workers, progress=progress)
    rows = [
        {"case": number, **row, "arbiter": row["arbiter"].partition(":")[0]}
        for number, result in enumerate(results)
        for row in result
    ]
    section = report(rows, tuned)
    about = {"scenes": SCENES, "hash of the scenes": scene_set_hash(), "cases": len(tasks), **identity()}
    with store.writing():
        write_report(Path(out), [section], title=TITLE, about=about, rerun=command)
    say(f"wrote {Path(out) / 'report.html'} after {(time.perf_counter() - start) / 60.0:.1f} min")
    return section


def report(rows: Rows, tuned: Sequence[Mapping[str, Any]] = ()) -> Section:
    """The table, the figure and the tests of rows.

    Args:
        rows: Of `run_case`, with the number of their ``case``.
        tuned: Of `tune`.
    """
    changed = [found["arbiter"] for found in tuned if ":" in found["arbiter"]]
    return Section(
        title=TITLE,
        text=paragraphs(
            "compare",
            scenes=SCENES,
            hash=scene_set_hash(),
            cases=len({row["case"] for row in rows}),
            trials=sum(row["trials"] for row in rows),
            budget=BUDGET,
            reserved=len(TUNING),
            tuned=changed,
            least=_LEAST,
        ),
        tables=[table(rows)],
        pictures=[picture(rows)],
        claims=claims(rows),
        data={"compare": rows},
    )


def claims(rows: Rows) -> list[Claim]:
    """Intent success by case: each arbiter against the human alone, and the default one against others."""
    names = [name for name in dict.fromkeys(row["arbiter"] for row in rows) if name not in (HUMAN, AGENT)]
    default = config_for("default").arbitration
    pairs = [(name, HUMAN) for name in names]
    pairs += [(default, name) for name in names if name != default and default in names]
    questions = [
        larger(
            f"Intent success is higher with {one} than with {'the human alone' if other == HUMAN else other}",
            100.0 * by_learner(rows, "intent_success", unit="case", arbiter=one),
            100.0 * by_learner(rows, "intent_success", unit="case", arbiter=other),
            smallest=_LEAST,
            unit="points",
            bounds=POINTS,
            units="cases",
        )
        for one, other in pairs
    ]
    return judge("compare", questions)
