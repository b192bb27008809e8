"""Collects demonstrations that a person drives on the page."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Collection
from pathlib import Path

from drake_shared.cockpit.demonstration_collector import DemonstrationCollector
from drake_shared.cockpit.drive import drive
from drake_shared.cockpit.server import DEFAULT_PORT
from drake_shared.common.console import say
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstrations
from drake_shared.scenario import Scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.teaching import human_alone


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

    The page asks for the route with the fewest demonstrations. Trials that miss the goal or touch an obstacle
    are discarded, and the person drives again; the page can discard others too. When interrupted, it returns
    the demonstrations collected so far; else a few seconds after the last one, which can be discarded until
    then.

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
        host=host,
        port=port,
        allowed_hosts=allowed_hosts,
        proxy=proxy,
        open_browser=open_browser,
        teaching=collector,
    )
    if not collector.demonstrations:
        raise RunError("no demonstration reached the goal without contact")
    if collector.unsaved:
        collector.save()
    return collector.collected()
