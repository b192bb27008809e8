"""``drake-shared drive``: a person steers the robot on a web page."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from drake_shared.cli.command import OptionalText
from drake_shared.cli.common import open_learner, shipped_model
from drake_shared.cli.options import LearnerOptions, PageOptions, config_for_person
from drake_shared.common.console import say
from drake_shared.common.files import check_writable


@dataclasses.dataclass(kw_only=True)
class Drive(PageOptions, LearnerOptions):
    """Serves the page on which a person steers the robot, trial after trial, until stopped."""

    operator: str = "mouse"
    """Human input: "mouse" for a person on the page, "surrogate" for a simulated operator to watch, or a
    registered one by its name."""
    assist: bool = True
    """Whether the agent shares the control at first; the page can switch it."""
    route: str = "free"
    """Route that the person is asked to drive, drawn on the page: its name, "ask" (before each drive) or
    "free". Logs carry it."""
    person: OptionalText = None
    """Name of the driver, whose file (of fit-operator --person) starts the estimate of the noise with
    arbitration fusion; or that file. Default: nobody in particular."""
    record: Path = Path("logs")
    """Folder for the logs, one a trial."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.cockpit import drive
        from drake_shared.scenario import load_scenario

        scenario = load_scenario(self.scenario_source())
        learner = None
        if self.model is None and shipped_model(scenario.name, self.preset) is None:
            say(f"No learner is known for scenario {scenario.name!r} (--model names one): you drive alone.")
        else:
            learner, _ = open_learner(scenario, self.model, self.preset)
        check_writable(self.record)
        drive(
            scenario,
            learner,
            config=config_for_person(self.control, self.person, scenario.robot),
            operator=self.operator,
            assist=self.assist,
            route=self.route,
            record=self.record,
            **self.page(),
        )
