"""A trial compared with IR-SIM."""

import copy
import sys

import numpy as np
import pytest

from drake_shared.experiments.benchmark import trial
from drake_shared.experiments.benchmark.ir_sim import IrSim, describe_world
from drake_shared.scenario.obstacles import Box


def test_quick_run_with_ir_sim(setup, check_result):
    pytest.importorskip("irsim")
    result = trial.run(setup)
    check_result(result)
    assert result.ratios[0].name == "drake_shared / IR-SIM"
    assert not result.absent


def test_quick_run_without_ir_sim_reports_that_it_is_absent(setup, monkeypatch, check_result):
    monkeypatch.setitem(sys.modules, "irsim", None)
    result = trial.run(setup)
    check_result(result)
    assert [item.name for item in result.ratios] == ["times real time"]
    assert set(result.absent) == {"IR-SIM"}


def test_ir_sim_drives_straight_at_the_given_speed(scenario):
    pytest.importorskip("irsim")
    simulator = IrSim(scenario)
    start = simulator.position
    simulator.run()
    moved = simulator.position - start
    np.testing.assert_allclose(moved, [0.3 * 15.0, 0.0], atol=0.1)
    assert not simulator.collided
    simulator.run()
    np.testing.assert_allclose(simulator.position - start, moved, atol=1e-9)


def test_ir_sim_has_the_same_obstacles(scenario):
    scenario = copy.deepcopy(scenario)
    scenario.obstacles.append(Box(name="wall", x=2.5, y=1.0, length=0.4, width=0.2, yaw=0.3))
    world = describe_world(scenario)
    assert world["robot"][0]["shape"]["radius"] == scenario.robot.footprint_radius
    assert [item["state"][:2] for item in world["obstacle"]] == [[o.x, o.y] for o in scenario.obstacles]
    assert world["obstacle"][-1]["shape"] == {"name": "rectangle", "length": 0.4, "width": 0.2}
    lowest = min(item.y - item.bounding_radius() for item in scenario.obstacles)
    assert world["robot"][0]["state"][1] < lowest - scenario.robot.footprint_radius
