"""Demonstrations that a person drives on the page."""

from __future__ import annotations

from drake_shared.cockpit.drive import drive
from drake_shared.cockpit.server import DEFAULT_PORT
from drake_shared.common.errors import RunError
from drake_shared.demonstrations.demonstrations import Demonstration, Demonstrations
from drake_shared.scenario import Scenario, clearance_scorer
from drake_shared.simulation.teaching import demonstration_of
from drake_shared.simulation.trial import Trial


def teach_by_mouse(
    scenario: Scenario,
    *,
    count: int | None = None,
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    open_browser: bool = True,
) -> Demonstrations:
    """Demonstrations that a person drives without assistance, scored by clearance.

    Trials that miss the goal or touch an obstacle do not count and are driven again. Interrupted, it
    keeps what there is.

    Args:
        scenario: The task.
        count: How many; as many as the scenario has routes if None.
        host, port, open_browser: See :func:`drake_shared.cockpit.drive.drive`.

    Raises:
        RunError: It was interrupted before there was any.
        InputError: The port is in use.
    """
    wanted = len(scenario.routes) if count is None else count
    keeper = Keeper(scenario, wanted)
    drive(scenario, assist=False, host=host, port=port, open_browser=open_browser, on_trial=keeper)
    if not keeper.driven:
        raise RunError("no demonstration reached the goal without contact")
    return Demonstrations(
        items=tuple(keeper.driven), metadata={"scenario": scenario.name, "operator": "MouseInput"}
    )


class Keeper:
    """Keeps the trials that make demonstrations.

    Args:
        scenario: The task, which scores them.
        wanted: How many are enough.
    """

    def __init__(self, scenario: Scenario, wanted: int) -> None:
        self.driven: list[Demonstration] = []
        self._score = clearance_scorer(scenario)
        self._wanted = wanted

    def __call__(self, trial: Trial) -> bool:
        """Keeps ``trial`` if it is good, and says whether there are enough."""
        if trial.status == "reached" and not trial["contact"].any():
            self.driven.append(demonstration_of(trial, score=self._score(trial.positions)))
        return len(self.driven) >= self._wanted
