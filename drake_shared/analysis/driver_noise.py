"""The noise of a driver, estimated from recorded trials."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

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

# Share of each person's prior that stays that of everybody.
_EVERYBODY = 0.1


def person_of(trials: Sequence[Trial], names: Sequence[str], model: FusionModel | None = None) -> Person:
    """The noise of the person who drove ``trials``, from the posterior of the commands recorded there.

    Args:
        trials: With a differential drive, in any scenarios.
        names: Of the trials, for errors.
        model: Of a driver.

    Raises:
        InputError: A trial is of another robot than the first, or none of them holds commands.
    """
    model = model or FusionModel()
    # Planning the routes takes longer than a trial, and most people drive in one scenario.
    fusions: dict[str, Fusion] = {}
    found = []
    for trial, name in zip(trials, names, strict=True):
        if trial.robot != trials[0].robot:
            raise InputError(name, "robot", f"must be that of {names[0]}")
        scenario = json.dumps(trial.metadata["scenario"], sort_keys=True)
        if scenario not in fusions:
            fusions[scenario] = _fusion_of(trial, name, model)
        noise = _noise_in(trial, fusions[scenario], model)
        if noise is not None:
            found.append(noise)
    if not found:
        raise InputError("fit-operator", "logs", "must hold commands of a person")
    mean = np.mean(found, axis=0)
    shared = (1.0 - _EVERYBODY) * mean + _EVERYBODY / len(mean)
    return Person(
        robot=trials[0].robot.to_json(),
        noises=model.noises,
        noise_times=model.noise_times,
        probability=tuple(float(f"{value:.4g}") for value in shared),
        trials=len(trials),
    )


def _fusion_of(trial: Trial, name: str, model: FusionModel) -> Fusion:
    """The fusion with the routes of a trial's scenario."""
    scenario = scenario_from_dict(trial.metadata["scenario"], source=f"{name}: scenario")
    robot = scenario.robot
    if not isinstance(robot, DiffDrive):
        raise InputError(name, "robot", "must be a differential drive")
    routes = routes_of(scenario, [], plan_routes(scenario))
    return Fusion(model, routes, scenario=scenario, robot=robot, period=scenario.control_period)


def _noise_in(trial: Trial, fusion: Fusion, model: FusionModel) -> NDArray[np.float64] | None:
    """Probability (G,) of each pair of noise and time constant, the mean over the steps with commands."""
    poses = np.stack([trial[column] for column in trial.robot.configuration_names])
    human, clearance = trial.commands("human").T, trial["clearance"]
    state, sums, count = fusion.initial_state(1), np.zeros(len(model.noises) * len(model.noise_times)), 0
    nothing = np.full(1, np.nan)
    with np.errstate(invalid="ignore"):
        for step in range(len(trial["t"])):
            now = slice(step, step + 1)
            inputs = ArbiterInputs(
                human=np.nan_to_num(human[:, now]),
                autonomous=human[:, now],
                confidence=nothing,
                pose=poses[:, now],
                clearance=clearance[now],
            )
            _, _, state = fusion.step(state, inputs)
            if inputs.human.any():
                sums += fusion.noise_probability(state)[:, 0]
                count += 1
    return sums / count if count else None
