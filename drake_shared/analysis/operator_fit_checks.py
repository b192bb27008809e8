"""Whether recorded trials can be fitted by a simulated operator, see `drake_shared.analysis.operator_fit`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drake_shared.analysis.operator_likelihood import DriveLikelihood
from drake_shared.common.errors import InputError
from drake_shared.robots import Arm, DiffDrive
from drake_shared.scenario import Scenario
from drake_shared.simulation.trial import Trial

# Least standard deviation of the commands, and least correction of an error, in the robot's units, that tell
# anything: those of a straight line are zero but for rounding.
_LEAST_VARIATION = 1e-6
_LEAST_MOTION = 0.08
"""Least distance moved, as a share of the length of the route."""


def check_trials(trials: Sequence[Trial], names: Sequence[str]) -> None:
    """Checks that the trials are of one operator who reacts, in one scenario.

    Raises:
        InputError: They are not.
    """
    first = trials[0].metadata
    for trial, name in zip(trials, names, strict=True):
        metadata = trial.metadata
        if trial.robot.type not in (DiffDrive.__name__, Arm.__name__):
            expected = "must be a differential drive or an arm, whose operators have a law"
            raise InputError(name, "robot", expected, trial.robot.type)
        if metadata.get("mode") not in ("shared", "human"):
            raise InputError(
                name,
                "mode",
                "must be shared or human, so that an operator steers",
                repr(metadata.get("mode")),
            )
        if metadata.get("operator") == "RecordedInput":
            raise InputError(name, "operator", "must react to the robot: a recording does not")
        if metadata.get("route") is None:
            raise InputError(name, "route", "must be given: the fit needs the intended route")
        if metadata.get("then") is not None:
            raise InputError(
                name, "then", "must not be given: the fit needs a single route", repr(metadata["then"])
            )
        for field in ("scenario", "preset", "operator"):
            if metadata.get(field) != first.get(field):
                raise InputError(name, field, f"must be that of {names[0]}")
        finite = np.isfinite(np.hstack([trial.positions, trial.commands("human")])).all(axis=1)
        if not finite.all():
            where = f"row {int(np.argmin(finite))}"
            raise InputError(name, where, "must hold a position and a human command without NaN")


def check_motion(trials: Sequence[Trial], names: Sequence[str], scenario: Scenario) -> None:
    """Checks that the robot moved in each trial.

    Raises:
        InputError: It did not.
    """
    for trial, name in zip(trials, names, strict=True):
        path = scenario.points_of(scenario.route(trial.metadata["route"]), 200)
        least = _LEAST_MOTION * float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        if np.linalg.norm(np.diff(trial.positions, axis=0), axis=1).sum() < least:
            raise InputError(name, "", f"must hold motion of at least {least:.2g} m")


def check_variation(drives: Sequence[DriveLikelihood], names: Sequence[str]) -> None:
    """Checks that commands vary and that there was an error to correct.

    Raises:
        InputError: They do not, or there was none.
    """
    commands = np.concatenate([drive.commands[drive.informative] for drive in drives])
    if commands.std(axis=0).max() < _LEAST_VARIATION:
        expected = (
            "must hold human commands that vary: constant ones show neither skill nor delay; add drives with "
            "turns"
        )
        raise InputError(all_of(names), "", expected)
    if max(drive.largest_correction for drive in drives) < _LEAST_VARIATION:
        expected = (
            "cannot be estimated from these drives: the robot never left its straight route, so that there "
            "was no error to correct; add drives with turns"
        )
        raise InputError(all_of(names), "skill", expected)


def all_of(names: Sequence[str]) -> str:
    """What names all trials in an error."""
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
