"""A step of the safety filter beside the distance query and a quadratic program."""

import numpy as np

from drake_shared.experiments.benchmark import safety


def test_quick_run(setting, check_result):
    result = safety.run(setting)
    check_result(result)
    assert len(result.ratios) == 4
    assert result.seconds[safety.QUERY].median < result.seconds[safety.PASSED].median
    assert result.seconds[safety.PASSED].median < result.seconds[safety.CHANGED].median


def test_states_are_of_the_kind_that_they_are_timed_as(setting):
    passed, changed = safety.draw_states(setting)
    assert len(passed) == len(changed) == safety.STATES
    assert all(state.filtered(setting) == state.command for state in passed)
    assert all(state.filtered(setting) != state.command for state in changed)
    assert all(len(state.look(0.0, 0.0, 10.0)) == safety.OBSTACLES for state in (*passed, *changed))


def test_the_program_is_one_that_changes_the_command(scenario):
    robot, period = scenario.robot, scenario.control_period
    speeds = safety.solve_program(robot, (6.0, 6.0), (12.0, 12.0), period)
    assert np.all(speeds > 6.0)
    assert np.all(speeds < 6.0 + robot.max_wheel_acceleration * period)
