"""Collects demonstrations that a person drives on the page."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Collection
from pathlib import Path

from drake_shared.cockpit.drive import drive
from drake_shared.cockpit.server import DEFAULT_PORT
from drake_shared.common.console import say
from drake_shared.common.errors import InputError, RunError
from drake_shared.demonstrations import (
    Demonstration,
    Demonstrations,
    read_demonstrations,
    write_demonstrations,
)
from drake_shared.scenario import Scenario, clearance_scorer
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.teaching import demonstration_of, human_alone
from drake_shared.simulation.trial import Trial

_OPERATOR = "MouseInput"


def teach_by_mouse(
    scenario: Scenario,
    *,
    count: int | None = None,
    out: str | os.PathLike[str] | None = None,
    config: SharedControlConfig | None = None,
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    allowed_hosts: Collection[str] = (),
    proxy: str | None = None,
    open_browser: bool = True,
    report: Callable[[str], None] = say,
) -> Demonstrations:
    """Returns demonstrations that a person drives without assistance, scored by clearance.

    Trials that miss the goal or touch an obstacle are discarded, and the person drives again. When
    interrupted, it returns the demonstrations collected so far.

    Args:
        scenario: The task.
        count: Number of demonstrations; if None, the number of the scenario's routes.
        out: File that holds all demonstrations so far whenever one ends; a session that finds one there with
            fewer than ``count`` continues it. If the program is killed, the next session with a file in the
            same folder saves what was driven of the trial under way as a log. If None, nothing is saved.
        config: Look-ahead, safety filter and faults; the human drives alone in any case.
        host, port, allowed_hosts, proxy, open_browser: See :func:`drake_shared.cockpit.drive.drive`.
        report: Called with messages for the user.

    Raises:
        RunError: It was interrupted before the first demonstration, or the file cannot be written.
        InputError: The port is in use, or a folder cannot be written to.
    """
    wanted = len(scenario.routes) if count is None else count
    collector = DemonstrationCollector(scenario, wanted, out=out)
    if collector.demonstrations:
        report(f"{out} holds {len(collector.demonstrations)} of {wanted} demonstrations; continuing")
    drive(
        scenario,
        config=dataclasses.replace(human_alone(config), end="reached"),
        assist=False,
        record=None if out is None else Path(out).parent,
        keep_logs=False,
        host=host,
        port=port,
        allowed_hosts=allowed_hosts,
        proxy=proxy,
        open_browser=open_browser,
        on_trial=collector,
    )
    if not collector.demonstrations:
        raise RunError("no demonstration reached the goal without contact")
    if collector.unsaved:
        collector.save()
    return collector.collected()


class DemonstrationCollector:
    """Collects the trials that qualify as demonstrations, and saves each at once.

    Args:
        scenario: The task; its obstacles give the scores.
        wanted: Number of demonstrations to collect.
        out: File for them; None saves nothing. One that holds fewer demonstrations of this scenario by a
            person than ``wanted`` is continued.
    """

    def __init__(self, scenario: Scenario, wanted: int, *, out: str | os.PathLike[str] | None = None) -> None:
        self._out = out
        self._scenario = scenario.name
        self._score = clearance_scorer(scenario)
        self._wanted = wanted
        self.demonstrations: list[Demonstration] = self._begun()
        self.unsaved = False
        """Whether there are demonstrations that could not be written yet."""

    def __call__(self, trial: Trial) -> bool:
        """Adds ``trial`` if it qualifies. Returns whether there are enough demonstrations.

        Raises:
            RunError: The file cannot be written; the demonstration is kept, and written with the next one.
        """
        if trial.status == "reached" and not trial["contact"].any():
            self.demonstrations.append(demonstration_of(trial, score=self._score(trial.positions)))
            self.unsaved = True
            self.save()
        return len(self.demonstrations) >= self._wanted

    def save(self) -> None:
        """Writes all demonstrations.

        Raises:
            RunError: The file cannot be written.
        """
        if self._out is not None:
            write_demonstrations(self._out, self.collected(), durable=True)
        self.unsaved = False

    def collected(self) -> Demonstrations:
        """All demonstrations so far."""
        return Demonstrations(
            items=tuple(self.demonstrations), metadata={"scenario": self._scenario, "operator": _OPERATOR}
        )

    def _begun(self) -> list[Demonstration]:
        """The demonstrations of a session that ended before there were enough."""
        if self._out is None or not os.path.isfile(self._out):
            return []
        try:
            found = read_demonstrations(self._out)
        except InputError:
            return []
        by_person = all(item.provenance.get("operator") == _OPERATOR for item in found)
        if found.scenario != self._scenario or not by_person or len(found) >= self._wanted:
            return []
        return list(found)
