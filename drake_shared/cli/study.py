"""``drake-shared study``: plans, runs and analyses studies."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Literal

import tyro

from drake_shared.cli.command import Command, OptionalText
from drake_shared.cli.common import parquet_files, print_json
from drake_shared.common.console import say
from drake_shared.common.errors import InputError

_FOLDER = tyro.conf.Positional[Path]


@dataclasses.dataclass(kw_only=True)
class Init(Command):
    """Writes a commented study.yaml, to be changed to the study."""

    folder: _FOLDER
    """Of the study; created if needed."""
    template: Literal["assistance", "paper_setups", "arbiters"] = "assistance"
    """"assistance": alone against shared control; "paper_setups": the paper's Setup 1 against Setup 2;
    "arbiters": three of them, between participants."""

    def run(self) -> None:
        """Runs the command."""
        import drake_shared.study
        from drake_shared.common.files import replacing
        from drake_shared.study.protocol import STUDY_FILE

        target = self.folder / STUDY_FILE
        if target.exists():
            raise InputError(target, "", "must not exist: it would be overwritten")
        source = Path(drake_shared.study.__file__).parent / "templates" / f"{self.template}.yaml"
        with replacing(target) as temporary:
            temporary.write_bytes(source.read_bytes())
        say(f"wrote {target}; change it, then: drake-shared study plan {self.folder}")


@dataclasses.dataclass(kw_only=True)
class Plan(Command):
    """Checks the study, shows orders, duration and power, and writes its hashed, dated protocol."""

    folder: _FOLDER
    """Of the study."""
    pilot: tuple[Path, ...] = ()
    """Folders of pilot logs, one for each person, to which simulated participants are fitted."""
    pool: int = 40
    """Number of simulated participants from which the power is estimated; 0 leaves it out."""
    amend: OptionalText = None
    """Reason for a change after the first participant; it is logged in the protocol."""
    json: bool = False
    """Print everything as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.simulation.log import read_logs
        from drake_shared.study.design import load_study
        from drake_shared.study.orders import imbalance
        from drake_shared.study.power import power_of
        from drake_shared.study.protocol import STUDY_FILE, plan
        from drake_shared.study.simulated import fitted_behaviour
        from drake_shared.study.steps import expected_minutes

        study = load_study(self.folder / STUDY_FILE)
        if self.pool < 0 or self.pool == 1:
            raise InputError("study plan", "--pool", "must be 0, or at least 2", self.pool)
        fitted = []
        for person in self.pilot:
            logs = [trial for file in parquet_files([person]) for trial in read_logs(file).values()]
            fitted.append(fitted_behaviour(logs, [f"{person} ({index})" for index in range(len(logs))]))
        powers = power_of(study, pool=self.pool, fitted=fitted) if self.pool else []
        protocol, changes = plan(self.folder, amend=self.amend)
        minutes = expected_minutes(study, study.load_scenario())
        places, pairs = imbalance(study.orders())
        if self.json:
            shown = {name: protocol[name] for name in ("hash", "created", "amendments")}
            shown |= {"orders": protocol["content"]["orders"], "minutes": minutes, "changes": changes}
            shown |= {"imbalance": {"places": places, "pairs": pairs}}
            print_json(shown | {"power": [dataclasses.asdict(power) for power in powers]})
            return
        for participant, order in protocol["content"]["orders"].items():
            print(f"{participant}  {', '.join(order)}")
        if places or pairs:
            print(f"orders are not balanced: places differ by {places}, pairs by {pairs}")
        print(f"about {minutes:.0f} minutes for a participant")
        who = f"{len(fitted)} fitted operators" if fitted else "simulated operators, not people"
        for power in powers:
            enough = "more than eight times as many" if power.enough is None else power.enough
            print(
                f"power {power.power:.0%} with {study.participants} participants for {power.measure}, "
                f"{power.contrast} (SD {power.spread:.3g}, by {who}); 80% needs {enough}"
            )
        for change in changes:
            say(f"changed: {change}")
        say(f"protocol of {protocol['created']}, hash {protocol['hash']}")


@dataclasses.dataclass(kw_only=True)
class StudyCommand(Command):
    """Studies with people: from a design to a report."""

    action: Annotated[Init, tyro.conf.subcommand("init")] | Annotated[Plan, tyro.conf.subcommand("plan")]

    def run(self) -> None:
        """Runs the command."""
        self.action.run()
