"""A trial beside IR-SIM, and where its time goes."""

import copy
import sys

import numpy as np
import pytest

from drake_shared.experiments.benchmark import trial
from drake_shared.experiments.benchmark.ir_sim import describe_world
from drake_shared.experiments.benchmark.system_times import SYSTEMS, SystemTimes
from drake_shared.experiments.benchmark.trial import ConstantLearner
from drake_shared.scenario.obstacles import Box


@pytest.fixture(scope="module")
def result(setting):
    before = {system: dict(vars(system)) for system in SYSTEMS}
    found = trial.run(setting)
    assert {system: dict(vars(system)) for system in SYSTEMS} == before
    return found


def test_quick_run(result, check_result):
    check_result(result)
    assert result.ratios[-1].name == "times real time"


def test_time_goes_to_every_system_and_adds_up(result):
    parts = result.details["time_goes"]
    assert {system.__name__ for system in SYSTEMS} | {"learner", "Drake and the log"} <= set(parts)
    assert all(part["share"] > 0.0 for part in parts.values())
    assert sum(part["share"] for part in parts.values()) == pytest.approx(1.0, abs=0.2)


def test_ir_sim_takes_part_or_is_reported(result):
    pytest.importorskip("irsim")
    assert result.ratios[0].name == "drake_shared / IR-SIM"
    assert not result.absent


def test_without_ir_sim_it_is_reported(setting, monkeypatch, check_result):
    monkeypatch.setitem(sys.modules, "irsim", None)
    monkeypatch.setattr(trial, "where_time_goes", lambda *arguments, **options: {})
    found = trial.run(setting)
    check_result(found)
    assert "not installed" in found.absent["IR-SIM"]


@pytest.mark.parametrize(("dash", "distance"), [(False, 0.3 * 15.0), (True, 1.2 * 15.0)])
def test_ir_sim_drives_the_way_that_it_is_told(scenario, dash, distance):
    pytest.importorskip("irsim")
    from drake_shared.experiments.benchmark.ir_sim import IrSim

    simulator = IrSim(scenario, dash=dash)
    start = simulator.position
    simulator.run()
    moved = simulator.position - start
    np.testing.assert_allclose(moved, [distance, 0.0], atol=0.1)
    assert not simulator.collided
    simulator.run()
    np.testing.assert_allclose(simulator.position - start, moved, atol=1e-9)


def test_ir_sim_sees_the_same_obstacles(scenario):
    scenario = copy.deepcopy(scenario)
    scenario.obstacles.append(Box(name="wall", x=2.5, y=1.0, length=0.4, width=0.2, yaw=0.3))
    world = describe_world(scenario, dash=False)
    assert world["robot"][0]["shape"]["radius"] == scenario.robot.footprint_radius
    assert [item["state"][:2] for item in world["obstacle"]] == [[o.x, o.y] for o in scenario.obstacles]
    assert world["obstacle"][-1]["shape"] == {"name": "rectangle", "length": 0.4, "width": 0.2}
    lowest = min(item.y - item.bounding_radius() for item in scenario.obstacles)
    assert world["robot"][0]["state"][1] < lowest - scenario.robot.footprint_radius


def test_constant_learner_answers_the_same_to_everyone(setting):
    constant = ConstantLearner(setting.cnmp)
    here = constant.predict([1.0], [[0.0, 0.0]], constant.grid[10:])
    there = constant.predict([2.0], [[3.0, 1.0]], constant.grid[10:])
    np.testing.assert_array_equal(here[0], there[0])
    assert here[0].shape == here[1].shape == (len(constant.grid) - 10, 2)
    assert here[0] is not there[0]


def test_time_inside_another_callback_counts_once():
    times = SystemTimes()
    inner = times.timed("inner", lambda: sum(range(20_000)))
    outer = times.timed("outer", inner)
    outer()
    assert times.calls == {"inner": 1, "outer": 1}
    assert 0.0 < times.seconds["outer"] < times.seconds["inner"]
