"""``drake-shared drive``: a person steers the robot on a web page."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Literal

from drake_shared.cli.common import open_learner, shipped_model
from drake_shared.cli.options import LearnerOptions
from drake_shared.common.console import say
from drake_shared.common.files import check_writable


@dataclasses.dataclass(kw_only=True)
class Drive(LearnerOptions):
    """Serves the page on which a person steers the robot, trial after trial, until stopped."""

    operator: Literal["mouse", "surrogate"] = "mouse"
    """Human input: a person on the page, or a simulated operator to watch."""
    assist: bool = True
    """Whether the agent shares the control at first; the page can switch it."""
    record: Path = Path("logs")
    """Folder for the logs, one a trial."""
    host: str = "127.0.0.1"
    """Address to listen on. Anything but this machine's own shows the page to the network."""
    port: int = 8080
    """Port to listen on; 0 takes any that is free."""
    open: bool = True
    """Open the page in this machine's browser."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.cockpit import drive
        from drake_shared.scenario import load_scenario

        scenario = load_scenario(self.scenario)
        learner = None
        if self.model is None and shipped_model(scenario.name, self.preset) is None:
            say(f"No learner is known for scenario {scenario.name!r} (--model names one): you drive alone.")
        else:
            learner, _ = open_learner(scenario, self.model, self.preset)
        check_writable(self.record)
        drive(
            scenario,
            learner,
            config=self.control,
            operator=self.operator,
            assist=self.assist,
            record=self.record,
            host=self.host,
            port=self.port,
            open_browser=self.open,
        )
