"""Tunes the options of arbiters with the same budget, on scenes that are not scored."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any

import numpy as np

from drake_shared.common.errors import InputError
from drake_shared.experiments.common import scenario_of
from drake_shared.experiments.compare_trials import AGENT, HUMAN, config_of, run_case
from drake_shared.experiments.measures import finite_mean
from drake_shared.simulation.trial import Simulation
from drake_shared.systems.arbiters import find_arbiter

BUDGET = 4
"""Settings of the options tried for each arbiter, the defaults among them."""
CONDITIONS = ("primary", "noise 1.2", "switching")
_FACTOR, _ATTEMPTS = 2.0, 20
# What `make_arbiter` gives: these are not options.
_GIVEN = ("robot", "period", "initial_idle_time", "authority", "driver", "scenario")


def candidates(arbiter: str, scene: str) -> list[str]:
    """The settings to try: the defaults, and up to three with all numbers multiplied by random factors.

    The factors are from 1/2 to 2, and the same in every run. Settings that the arbiter refuses are left out.

    Args:
        arbiter: Its name, without options.
        scene: In which the arbiter is made.
    """
    found, numbers = [arbiter], _numbers(arbiter)
    random = np.random.default_rng(sum(arbiter.encode()))
    for _ in range(_ATTEMPTS if numbers else 0):
        factors = _FACTOR ** random.uniform(-1.0, 1.0, len(numbers))
        values = (
            f"{name}={value * factor:.4g}" for (name, value), factor in zip(numbers, factors, strict=True)
        )
        text = f"{arbiter}:{','.join(values)}"
        if len(found) < BUDGET and _can_be_made(text, scene):
            found.append(text)
    return found


def tune(arbiter: str, scenes: Sequence[str], demonstrations: int) -> dict[str, Any]:
    """The setting of an arbiter's options with the largest intent success in some scenes.

    Returns:
        arbiter: Name and options of the best one, the defaults if others are not better.
        tried: The mean intent success by the setting; empty if there is only one.
    """
    tried: dict[str, float] = {}
    found = candidates(arbiter, scenes[0])
    if len(found) == 1:
        return {"arbiter": arbiter, "tried": tried}
    for text in found:
        rows = [
            row
            for index, scene in enumerate(scenes)
            for row in run_case(scene, {}, [text], demonstrations, index, CONDITIONS)
        ]
        tried[text] = finite_mean([row["intent_success"] for row in rows])
    return {"arbiter": max(tried, key=lambda text: tried[text]), "tried": tried}


def _numbers(arbiter: str) -> list[tuple[str, float]]:
    """Name and default of each option that is a positive number."""
    if arbiter in (HUMAN, AGENT):
        return []
    parameters = inspect.signature(find_arbiter(arbiter)).parameters.values()
    return [
        (item.name, float(item.default))
        for item in parameters
        if item.name not in _GIVEN and type(item.default) is float and item.default > 0.0
    ]


def _can_be_made(text: str, scene: str) -> bool:
    try:
        Simulation(scenario_of(scene), config=config_of(text))
    except InputError:
        return False
    return True
