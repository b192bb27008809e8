"""The arm with mass and motors against the kinematic one."""

import dataclasses

import numpy as np
import pytest

from drake_shared.robots import Arm
from drake_shared.robots.arm_dynamics import ArmDynamics
from drake_shared.scenario import load_scenario
from drake_shared.simulation.trial import Simulation, TrialSettings
from drake_shared.systems.dynamic_arm_plant import DynamicArmPlant
from drake_shared.systems.recorded_input import RecordedInput

CUPS = load_scenario("table_three_cups")


def test_an_arm_at_rest_stays_at_rest():
    """Inverse dynamics carry the weight."""
    dynamics = ArmDynamics(Arm(), step=0.005)
    home = np.array(Arm().home)
    state = np.concatenate([home, np.zeros(7)])
    for _ in range(200):
        state = dynamics.step(state, home, np.zeros(7))
    assert state[:7] == pytest.approx(home, abs=1e-4)
    assert state[7:] == pytest.approx(np.zeros(7), abs=1e-4)


def test_an_error_of_a_joint_fades_within_a_second():
    dynamics = ArmDynamics(Arm(), step=0.005)
    home = np.array(Arm().home)
    state = np.concatenate([home + 0.05, np.zeros(7)])
    for _ in range(200):
        state = dynamics.step(state, home, np.zeros(7))
    assert state[:7] == pytest.approx(home, abs=1e-3)


def test_the_tip_is_within_5_mm_rms_of_the_kinematic_one():
    steered = Simulation(CUPS).run(TrialSettings(route="left", seed=2))
    recording = steered.commands("human")
    paths = {}
    for plant in ("kinematic", "dynamic"):
        scenario = dataclasses.replace(CUPS, plant=plant)
        simulation = Simulation(scenario, operator=RecordedInput(robot=CUPS.robot, period=0.05))
        assert isinstance(simulation.parts.plant, DynamicArmPlant) == (plant == "dynamic")
        paths[plant] = simulation.run(TrialSettings(recording=recording)).positions
    count = min(map(len, paths.values()))
    errors = np.linalg.norm(paths["kinematic"][:count] - paths["dynamic"][:count], axis=1)
    assert 0.0 < np.sqrt(np.mean(errors**2)) < 0.005
