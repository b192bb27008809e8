"""Demonstrations by a simulated operator that drives each route alone."""

from __future__ import annotations

import dataclasses
import math

from drake_shared.arbitration.authority import Authority
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstration, Demonstrations, provenance_of_trial
from drake_shared.scenario import Scenario, clearance_scorer
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings
from drake_shared.systems.surrogate_operator import Behaviour


def demonstration_of(trial: Trial, *, score: float) -> Demonstration:
    """The path of a trial, as a demonstration with ``score``; with none if that is infinite: no obstacles."""
    return Demonstration(
        times=trial["t"],
        positions=trial.positions,
        yaws=trial.columns.get("yaw"),
        position_names=trial.robot.position_names,
        score=score if math.isfinite(score) else None,
        provenance=provenance_of_trial(trial.metadata, trial["human_weight"]),
    )


def human_alone(config: SharedControlConfig | None) -> SharedControlConfig:
    """The config for demonstrations without assistance, which last for the whole duration."""
    config = config or SharedControlConfig()
    return dataclasses.replace(config, driver="human", authority=Authority(enabled=False), end="duration")


def teach(
    scenario: Scenario,
    *,
    count: int | None = None,
    seed: int = 0,
    config: SharedControlConfig | None = None,
    behaviour: Behaviour = Behaviour(),  # noqa: B008 (frozen)
) -> Demonstrations:
    """Demonstrations by the simulated operator, without assistance, scored by clearance.

    Args:
        scenario: The task; its routes are driven in turn.
        count: Number of demonstrations; one for each route if None.
        seed: Of the first trial; each following one has the next.
        config: Look-ahead, safety filter and faults; the human drives alone in any case.
        behaviour: Of the operator.

    Raises:
        RunError: The operator did not reach the goal, or touched an obstacle.
    """
    simulation = Simulation(scenario, config=human_alone(config))
    score = clearance_scorer(scenario)
    driven = []
    for index in range(len(scenario.routes) if count is None else count):
        route = scenario.routes[index % len(scenario.routes)].name
        trial = simulation.run(TrialSettings(route=route, seed=seed + index, behaviour=behaviour))
        if trial.status != "reached" or trial["contact"].any():
            raise RunError(f"the operator failed on route {route} (seed {seed + index}): {trial.status}")
        driven.append(demonstration_of(trial, score=score(trial.positions)))
    return Demonstrations(
        items=tuple(driven), metadata={"scenario": scenario.name, "operator": "SurrogateOperator"}
    )
