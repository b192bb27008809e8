"""What is felt of a conflict: how strong, in which direction, and what the stick's resistance takes away."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from drake_shared.arbitration.feedback import Feedback, conflict, resisted_command
from drake_shared.common.errors import InputError
from drake_shared.learners import load_learner
from drake_shared.robots import DiffDrive
from drake_shared.scenario import load_scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.lockstep.support import unsupported
from drake_shared.simulation.trial import Simulation, TrialSettings, read_log, write_log
from drake_shared.systems.conflict_feedback import ConflictFeedback
from drake_shared.systems.recorded_input import RecordedInput

ROBOT = DiffDrive()
LIMIT = ROBOT.command_limits[0]
NAN = float("nan")
FORWARD, BACKWARD = (0.5 * LIMIT, 0.5 * LIMIT), (-0.5 * LIMIT, -0.5 * LIMIT)
LEFT, RIGHT = (0.2 * LIMIT, 0.6 * LIMIT), (0.6 * LIMIT, 0.2 * LIMIT)

wheel = st.floats(-LIMIT, LIMIT)


def evaluate(human, agent, confidence, **feedback):
    system = ConflictFeedback(robot=ROBOT, feedback=Feedback(**feedback))
    context = system.CreateDefaultContext()
    for name, value in (
        ("human_command", human),
        ("autonomous_command", agent),
        ("confidence", [confidence]),
    ):
        system.GetInputPort(name).FixValue(context, value)
    return (
        system.get_conflict_output_port().Eval(context),
        system.get_resisted_command_output_port().Eval(context),
    )


def test_agreement_is_not_felt():
    felt, command = evaluate(FORWARD, FORWARD, 1.0, resistance=1.0)
    np.testing.assert_array_equal(felt, 0.0)
    np.testing.assert_array_equal(command, FORWARD)


def test_the_strength_is_the_share_of_the_range_times_the_confidence():
    full, _ = evaluate((LIMIT, LIMIT), (-LIMIT, -LIMIT), 1.0)
    half, _ = evaluate(FORWARD, BACKWARD, 1.0)
    unsure, _ = evaluate(FORWARD, BACKWARD, 0.3)
    assert full[0] == pytest.approx(1.0)
    assert half[0] == pytest.approx(0.5)
    assert unsure[0] == pytest.approx(0.15)


def test_the_direction_leads_from_the_human_to_the_agent():
    felt, _ = evaluate(RIGHT, LEFT, 1.0)
    np.testing.assert_allclose(felt[1:], [-1.0, 1.0])  # The agent turns further to the left.


@pytest.mark.parametrize(
    ("human", "agent", "confidence"),
    [((0.0, 0.0), FORWARD, 1.0), (FORWARD, LEFT, 0.0), (FORWARD, (NAN, 1.0), 1.0), (FORWARD, LEFT, NAN)],
)
def test_nothing_is_felt_without_a_command_without_confidence_and_of_nan(human, agent, confidence):
    felt, _ = evaluate(human, agent, confidence, rumble=True)
    np.testing.assert_array_equal(felt, 0.0)


def test_the_resistance_takes_most_where_the_agent_moves_the_opposite_way():
    _, opposite = evaluate(FORWARD, BACKWARD, 1.0, resistance=0.8)
    np.testing.assert_allclose(opposite, 0.2 * np.array(FORWARD))
    _, unsure = evaluate(FORWARD, BACKWARD, 0.5, resistance=0.8)
    np.testing.assert_allclose(unsure, 0.6 * np.array(FORWARD))
    _, without = evaluate(FORWARD, BACKWARD, 1.0)
    np.testing.assert_array_equal(without, FORWARD)


@settings(max_examples=200)
@given(wheel, wheel, wheel, wheel, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_feedback_is_bounded_and_never_turns_a_command_round(a, b, c, d, confidence, resistance):
    strength, direction = conflict(ROBOT, (a, b), (c, d), confidence)
    assert 0.0 <= strength <= 1.0
    assert max(map(abs, direction)) == pytest.approx(1.0 if strength else 0.0)
    kept = resisted_command(ROBOT, (a, b), (c, d), confidence, resistance)
    for before, after in zip((a, b), kept, strict=True):
        assert abs(after) <= abs(before)
        assert after * before >= 0.0


@pytest.mark.parametrize(
    ("field", "value"), [("rumble", 1), ("tone", "yes"), ("resistance", 1.1), ("resistance", NAN)]
)
def test_fields_out_of_range_are_refused(field, value):
    with pytest.raises(InputError) as caught:
        Feedback(**{field: value})
    assert caught.value.field == field


@pytest.fixture(scope="module")
def trials():
    """Trials in which the human turns right, by the resistance of the stick."""
    scenario = load_scenario("two_obstacles")
    learner = load_learner("two_obstacles")
    made = {}
    for resistance in (0.0, 0.6):
        config = SharedControlConfig(feedback=Feedback(tone=True, resistance=resistance))
        simulation = Simulation(
            scenario,
            learner=learner,
            config=config,
            operator=RecordedInput(commands=np.tile(RIGHT, (80, 1))),
        )
        made[resistance] = simulation.run(TrialSettings())
        assert unsupported(simulation) is not None
    return made


def test_conflict_and_resisted_command_are_logged_apart_from_the_humans(trials, tmp_path):
    trial = trials[0.6]
    felt = trial["conflict"]
    assert felt.max() > 0.02
    opposed = felt > 0.02
    assert (np.abs(trial["resisted_left"]) < np.abs(trial["human_left"]))[opposed].any()
    driven = trial["human_left"] > 0.0
    np.testing.assert_array_equal(trial["human_left"][driven], RIGHT[0])
    write_log(trial, tmp_path / "log.parquet")
    log = read_log(tmp_path / "log.parquet")
    assert log.metadata["config"]["feedback"] == {"rumble": False, "tone": True, "resistance": 0.6}
    np.testing.assert_array_equal(log["conflict"], felt)


def test_a_tone_alone_changes_no_command(trials):
    trial = trials[0.0]
    np.testing.assert_array_equal(trial["resisted_left"], trial["human_left"])
