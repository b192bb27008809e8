"""``drake-shared reproduce``: the experiments of the paper and further ones, and their report."""

from __future__ import annotations

import dataclasses

from drake_shared.cli.command import OptionalText, TaskCommand
from drake_shared.cli.common import print_json
from drake_shared.common.console import say
from drake_shared.common.errors import InputError


@dataclasses.dataclass(kw_only=True)
class Reproduce(TaskCommand):
    """Runs the paper's experiments and further ones with simulated operators, and writes a report."""

    quick: bool = False
    """Few repeats: minutes instead of more than an hour, with wider intervals."""
    scenario: OptionalText = None
    """Scenario file, or the name of a shipped one."""
    only: tuple[str, ...] = ()
    """Names of experiments; default: all."""
    cluster: OptionalText = None
    """Address of a Dask scheduler (extra cluster), such as tcp://host:8786, to use instead."""
    json: bool = False
    """Print claims and verdicts as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.experiments.reproduce import reproduce
        from drake_shared.experiments.section import FULL, QUICK

        if self.cluster is not None and self.workers is not None:
            raise InputError("reproduce", "workers", "cannot be combined with --cluster, which has its own")
        sections = reproduce(
            self.out,
            size=QUICK if self.quick else FULL,
            scenario=self.scenario,
            only=self.only,
            workers=self.processes,
            cluster=self.cluster,
            resume=self.resume,
            force=self.force,
            say=say,
        )
        claims = [
            {"section": section.title, **dataclasses.asdict(claim)}
            for section in sections
            for claim in section.claims
        ]
        if self.json:
            print_json({"report": str(self.out / "report.html"), "claims": claims})
            return
        for section in sections:
            for claim in section.claims:
                found = claim.estimate
                print(
                    f"{claim.verdict:10s} {claim.text}: {found.mean:.3g} "
                    f"[{found.low:.3g}, {found.high:.3g}] {claim.unit} (n = {found.count})"
                )
