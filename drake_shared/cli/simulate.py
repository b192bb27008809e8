"""``drake-shared simulate``: trials without a page, and what they say."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from drake_shared.cli.common import open_learner, print_json, say
from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import Behaviour


@dataclasses.dataclass(kw_only=True)
class Simulate:
    """Runs trials of a simulated operator, as fast as the machine allows, and measures them."""

    model: Path | None = None
    """Learner; default: the one that ships for the scenario and preset."""
    preset: Literal["default", "paper"] = "default"
    """Which of the shipped learners."""
    scenario: str | None = None
    """Scenario file, or the name of a shipped one."""
    trials: int = 1
    """How many; the routes take turns."""
    seed: int = 0
    """Of the first trial; each following one has the next."""
    mode: Literal["shared", "human", "agent"] = "shared"
    """Shared control, the operator alone, or the agent alone."""
    arbitration: str = "blend"
    """Who divides the control: blend (by confidence), halves, traded, human, agent, or a registered one."""
    authority: str | None = None
    """What the blend leaves to the operator: on, off, or changes such as "floor=0.3,conflict_time=off";
    default: off with a learner of preset "paper", else on."""
    operator: str = "surrogate"
    """"surrogate", which the options below describe; a simulated operator by name: primary, noisy, laggy,
    delayed, signal-noise, late-slow, switching, stubborn, yielding, resting, unskilled; or a log whose human
    commands are played back."""
    confidence_gain: float | None = None
    """K of eq. (1), per m^2; default: the learner's own."""
    end: Literal["reached", "duration"] = "reached"
    """End at the goal, or always at T."""
    safety: float | None = None
    """Clearance that a safety filter keeps to every obstacle, in m; no filter without it."""
    fault: str | None = None
    """What goes wrong, as NAME=VALUE,...: delay, jitter (s), loss, freeze_time, freeze (s) and human_nan of
    the human's command; pose_noise, pose_drift (m), yaw_noise (rad) and pose_nan of the pose; slip of the
    wheels; late_learner (s) and learner_nan. What is no length or time is a share, from 0 to 1."""
    behaviour: Annotated[Behaviour, tyro.conf.arg(name="")] = dataclasses.field(default_factory=Behaviour)
    workers: int = 1
    """Processes; the results do not depend on it."""
    out: Path | None = None
    """Folder for the logs; none are kept without it."""
    resume: bool = False
    """Take the trials whose logs are in the folder from there, and run the others."""
    force: bool = False
    """Begin anew in place of the logs that are in the folder."""
    json: bool = False
    """Print everything as one JSON object."""

    def run(self) -> None:
        """Does it."""
        from tqdm import tqdm

        from drake_shared.analysis.batch import Batch, run_batch
        from drake_shared.analysis.metrics import summarize
        from drake_shared.arbitration.authority import parse_authority
        from drake_shared.scenario import load_scenario
        from drake_shared.simulation.faults import parse_faults
        from drake_shared.systems.safety_filter import check_clearance

        scenario = load_scenario(self.scenario)
        if self.confidence_gain is not None and not 0 < self.confidence_gain < float("inf"):
            raise InputError(
                "simulate", "confidence-gain", "must be positive and finite", self.confidence_gain
            )
        behaviour, switching, recording = self._operator(scenario)
        if self.safety is not None:
            check_clearance(self.safety, source="simulate")
        faults = None if self.fault is None else parse_faults(self.fault)
        if faults is not None:
            alone = self.arbitration if self.arbitration in ("human", "agent") else self.mode
            faults.check(mode=alone, duration=scenario.duration)
        model = self._model(scenario)
        batch = Batch(
            scenario=self.scenario,
            model=None if model is None else str(model),
            count=self.trials,
            seed=self.seed,
            mode=self.mode,
            arbitration=self.arbitration,
            authority=None if self.authority is None else parse_authority(self.authority),
            behaviour=behaviour,
            switching=switching,
            recording=recording,
            confidence_gain=self.confidence_gain,
            end=self.end,
            safety_clearance=self.safety,
            faults=faults,
            out=None if self.out is None else str(self.out),
        )
        ran = run_batch(batch, workers=self.workers, resume=self.resume, force=self.force)
        rows = list(tqdm(ran, total=self.trials, unit="trial", disable=None))
        measured = [{k: v for k, v in row.items() if k not in ("seed", "route", "log")} for row in rows]
        summary = summarize(measured)
        if self.json:
            print_json({"trials": rows, "summary": summary})
        else:
            print_summary(summary, len(rows))
        if self.out is not None:
            say(
                f"{len(rows)} logs are in {self.out}"
                if self.resume
                else f"wrote {len(rows)} logs to {self.out}"
            )

    def _operator(self, scenario) -> tuple[Behaviour, bool, str | None]:
        """Behaviour, whether the route changes half-way, and the log to play back, if any."""
        from drake_shared.operators.named import OPERATORS
        from drake_shared.simulation.trial import read_log

        if self.operator == "surrogate":
            return self.behaviour, False, None
        if self.operator in OPERATORS:
            named = OPERATORS[self.operator]
            plain = dataclasses.asdict(Behaviour())
            given = [name for name in plain if getattr(self.behaviour, name) != plain[name]]
            if given:
                options = ", ".join(f"--{name.replace('_', '-')}" for name in given)
                raise InputError(
                    f"--operator {self.operator}", "", f"has a behaviour of its own; leave out {options}"
                )
            return named.behaviour_in(scenario), named.switches, None
        if not Path(self.operator).exists():
            names = ", ".join(("surrogate", *OPERATORS))
            raise InputError(self.operator, "", f"must be a log or one of {names}; there is no such file")
        recorded = read_log(self.operator).metadata["scenario"]["name"]
        if recorded != scenario.name:
            say(f"warning: {self.operator} was recorded in scenario {recorded!r}, not {scenario.name!r}")
        return self.behaviour, False, self.operator

    def _model(self, scenario) -> Path | None:
        try:
            _, path = open_learner(scenario, self.model, self.preset)
        except InputError:
            # Someone who drives alone needs no learner; one that was asked for must be there.
            if "human" in (self.mode, self.arbitration) and self.model is None:
                return None
            raise
        return path


def print_summary(summary: dict[str, Any], count: int) -> None:
    """Writes the measures of ``count`` trials as a table, for people."""
    print(f"{count} trials of a simulated operator: mean and 95% interval")
    for name, values in summary.items():
        if values["mean"] is None:
            continue
        interval = "" if values["low"] is None else f"  [{values['low']:.4g}, {values['high']:.4g}]"
        print(f"  {name:24s} {values['mean']:10.4g}{interval}")
