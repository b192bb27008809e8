"""The noise of a driver, estimated from recorded trials."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.driver_change import DriverChange
from drake_shared.arbitration.fusion import Fusion
from drake_shared.arbitration.fusion_model import FusionModel
from drake_shared.arbitration.person import Person
from drake_shared.arbitration.routes import routes_of
from drake_shared.arbitration.rule import ArbiterInputs
from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.scenario import scenario_from_dict
from drake_shared.scenario.route_planner import plan_routes
from drake_shared.simulation.log import Trial

Floats = NDArray[np.float64]

# Share of each person's prior that stays that of everybody.
_EVERYBODY = 0.1
# Two drives that differ do not tell which of them is the person's.
_FEWEST = 3


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class DriveNoise:
    """The noise found in one trial.

    Attributes:
        times: Shape (n,), of the steps with a command, in [s].
        probability: Shape (n, G), of each pair of noise and time constant in each of these steps.
        period: Of the control step, in [s].
    """

    times: Floats
    probability: Floats
    period: float


def person_of(
    trials: Sequence[Trial], names: Sequence[str], model: FusionModel | None = None
) -> tuple[Person, Mapping[str, float]]:
    """The noise of the person who drove ``trials``, from the posterior of the commands recorded there.

    A trial in which another driver is noticed, beside what the other trials have in common, is left out.

    Args:
        trials: With a differential drive, in any scenarios.
        names: Of the trials, for errors.
        model: Of a driver.

    Returns:
        The person, and by name when in each trial that is left out, in [s], the other driver begins.

    Raises:
        InputError: A trial is of another robot than the first, none of them holds commands, or another driver
            is noticed in half of them or more.
    """
    model = model or FusionModel()
    found = noise_of(trials, names, model)
    if not found:
        raise InputError("fit-operator", "logs", "must hold commands of a person")
    others = {} if len(found) < _FEWEST else _other_drivers(found, model)
    if 2 * len(others) >= len(found):
        expected = f"and {len(others) - 1} of the other drives have noises that differ"
        raise InputError(next(iter(others)), "", f"{expected}; give drives of one person")
    own = {name: drive for name, drive in found.items() if name not in others}
    person = Person(
        robot=trials[0].robot.to_json(),
        noises=model.noises,
        noise_times=model.noise_times,
        probability=tuple(float(f"{value:.4g}") for value in prior_of(list(own.values()))),
        trials=len(own),
    )
    return person, others


def noise_of(trials: Sequence[Trial], names: Sequence[str], model: FusionModel) -> dict[str, DriveNoise]:
    """The noise found in each trial that holds commands, by its name; see `person_of`."""
    by_scenario: dict[str, list[int]] = {}
    for index, (trial, name) in enumerate(zip(trials, names, strict=True)):
        if trial.robot != trials[0].robot:
            raise InputError(name, "robot", f"must be that of {names[0]}")
        scenario = json.dumps(trial.metadata["scenario"], sort_keys=True)
        by_scenario.setdefault(scenario, []).append(index)
    found: dict[int, DriveNoise] = {}
    for indices in by_scenario.values():
        fusion = _fusion_of(trials[indices[0]], names[indices[0]], model)
        drives = _noise_in([trials[index] for index in indices], fusion)
        found |= dict(zip(indices, drives, strict=True))
    return {names[index]: found[index] for index in sorted(found) if len(found[index].times)}


def prior_of(drives: Sequence[DriveNoise]) -> Floats:
    """Probability (G,) of each pair, as the file of the person who drove holds it."""
    mean = np.mean([drive.probability.mean(axis=0) for drive in drives], axis=0)
    return np.asarray((1.0 - _EVERYBODY) * mean + _EVERYBODY / len(mean))


def _other_drivers(found: Mapping[str, DriveNoise], model: FusionModel) -> dict[str, float]:
    """When another driver begins, in [s], in each drive in which one is noticed beside the other drives."""
    begins = {}
    for name, drive in found.items():
        prior = prior_of([other for key, other in found.items() if key != name])
        change = DriverChange(
            prior, period=drive.period, memory=model.noise_memory, false_notices=model.false_notices
        )
        cusum, another, gives = np.zeros(1), np.zeros(1), np.ones(1, bool)
        begin = drive.times[0]
        for time, noise in zip(drive.times, drive.probability, strict=True):
            if cusum.item() == 0.0:
                begin = time
            cusum, another, _ = change.step(cusum, another, noise[:, None], gives)
            if another.any():
                begins[name] = float(begin)
                break
    return begins


def _fusion_of(trial: Trial, name: str, model: FusionModel) -> Fusion:
    """The fusion with the routes of a trial's scenario."""
    scenario = scenario_from_dict(trial.metadata["scenario"], source=f"{name}: scenario")
    robot = scenario.robot
    if not isinstance(robot, DiffDrive):
        raise InputError(name, "robot", "must be a differential drive")
    routes = routes_of(scenario, [], plan_routes(scenario))
    return Fusion(model, routes, scenario=scenario, robot=robot, period=scenario.control_period)


def _noise_in(trials: Sequence[Trial], fusion: Fusion) -> list[DriveNoise]:
    """The noise found by ``fusion`` in each trial, all of one scenario."""
    poses = _together([np.stack([one[name] for name in one.robot.configuration_names]) for one in trials])
    clearance = _together([one["clearance"] for one in trials])
    drives = [np.nan_to_num(one.commands("human").T) for one in trials]
    human = _together([np.pad(drive, ((0, 0), (0, 1))) for drive in drives])
    nothing, found = np.full(len(trials), np.nan), []
    state = fusion.initial_state(len(trials))
    with np.errstate(invalid="ignore"):
        for step in range(len(clearance)):
            inputs = ArbiterInputs(
                human=human[step],
                autonomous=human[step],
                confidence=nothing,
                pose=poses[step],
                clearance=clearance[step],
            )
            _, _, state = fusion.step(state, inputs)
            found.append(fusion.noise_probability(state))
    probability = np.stack(found)
    noises = []
    for index, (trial, drive) in enumerate(zip(trials, drives, strict=True)):
        steps = np.flatnonzero(drive.any(axis=0))
        period = float(trial.metadata["scenario"]["control_period"])
        noises.append(
            DriveNoise(times=trial["t"][steps], probability=probability[steps, :, index], period=period)
        )
    return noises


def _together(values: Sequence[Floats]) -> Floats:
    """Arrays (..., T) of different lengths as one (T, ..., n), in which the last value of each stays."""
    steps = np.arange(max(item.shape[-1] for item in values))
    return np.stack(
        [np.moveaxis(item[..., np.minimum(steps, item.shape[-1] - 1)], -1, 0) for item in values], -1
    )
