"""The example of a copilot that is trained in Gymnasium and divides the control."""

import gymnasium
import numpy as np
import pytest

from drake_shared import SharedControlConfig, Simulation, TrialSettings, load_learner, load_scenario


def test_a_copilot_that_passes_the_command_on_leaves_all_weight_to_the_human(example):
    module = example("copilot")
    robot = load_scenario("two_obstacles").robot
    dut = module.CopilotArbiter(module.HUMAN, goal=np.array([5.0, 0.0]), robot=robot)
    context = dut.CreateDefaultContext()
    human = [3.0, 5.0]
    dut.get_human_command_input_port().FixValue(context, human)
    dut.get_autonomous_command_input_port().FixValue(context, [0.0, 0.0])
    dut.get_confidence_input_port().FixValue(context, [0.5])
    dut.GetInputPort("pose").FixValue(context, [1.0, 0.4, 0.2])
    np.testing.assert_allclose(dut.get_shared_command_output_port().Eval(context), human)
    assert dut.get_human_weight_output_port().Eval(context).item() == pytest.approx(1.0)


def test_the_gain_of_the_goal_turns_toward_it(example):
    module = example("copilot")
    left, right = module.copilot(
        np.array([1.0, 1.0, 0.5]), np.array([0.4, 0.4]), np.zeros(3), np.array([1.0, 1.0])
    )
    assert right > left


def test_training_never_ends_with_a_worse_copilot_and_it_drives_as_an_arbiter(example):
    module = example("copilot")
    scenario, learner = load_scenario("two_obstacles"), load_learner("two_obstacles")
    env = gymnasium.make(
        "drake_shared/SharedControl-v0",
        role="agent",
        learner=learner,
        config=SharedControlConfig(driver="agent"),
    )
    gains, scores = module.train(env, ["left_left"], rounds=2)
    assert scores == sorted(scores)
    assert scores[-1] == module.score(env, gains, ["left_left"])
    goal = np.array(scenario.goal.position(scenario.robot.position_names))
    arbiter = module.CopilotArbiter(gains, goal=goal, robot=scenario.robot, period=scenario.control_period)
    trial = Simulation(scenario, learner=learner, arbiter=arbiter).run(TrialSettings(route="left_left"))
    assert trial.status == "reached"
    assert trial.metadata["arbitration"]["configuration"] == {"gains": gains.tolist()}
