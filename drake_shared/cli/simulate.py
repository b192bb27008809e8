"""``drake-shared simulate``: runs trials headless and reports metrics."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from drake_shared.cli.command import OptionalPath, OptionalText
from drake_shared.cli.common import open_learner, print_json
from drake_shared.cli.options import LearnerOptions, config_for_person
from drake_shared.cli.table import figure_lines, interval
from drake_shared.common.console import say
from drake_shared.common.errors import InputError
from drake_shared.common.suggestions import suggestion
from drake_shared.demonstrations.log_table import split_number
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import Scenario


@dataclasses.dataclass(kw_only=True)
class Simulate(LearnerOptions):
    """Runs trials of a simulated operator, as fast as the machine allows, and measures them."""

    trials: int = 1
    """Number of trials; the routes take turns."""
    seed: int = 0
    """Seed of the first trial; each following one has the next."""
    operator: str = "surrogate"
    """"surrogate", which the options below describe; a simulated operator by name: primary, noisy, laggy,
    delayed, signal-noise, late-slow, switching, stubborn, yielding, resting, unskilled, or for an arm steady,
    unsteady, aims-ahead, switches-planes; a registered one by name; or a log whose human commands are played
    back."""
    robot: OptionalText = None
    """Name of a registered robot, which drives in place of the scenario's; it needs an --operator that is
    registered, or a log of it. Default: the robot of the scenario."""
    behaviour: Annotated[Behaviour, tyro.conf.arg(name="")] = dataclasses.field(default_factory=Behaviour)
    person: OptionalText = None
    """Name of the driver, whose file (of fit-operator --person) starts the estimate of the noise with
    arbitration fusion; or that file. Default: nobody in particular."""
    workers: int = 1
    """Number of processes; the results do not depend on it."""
    out: OptionalPath = None
    """Folder for the logs; none are kept without it."""
    trials_per_log: int = 1
    """Most trials in one log. Several are written many times as fast; LOG#3 names trial 3 of a log."""
    resume: bool = False
    """Keep the trials whose logs are in the folder, and run the others."""
    force: bool = False
    """Overwrite the logs that are in the folder."""
    engine: Literal["auto", "drake", "lockstep"] = "auto"
    """"drake" runs a diagram for each trial, "lockstep" all trials together, as arrays, many times as fast;
    "auto" takes the latter wherever it can run the trials."""
    verbose: bool = False
    """Say which engine runs the trials, and why."""
    json: bool = False
    """Print everything as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        from tqdm import tqdm

        from drake_shared.analysis.batch import Batch, run_batch
        from drake_shared.analysis.metrics import summarize
        from drake_shared.scenario import load_scenario
        from drake_shared.systems.operators import registered_operators
        from drake_shared.systems.robots import make_robot

        scenario = load_scenario(self.scenario_source())
        robot = scenario.robot if self.robot is None else make_robot(self.robot, scenario=scenario)[0]
        self.control.faults.check_duration(scenario.duration)
        registered = self.operator if self.operator in registered_operators() else None
        behaviour, switching, recording = self._operator(scenario, registered)
        model = self._model(scenario)
        batch = Batch(
            scenario=self.scenario_source(),
            model=None if model is None else str(model),
            count=self.trials,
            seed=self.seed,
            config=config_for_person(self.control, self.person, robot),
            behaviour=behaviour,
            switching=switching,
            recording=recording,
            operator=registered,
            robot=self.robot,
            out=None if self.out is None else str(self.out),
            trials_per_log=self.trials_per_log,
            engine=self.engine,
        )
        inform = say if self.verbose else None
        ran = run_batch(batch, workers=self.workers, resume=self.resume, force=self.force, inform=inform)
        rows = list(tqdm(ran, total=self.trials, unit="trial", disable=None))
        measured = [{k: v for k, v in row.items() if k not in ("seed", "route", "log")} for row in rows]
        summary = summarize(measured)
        if self.json:
            print_json({"trials": rows, "summary": summary})
        else:
            print_summary(summary, len(rows), command_unit=robot.command_units[0])
        if self.out is not None:
            logs = f"{len(rows)} logs" if self.trials_per_log == 1 else f"logs of {len(rows)} trials"
            say(f"{logs} are in {self.out}" if self.resume else f"wrote {logs} to {self.out}")

    def _operator(self, scenario: Scenario, registered: str | None) -> tuple[Behaviour, bool, str | None]:
        """Behaviour, whether the operator changes route half-way, and the log to play back, if any."""
        from drake_shared.operators.named import operators_for
        from drake_shared.simulation.trial import read_log
        from drake_shared.systems.operators import registered_operators

        operators = operators_for(scenario.robot)
        if self.operator == "surrogate":
            return self.behaviour, False, None
        if self.operator in operators or registered is not None:
            plain = dataclasses.asdict(Behaviour())
            given = [name for name in plain if getattr(self.behaviour, name) != plain[name]]
            if given:
                options = ", ".join(f"--{name.replace('_', '-')}" for name in given)
                expected = f"has a behaviour of its own; leave out {options}"
                raise InputError(f"--operator {self.operator}", "", expected)
            if registered is not None:
                return self.behaviour, False, None
            named = operators[self.operator]
            return named.behaviour_in(scenario), named.switches, None
        if not Path(split_number(self.operator)[0]).exists():
            names = ("surrogate", *operators, *registered_operators())
            expected = f"must be a log or one of {', '.join(names)}; there is no such file"
            raise InputError(self.operator, "", f"{expected}{suggestion(self.operator, names)}")
        recorded = read_log(self.operator).metadata["scenario"]["name"]
        if recorded != scenario.name:
            say(f"warning: {self.operator} was recorded in scenario {recorded!r}, not {scenario.name!r}")
        return self.behaviour, False, self.operator

    def _model(self, scenario: Scenario) -> Path | None:
        if self.robot is not None and self.model is None:
            if self.control.driver == "human":
                return None
            expected = "must be given with --robot: the shipped learners are of the scenarios' robots"
            raise InputError("--model", "", expected)
        try:
            _, path = open_learner(scenario, self.model, self.preset)
        except InputError:
            # The human alone needs no learner; one that is given must exist.
            if self.control.driver == "human" and self.model is None:
                return None
            raise
        return path


def print_summary(summary: dict[str, Any], count: int, *, command_unit: str) -> None:
    """Writes the metrics of ``count`` trials of a robot with commands in ``command_unit`` as a table."""
    trials = "1 trial" if count == 1 else f"{count} trials"
    print(f"{trials} of a simulated operator: mean and 95% interval")
    # Completion times, for example, are of successes only.
    known = [
        (name, interval(values) + ("" if values["n"] == count else f"  in {values['n']}"))
        for name, values in summary.items()
        if values["mean"] is not None
    ]
    print("\n".join(figure_lines(known, command_unit=command_unit)))
