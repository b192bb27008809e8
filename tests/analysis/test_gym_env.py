"""The Gymnasium environment, by Gymnasium's own checker."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from drake_shared.analysis.gym_env import NAME, SharedControlEnv
from drake_shared.common.errors import InputError


@pytest.mark.parametrize("role", ["human", "agent"])
def test_environment_passes_the_checker(role):
    check_env(gymnasium.make(NAME, role=role).unwrapped, skip_render_check=True)


def test_the_action_is_the_humans_command_at_once():
    env = gymnasium.make(NAME, learner=None)
    observation, info = env.reset(seed=3, options={"route": "left_left"})
    assert info["route"] == "left_left"
    assert observation[:3] == pytest.approx([0.0, 0.0, 0.0])
    total = 0.0
    for _ in range(20):
        observation, reward, *_ = env.step(np.array([0.3, 0.3], dtype=np.float32))
        total += reward
    assert observation[5:7] == pytest.approx([0.3, 0.3])
    assert observation[0] > 0.1
    assert total == pytest.approx(observation[0], abs=0.02)


def test_an_agent_needs_a_learner():
    with pytest.raises(InputError):
        SharedControlEnv(role="agent", learner=None)
