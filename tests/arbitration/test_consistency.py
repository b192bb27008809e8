"""Consistency shared autonomy: how a command becomes an action, is denoised, and becomes a command again."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from drake_shared.arbitration.consistency import ConsistencySharedAutonomy
from drake_shared.arbitration.rule import ArbiterInputs
from drake_shared.robots import Arm, DiffDrive

wheels = st.tuples(st.floats(4.0, 10.0), st.floats(-2.0, 2.0)).map(lambda both: (both[0], both[0] + both[1]))


def apply(robot, poses, humans, denoise, share=0.5):
    """w (n,) and command (n, M) at poses (n, C) with commands (n, M) of the human."""
    rule = ConsistencySharedAutonomy(robot=robot, horizon=0.6, denoise=denoise, share=share)
    human = np.array(humans, float).T
    unused = np.ones(human.shape[1])
    given = ArbiterInputs(
        human=human, autonomous=0.0 * human, confidence=unused, pose=np.array(poses).T, clearance=unused
    )
    weight, command, _ = rule.step(rule.initial_state(human.shape[1]), given)
    return weight, command.T


def refuse(position, action):
    raise AssertionError("nothing is to be denoised")


@pytest.mark.parametrize(("denoise", "share"), [(None, 0.5), (refuse, 1.0)])
def test_without_demonstrations_or_noise_the_command_is_the_humans(denoise, share):
    weight, command = apply(DiffDrive(), [[0.0, 0.0, 0.0]] * 2, [[3.0, -4.0], [1.0, 2.0]], denoise, share)
    np.testing.assert_array_equal(weight, 1.0)
    np.testing.assert_array_equal(command, [[3.0, -4.0], [1.0, 2.0]])


@given(wheels, st.floats(-3.0, 3.0))
def test_an_action_that_is_left_as_it_is_gives_the_humans_command(human, yaw):
    weight, (command,) = apply(DiffDrive(), [[0.4, -0.2, yaw]], [human], lambda _, action: action)
    np.testing.assert_allclose(command, human, atol=1e-6)
    assert weight == 0.5


def test_the_command_leads_to_the_denoised_displacement_whatever_the_human_does():
    robot, pose = DiffDrive(), [1.0, 2.0, 0.3]
    _, commands = apply(robot, [pose] * 2, [[6.0, 5.0], [2.0, 9.0]], lambda *_: np.array([0.4, 0.1]))
    np.testing.assert_array_equal(commands[0], commands[1])
    np.testing.assert_allclose(robot.rollout(pose, commands[0], 0.6), [1.4, 2.1], atol=1e-9)


def test_each_driver_is_at_a_place_of_their_own():
    seen = []

    def denoise(position, action):
        seen.append(position.tolist())
        return action

    apply(DiffDrive(), [[1.0, 2.0, 0.0], [3.0, 4.0, 0.0]], [[1.0, 1.0]] * 2, denoise)
    assert seen == [[1.0, 2.0], [3.0, 4.0]]


def test_the_tip_of_an_arm_moves_by_half_the_displacement():
    pose = [0.3, 0.1, 0.4, *Arm().home]
    _, (command,) = apply(Arm(), [pose], [[0.1, -0.06, 0.04]], lambda _, action: 0.5 * action)
    np.testing.assert_allclose(command, [0.05, -0.03, 0.02])
