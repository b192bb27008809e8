"""A step of the safety filter compared with a distance query and a quadratic program."""

import numpy as np
import pytest

from drake_shared.arbitration.safety.barrier import nearest_feasible
from drake_shared.experiments.benchmark import safety_filter


@pytest.fixture(scope="module")
def states(setup):
    return safety_filter.draw_states(setup)


def test_quick_run(setup, check_result):
    result = safety_filter.run(setup)
    check_result(result)
    assert result.name == "safety"
    assert set(result.seconds) >= {safety_filter.PASSED, safety_filter.CHANGED, safety_filter.QUERY}


def test_states_are_of_the_kind_that_they_are_timed_as(states):
    passed, changed = states
    assert len(passed) == len(changed) == safety_filter.STATES
    assert all(state.filtered() == state.command for state in passed)
    assert all(state.filtered() != state.command for state in changed)
    assert all(len(state.query(0.0, 0.0, 10.0)) == safety_filter.OBSTACLES for state in (*passed, *changed))


def test_both_solutions_of_the_program_agree_and_change_the_command(states):
    for state in states[1]:
        program = state.program()
        speeds = safety_filter.solve_by_drake(*program)
        np.testing.assert_allclose(nearest_feasible(*program), speeds, atol=1e-3)
        assert np.linalg.norm(speeds - state.command) > 0.01
