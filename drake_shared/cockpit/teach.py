"""Collects demonstrations that a person drives on the page."""

from __future__ import annotations

import dataclasses

from drake_shared.cockpit.drive import drive
from drake_shared.cockpit.server import DEFAULT_PORT
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.scenario import Scenario, clearance_scorer
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.teaching import demonstration_of, human_alone
from drake_shared.simulation.trial import Trial


def teach_by_mouse(
    scenario: Scenario,
    *,
    count: int | None = None,
    config: SharedControlConfig | None = None,
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    open_browser: bool = True,
) -> Demonstrations:
    """Returns demonstrations that a person drives without assistance, scored by clearance.

    Trials that miss the goal or touch an obstacle are discarded, and the person drives again. When
    interrupted, it returns the demonstrations collected so far.

    Args:
        scenario: The task.
        count: Number of demonstrations; if None, the number of the scenario's routes.
        config: Look-ahead, safety filter and faults; the human drives alone in any case.
        host, port, open_browser: See :func:`drake_shared.cockpit.drive.drive`.

    Raises:
        RunError: It was interrupted before the first demonstration.
        InputError: The port is in use.
    """
    wanted = len(scenario.routes) if count is None else count
    collector = DemonstrationCollector(scenario, wanted)
    drive(
        scenario,
        config=dataclasses.replace(human_alone(config), end="reached"),
        assist=False,
        host=host,
        port=port,
        open_browser=open_browser,
        on_trial=collector,
    )
    if not collector.demonstrations:
        raise RunError("no demonstration reached the goal without contact")
    return Demonstrations(
        items=tuple(collector.demonstrations), metadata={"scenario": scenario.name, "operator": "MouseInput"}
    )


class DemonstrationCollector:
    """Collects the trials that qualify as demonstrations.

    Args:
        scenario: The task; its obstacles give the scores.
        wanted: Number of demonstrations to collect.
    """

    def __init__(self, scenario: Scenario, wanted: int) -> None:
        self.demonstrations: list[Demonstration] = []
        self._score = clearance_scorer(scenario)
        self._wanted = wanted

    def __call__(self, trial: Trial) -> bool:
        """Adds ``trial`` if it qualifies. Returns whether there are enough demonstrations."""
        if trial.status == "reached" and not trial["contact"].any():
            self.demonstrations.append(demonstration_of(trial, score=self._score(trial.positions)))
        return len(self.demonstrations) >= self._wanted
