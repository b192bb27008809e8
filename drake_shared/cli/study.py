"""``drake-shared study``: plans, runs and analyses studies."""

from __future__ import annotations

import dataclasses
import functools
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from drake_shared.cli.command import Command, OptionalInt, OptionalText
from drake_shared.cli.common import parquet_files, print_json
from drake_shared.common.console import say
from drake_shared.common.errors import InputError

if TYPE_CHECKING:
    from drake_shared.study.store import StudyData

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
class Run(Command):
    """Serves the pages of participants and experimenter, or simulates participants headless."""

    folder: _FOLDER
    """Of the study, with its protocol."""
    simulate: OptionalInt = None
    """Number of simulated participants, for a dry run without people. Default: people, on the page."""
    page: bool = False
    """Let the simulated participants click, answer and drive on the pages, in Chromium, in real time."""
    pictures: Annotated[Path | None, tyro.conf.arg(metavar="FOLDER")] = None
    """Folder for a picture of each page that they see. Default: no pictures."""
    host: str = "127.0.0.1"
    """Address that the pages listen on. Anything but this machine's own shows them to the network."""
    port: int = 8090
    """Port that the pages listen on; 0 takes any that is free."""
    participants: tuple[str, ...] = ()
    """Those that this server takes, such as P01 P02; further servers take others. Default: all."""
    behind_proxy: OptionalText = None
    """Address under which a proxy shows the pages, such as https://lab.example:8090."""
    dropout: float = 0.0
    """Probability with which a simulated participant withdraws; not on the page."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.study.dry_run import simulate
        from drake_shared.study.store import StudyData

        data = StudyData(self.folder)
        if self.simulate is None or self.page:
            self._serve(data)
            return
        from tqdm import tqdm

        ran = simulate(data, self.simulate, dropout=self.dropout)
        done = list(tqdm(ran, total=self.simulate, unit="participant", disable=None))
        say(f"took {len(done)} simulated participants through {self.folder}")

    def _serve(self, data: StudyData) -> None:
        from drake_shared.study.links import EXPERIMENTER
        from drake_shared.study.server import StudyServer, run_study

        if self.page and self.simulate is None:
            raise InputError("study run", "--page", "needs --simulate, the number of simulated participants")

        def announce(server: StudyServer) -> None:
            for name in (EXPERIMENTER, *server.participants):
                print(f"{name}  {server.address_of(name)}", flush=True)

        server = StudyServer(
            data,
            host=self.host,
            port=self.port,
            participants=self.participants,
            proxy=self.behind_proxy,
            simulated=self.page,
        )
        if self.simulate is None:
            run_study(server, announce)
            return
        try:
            from drake_shared.study.simulated_page import simulate_on_page
        except ModuleNotFoundError as error:
            expected = f"needs {error.name}: pip install 'drake_shared[browser]'"
            raise InputError("study run", "--page", expected) from error
        visit = functools.partial(simulate_on_page, server, data, self.simulate, pictures=self.pictures)
        run_study(server, announce, visit)


@dataclasses.dataclass(kw_only=True)
class Status(Command):
    """Shows where each participant is, and the data checks."""

    folder: _FOLDER
    """Of the study, with its protocol."""
    json: bool = False
    """Print everything as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.study.analyze import data_checks
        from drake_shared.study.store import StudyData
        from drake_shared.study.tidy import trial_rows

        data = StudyData(self.folder)
        checks = data_checks(data, trial_rows(data))
        where: dict[str, dict[str, Any]] = {}
        for name, steps in data.steps.items():
            following, ended = data.next_step(name), data.ended(name)
            where[name] = {
                "completed": len(data.completed(name)),
                "steps": len(steps),
                "next": None if following is None else following.name,
                "ended": None if ended is None else f"{ended['kind']}: {ended['reason']}",
                "notes": data.notes(name),
            }
        if self.json:
            print_json({"protocol": data.protocol["hash"], "participants": where, "checks": dict(checks)})
            return
        for name, found in where.items():
            state = found["ended"] or (f"next {found['next']}" if found["next"] else "finished")
            print(f"{name}  {found['completed']:3d} of {found['steps']} steps  {state}")
        for check, finding in checks:
            print(f"{check}: {finding}")


@dataclasses.dataclass(kw_only=True)
class Analyze(Command):
    """Analyses the data as the protocol declares, and writes a report, tidy data and a notebook."""

    folder: _FOLDER
    """Of the study, with its protocol and data."""
    json: bool = False
    """Print contrasts and checks as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.study.analyze import analyze, write_analysis
        from drake_shared.study.store import StudyData

        data = StudyData(self.folder)
        found = analyze(data)
        page = write_analysis(data, found, rerun=f"drake-shared study analyze {self.folder}")
        if self.json:
            print_json({"report": str(page), **found.to_json()})
        else:
            for item in (*found.primary, *found.secondary):
                if math.isnan(item.mean):
                    print(f"too few participants for {item.measure.name}, {item.one} - {item.other}")
                    continue
                print(
                    f"{item.verdict:10s} {item.measure.name}, {item.one} - {item.other}: {item.mean:.3g} "
                    f"[{item.low:.3g}, {item.high:.3g}] (p = {item.p:.2g}, n = {item.participants})"
                )
        say(f"wrote {page}")


@dataclasses.dataclass(kw_only=True)
class StudyCommand(Command):
    """Studies with people: from a design to a report."""

    action: (
        Annotated[Init, tyro.conf.subcommand("init")]
        | Annotated[Plan, tyro.conf.subcommand("plan")]
        | Annotated[Run, tyro.conf.subcommand("run")]
        | Annotated[Status, tyro.conf.subcommand("status")]
        | Annotated[Analyze, tyro.conf.subcommand("analyze")]
    )

    def run(self) -> None:
        """Runs the command."""
        self.action.run()
