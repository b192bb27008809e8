"""``drake-shared drive``: the main job, a person who steers the robot on a web page."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Literal

from drake_shared.cli.common import open_learner
from drake_shared.common.files import check_writable


@dataclasses.dataclass(kw_only=True)
class Drive:
    """Serves the page on which a person steers the robot, trial after trial, until stopped."""

    model: Path | None = None
    """Learner; default: the one that ships for the scenario and preset."""
    preset: Literal["default", "paper"] = "default"
    """Which of the shipped learners."""
    scenario: str | None = None
    """Scenario file, or the name of a shipped one."""
    operator: Literal["mouse", "surrogate"] = "mouse"
    """Who drives: a person on the page, or a simulated operator, for a look."""
    assist: bool = True
    """Whether the agent shares the control at first; the page can switch it."""
    authority: str | None = None
    """What is left to the person: on, off, or changes such as "floor=0.3,conflict_time=off"; default: off
    with a learner of preset "paper", else on."""
    safety: float | None = None
    """Clearance that a safety filter keeps to every obstacle, in m; no filter without it."""
    record: Path = Path("logs")
    """Folder for the logs, one a trial."""
    host: str = "127.0.0.1"
    """Address to listen on. Anything but this machine's own shows the page to the network."""
    port: int = 8080
    """Port to listen on; 0 takes any that is free."""
    open: bool = True
    """Open the page in this machine's browser."""

    def run(self) -> None:
        """Does it."""
        from drake_shared.arbitration.authority import parse_authority
        from drake_shared.cockpit import drive
        from drake_shared.scenario import load_scenario
        from drake_shared.systems.safety_filter import check_clearance

        scenario = load_scenario(self.scenario)
        authority = None if self.authority is None else parse_authority(self.authority)
        if self.safety is not None:
            check_clearance(self.safety, source="drive")
        learner, _ = open_learner(scenario, self.model, self.preset)
        check_writable(self.record)
        drive(
            scenario,
            learner,
            operator=self.operator,
            assist=self.assist,
            authority=authority,
            safety_clearance=self.safety,
            record=self.record,
            host=self.host,
            port=self.port,
            open_browser=self.open,
        )
