"""Collects the drives that become demonstrations."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import (
    Demonstration,
    Demonstrations,
    read_demonstrations,
    write_demonstrations,
)
from drake_shared.scenario import Scenario, clearance_scorer
from drake_shared.simulation.teaching import demonstration_of
from drake_shared.simulation.trial import Trial

_OPERATOR = "MouseInput"


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
        self._scenario = scenario
        self._score = clearance_scorer(scenario)
        self.wanted = wanted
        """Number of demonstrations to collect."""
        self._trials = 0
        self._void: str | None = None
        begun = self._begun()
        # Of earlier sessions: 0 and below.
        self._kept = {1 - len(begun) + index: item for index, item in enumerate(begun)}
        self.unsaved = False
        """Whether the file does not hold the demonstrations as they are now."""

    @property
    def demonstrations(self) -> list[Demonstration]:
        """The demonstrations so far."""
        return list(self._kept.values())

    @property
    def complete(self) -> bool:
        """Whether there are enough demonstrations."""
        return len(self._kept) >= self.wanted

    @property
    def next_route(self) -> str | None:
        """The route with the fewest demonstrations; None if the scenario names no routes."""
        counts = self._counts()
        return min(counts, key=counts.__getitem__, default=None)

    def __call__(self, trial: Trial) -> bool:
        """Adds ``trial``, the next one of the session, if it qualifies. Returns :attr:`complete`.

        Raises:
            RunError: The file cannot be written; the demonstration is kept, and written with the next one.
        """
        self._trials += 1
        self._void = "contact" if trial["contact"].any() else None
        if self._void is None and trial.status != "reached":
            self._void = "not_reached"
        if self._void is None:
            self._kept[self._trials] = demonstration_of(trial, score=self._score(trial.positions))
            self.unsaved = True
            self.save()
        return self.complete

    def discard(self, number: int) -> bool:
        """Forgets the demonstration of a trial of this session. Returns whether it was one.

        Args:
            number: Of the trial, from 1.

        Raises:
            RunError: The file cannot be written.
        """
        if number < 1 or self._kept.pop(number, None) is None:
            return False
        if number == self._trials:
            self._void = "discarded"
        self.unsaved = True
        self.save()
        return True

    def save(self) -> None:
        """Writes all demonstrations; removes the file if there are none.

        Raises:
            RunError: The file cannot be written.
        """
        if self._out is not None and self._kept:
            write_demonstrations(self._out, self.collected(), durable=True)
        elif self._out is not None:
            Path(self._out).unlink(missing_ok=True)
        self.unsaved = False

    def collected(self) -> Demonstrations:
        """All demonstrations so far."""
        return Demonstrations(
            items=tuple(self._kept.values()),
            metadata={"scenario": self._scenario.name, "operator": _OPERATOR},
        )

    def describe(self) -> dict[str, Any]:
        """Returns the ``teaching`` message: what was collected, and what became of the last trial."""
        return {
            "wanted": self.wanted,
            "kept": len(self._kept),
            "routes": self._counts(),
            "last": self._trials,
            "void": self._void,
        }

    def _counts(self) -> dict[str, int]:
        """Number of demonstrations of each route."""
        counts = dict.fromkeys((route.name for route in self._scenario.routes), 0)
        for item in self._kept.values():
            route = item.provenance.get("route")
            if route in counts:
                counts[route] += 1
        return counts

    def _begun(self) -> list[Demonstration]:
        """The demonstrations of a session that ended before there were enough."""
        if self._out is None or not os.path.isfile(self._out):
            return []
        try:
            found = read_demonstrations(self._out)
        except InputError:
            return []
        by_person = all(item.provenance.get("operator") == _OPERATOR for item in found)
        if found.scenario != self._scenario.name or not by_person or len(found) >= self.wanted:
            return []
        return list(found)
