"""``drake-shared fit-operator``: fits a simulated operator to recorded trials."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from drake_shared.cli.command import Command, OptionalText
from drake_shared.cli.common import parquet_files, print_json
from drake_shared.common.console import say

if TYPE_CHECKING:
    from drake_shared.analysis.operator_fit import OperatorFit

_UNITS = {
    "skill": "",
    "aim_ahead": "m",
    "delay": "s",
    "noise": "",
    "noise_time": "s",
    "yielding": "",
    "plane_switch_time": "s",
}


@dataclasses.dataclass(kw_only=True)
class FitOperator(Command):
    """Fits skill, delay, noise and yielding of a simulated operator to recorded trials, with intervals."""

    logs: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Logs of trials of one operator in one scenario, each with its intended route, or folders of them."""
    person: OptionalText = None
    """Keep the noise of these drives as that of this person, for --person of drive and simulate: a name, or a
    file that ends with .json. Default: keep nothing."""
    json: bool = False
    """Print everything as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.analysis.driver_noise import person_of
        from drake_shared.analysis.operator_fit import fit_operator, settings_of
        from drake_shared.arbitration.person import person_path, write_person
        from drake_shared.simulation.log import Trial, read_logs

        trials: list[Trial] = []
        names: list[str] = []
        for log in parquet_files(self.logs):
            found = read_logs(log)
            trials += found.values()
            names += [str(log)] if len(found) == 1 else [f"{log}#{number}" for number in found]
        fit = fit_operator(trials, names=names)
        if self.person is not None:
            path = person_path(self.person)
            person, others = person_of(trials, names)
            for name, begin in others.items():
                say(f"{name} is left out of {path}: another driver from {begin:.1f} s on")
            write_person(person, path)
            say(f"wrote {path}")
        settings = settings_of(trials) if fit.simulated else {}
        if self.json:
            described = {"operator": _who(fit), **dataclasses.asdict(fit), "set": settings or None}
            print_json(described)
        else:
            print_fit(fit, settings, trials[0].robot.command_units[0])


def print_fit(fit: OperatorFit, settings: dict[str, Any], command_unit: str) -> None:
    """Prints a fit as a table.

    Args:
        fit: What was fitted.
        settings: What simulated operators had set, as far as it is known.
        command_unit: Of the noise.
    """
    trials = "1 trial" if fit.trials == 1 else f"{fit.trials} trials"
    print(f"a model fitted to {trials} ({fit.steps} steps) of a {_who(fit)}: value and 95% interval")
    for name, unit in _UNITS.items():
        estimate = getattr(fit, name)
        if estimate is None:
            if name == "yielding":
                print(f"  {name:12s} cannot be estimated: no trial was assisted")
            continue
        interval = "" if estimate.low is None else f"  [{estimate.low:.3g}, {estimate.high:.3g}]"
        known = f"  set to {settings[name]:g}" if name in settings else ""
        unit = command_unit if name == "noise" else unit
        print(f"  {name:12s} {estimate.value:8.3g} {unit:5s}{interval}{known}")
    print(f"  speed_factor {fit.speed_factor:8.3g}")
    print(
        f"it explains {fit.explained:.1%} of the variance of the commands, "
        f"and {fit.explained_a_step_ahead:.1%} a step ahead"
    )
    if not fit.simulated:
        print("a fit of a model to these drives; what it does elsewhere is that of a simulated operator")


def _who(fit: OperatorFit) -> str:
    return "simulated operator" if fit.simulated else "person"
