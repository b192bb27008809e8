"""``drake-shared teach``: records demonstrations without assistance, and scores them."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Literal

import tyro

from drake_shared.cli.command import OptionalInt
from drake_shared.cli.options import ControlOptions, PageOptions
from drake_shared.common.console import say
from drake_shared.common.errors import InputError
from drake_shared.common.files import check_target
from drake_shared.operators.behaviour import Behaviour


@dataclasses.dataclass(kw_only=True)
class Teach(PageOptions, ControlOptions):
    """Records demonstrations without assistance and scores each by its clearance."""

    out: Path
    """Parquet file to write. With the mouse each demonstration is in it as soon as it ends; a file that holds
    fewer than the number wanted is continued."""
    operator: Literal["mouse", "surrogate"] = "surrogate"
    """Who drives: a person on the page, or a simulated operator along each route in turn."""
    count: OptionalInt = None
    """Number of demonstrations; default: one for each route."""
    seed: int = 0
    """Seed of the first one's noise; each following one has the next."""
    behaviour: Annotated[Behaviour, tyro.conf.arg(name="")] = dataclasses.field(default_factory=Behaviour)

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.demonstrations import write_demonstrations
        from drake_shared.scenario import load_scenario
        from drake_shared.simulation.teaching import teach

        scenario = load_scenario(self.scenario)
        if self.count is not None and self.count < 1:
            raise InputError("teach", "count", "must be at least 1", self.count)
        check_target(self.out)
        if self.operator == "mouse":
            from drake_shared.cockpit.teach import teach_by_mouse

            demonstrations = teach_by_mouse(
                scenario,
                count=self.count,
                out=self.out,
                config=self.control,
                **self.page(),
            )
        else:
            demonstrations = teach(
                scenario, count=self.count, seed=self.seed, config=self.control, behaviour=self.behaviour
            )
            write_demonstrations(self.out, demonstrations)
        for index, item in enumerate(demonstrations):
            route = item.provenance.get("route") or "free"
            clearance = "no obstacles" if item.score is None else f"clearance {item.score:.3f} m"
            say(f"demonstration {index}: route {route}, {clearance}")
        say(f"wrote {self.out}")
