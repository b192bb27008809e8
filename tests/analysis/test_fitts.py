"""Throughput of aimed movements, against a calculation by hand."""

import copy
import dataclasses
import math

import numpy as np
import pytest

from drake_shared.analysis.fitts import throughput
from drake_shared.common.errors import InputError
from drake_shared.robots import describe_robot
from drake_shared.scenario import load_scenario
from drake_shared.simulation.log import Trial

FITTS = load_scenario("table_fitts")
PERIOD = 0.5
METADATA = {
    "scenario": dataclasses.asdict(FITTS),
    "robot": describe_robot(FITTS.robot).to_json(),
}


def movement(route: str, *, past: float, arrival: float, rows: int = 20) -> Trial:
    """A jump at ``arrival``, in [s], to ``past`` m beyond the target; the human commands from 1 s on."""
    start, end = (np.array(point) for point in FITTS.route(route).waypoints)
    time = PERIOD * np.arange(rows)
    along = (end - start) / np.linalg.norm(end - start)
    tip = np.where(time[:, None] < arrival, start, end + past * along)
    columns = dict(zip(("t", "x", "y", "z"), (time, *tip.T), strict=True))
    columns |= {name: np.where(time < 1.0, 0.0, 0.1) for name in ("human_vx", "human_vy", "human_vz")}
    return Trial(columns=columns, metadata={**METADATA, "route": route})


def test_throughput_of_two_targets_is_that_of_a_calculation_by_hand():
    # Arrival 2.5 s after the first command, or 4.0 s, and 1 s in the target.
    near = [movement("near_large", past=past, arrival=3.5) for past in (-0.02, 0.0, 0.02)]
    far = [movement("far_large", past=past, arrival=5.0) for past in (-0.01, 0.0, 0.01)]
    found = throughput([*near, *far], dwell=1.0)
    # Distances from (0.4, 0, 0.62) to (0.5, -0.15, 0.56) and (0.68, -0.3, 0.15).
    bits = (
        math.log2(math.sqrt(0.01 + 0.0225 + 0.0036) / (4.133 * 0.02) + 1.0),
        math.log2(math.sqrt(0.0784 + 0.09 + 0.2209) / (4.133 * 0.01) + 1.0),
    )
    assert found.throughput == pytest.approx((bits[0] / 3.5 + bits[1] / 5.0) / 2.0, rel=1e-4)
    assert found.selected == 1.0


def test_a_target_that_is_passed_or_missed_is_not_selected():
    stays = [movement("near_large", past=past, arrival=3.0) for past in (0.0, 0.01)]
    late = movement("near_large", past=0.0, arrival=9.5)
    beyond = movement("near_large", past=0.05, arrival=3.0)
    found = throughput([*stays, late, beyond], dwell=1.0)
    assert found.selected == 0.5
    assert found.throughput == throughput(stays, dwell=1.0).throughput
    assert math.isnan(throughput([stays[0], late], dwell=1.0).throughput)


def test_the_target_of_each_trial_is_that_of_its_own_scenario():
    trial = movement("near_large", past=0.02, arrival=3.0)
    small = copy.deepcopy(METADATA["scenario"])
    for goal in (small["goal"], *small["goals"]):
        goal["radius"] = 0.01
    other = dataclasses.replace(trial, metadata={**trial.metadata, "scenario": small})
    assert throughput([trial, other], dwell=1.0).selected == 0.5


def test_trials_need_an_intended_target():
    trial = movement("near_large", past=0.0, arrival=3.0)
    with pytest.raises(InputError) as caught:
        throughput([dataclasses.replace(trial, metadata={**trial.metadata, "route": None})])
    assert caught.value.field == "route"
    with pytest.raises(InputError):
        throughput([])
