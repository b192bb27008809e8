"""Who divides the control: the arbiters by name, those from outside, and the same trials under each."""

import json
import sys
import textwrap

import numpy as np
import pytest

from drake_shared.analysis.batch import Batch, run_batch
from drake_shared.cli.main import main
from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import Simulation, TrialSettings, read_log
from drake_shared.systems.arbiters import arbiter_names, describe_arbiter, make_arbiter
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.constant_weight_blender import ConstantWeightBlender
from drake_shared.systems.leader_follower import LeaderFollower
from drake_shared.systems.traded_control import TradedControl

MODEL = str(models_directory() / "learners" / "two_obstacles_default.safetensors")
# Arbiters that somebody else wrote: one that gives the human two thirds, and what may go wrong.
OUTSIDE = """
from pydrake.systems.framework import LeafSystem

class TwoThirds(LeafSystem):
    configuration = {"share": 0.6666666666666666}

    def __init__(self, period):
        super().__init__()
        assert period == 0.05
        human = self.DeclareVectorInputPort("human_command", 2)
        agent = self.DeclareVectorInputPort("autonomous_command", 2)
        self.DeclareVectorInputPort("confidence", 1)
        self.DeclareVectorOutputPort("human_weight", 1, lambda _, out: out.set_value([2 / 3]))
        self.DeclareVectorOutputPort(
            "shared_command", 2,
            lambda context, out: out.set_value((2 * human.Eval(context) + agent.Eval(context)) / 3),
        )

class Deaf(LeafSystem):
    pass

class Undescribed(TwoThirds):
    configuration = {"share": float("nan")}

def refuses():
    raise RuntimeError("not today")

def nothing():
    return None
"""


@pytest.fixture
def outside(tmp_path, monkeypatch):
    (tmp_path / "their_arbiters.py").write_text(textwrap.dedent(OUTSIDE))
    info = tmp_path / "their_arbiters-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: their-arbiters\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[drake_shared.arbiters]\ntwo_thirds = their_arbiters:TwoThirds\ndeaf = their_arbiters:Deaf\n"
        "undescribed = their_arbiters:Undescribed\nrefuses = their_arbiters:refuses\n"
        "nothing = their_arbiters:nothing\nbroken = no_such_module:Nothing\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    sys.modules.pop("their_arbiters", None)


@pytest.fixture(scope="module")
def learner(_two_obstacles, route_learner):
    """Unsure at first, and sure towards the end."""
    variance = np.linspace(0.2, 0.001, 151)[:, None]
    return route_learner(_two_obstacles, variance=variance)


def run(scenario, learner, config, arbiter=None):
    simulation = Simulation(scenario, learner=learner, config=config, arbiter=arbiter)
    return simulation.run(TrialSettings(route="left_right", seed=4))


def test_the_arbiters_of_the_package_are_registered():
    assert {"agent", "blend", "halves", "human", "traded"} <= set(arbiter_names())


def test_an_unknown_name_is_refused_and_the_known_are_told(scenario):
    with pytest.raises(
        InputError,
        match=r"agent, blend, consistency, fusion, halves, hindsight, human, leader-follower, rt-v2, traded",
    ):
        make_arbiter("coin")


@pytest.mark.parametrize("who", ["human", "agent"])
def test_the_names_human_and_agent_are_short_for_that_driver(scenario, learner, who):
    assert SharedControlConfig(arbitration=who) == SharedControlConfig(driver=who)
    trial = run(scenario, learner, SharedControlConfig(arbitration=who))
    assert trial.metadata["mode"] == who
    alone = trial.commands("human" if who == "human" else "autonomous")
    np.testing.assert_array_equal(trial.commands("shared"), alone)


def test_fixed_halves_by_hand(scenario, learner):
    trial = run(scenario, learner, SharedControlConfig(arbitration="halves"))
    assert np.all(trial["human_weight"] == 0.5)
    mean = (trial.commands("human") + trial.commands("autonomous")) / 2
    np.testing.assert_allclose(trial.commands("shared"), mean, atol=1e-12)


def test_traded_control_gives_everything_to_one_of_the_two(scenario, learner):
    trial = run(scenario, learner, SharedControlConfig(arbitration="traded"))
    agent = trial["human_weight"] == 0.0
    assert set(trial["human_weight"]) == {0.0, 1.0}
    np.testing.assert_array_equal(trial.commands("shared")[agent], trial.commands("autonomous")[agent])
    np.testing.assert_array_equal(trial.commands("shared")[~agent], trial.commands("human")[~agent])
    # It switches in the step in which the confidence crosses, not in the one after.
    assert np.all(trial["confidence"][agent] > 0.45)
    assert np.all(trial["confidence"][~agent] < 0.55)


def test_traded_control_switches_at_the_far_side_of_its_band(step):
    dut = TradedControl(threshold=0.6, margin=0.1)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("human_command").FixValue(context, [0.0, 0.0])
    dut.GetInputPort("autonomous_command").FixValue(context, [1.0, 2.0])
    seen = []
    for confidence in (0.65, 0.7, 0.55, 0.5, 0.65, np.nan, 1.0, np.nan):
        dut.GetInputPort("confidence").FixValue(context, [confidence])
        seen.append(dut.GetOutputPort("human_weight").Eval(context).item())
        step(dut, context)
    assert seen == [1, 0, 0, 1, 1, 1, 0, 1]


@pytest.mark.parametrize("leader", ["human", "agent"])
def test_the_leader_chooses_the_direction(scenario, learner, leader):
    trial = run(scenario, learner, SharedControlConfig(arbitration=f"leader-follower:leader={leader}"))
    left, right = trial.commands("shared").T
    leads = trial.commands("human" if leader == "human" else "autonomous").T
    np.testing.assert_allclose(left * leads[1], right * leads[0], atol=1e-9)
    assert trial.metadata["arbitration"]["configuration"] == {"leader": leader, "share": 0.5}


@pytest.mark.parametrize(
    "dut", [ConstantWeightBlender(0.0), TradedControl(), LeaderFollower(leader="agent", share=0.0)]
)
def test_without_a_command_of_the_agent_the_human_drives(dut):
    context = dut.CreateDefaultContext()
    dut.GetInputPort("human_command").FixValue(context, [3.0, np.nan])
    dut.GetInputPort("autonomous_command").FixValue(context, [np.nan, 1.0])
    dut.GetInputPort("confidence").FixValue(context, [1.0])
    assert dut.GetOutputPort("human_weight").Eval(context) == 1.0
    np.testing.assert_array_equal(dut.GetOutputPort("shared_command").Eval(context), [0.0, 0.0])


@pytest.mark.parametrize("weight", [-0.1, 1.1, np.nan])
def test_a_weight_that_is_no_share_is_refused(weight):
    with pytest.raises(ValueError, match="weight"):
        ConstantWeightBlender(weight)


def test_an_option_out_of_range_is_reported_with_the_arbiter_and_a_misspelt_one_with_the_likely_name():
    with pytest.raises(InputError) as caught:
        make_arbiter("traded", options={"threshold": 7.0})
    assert (caught.value.source, caught.value.field) == ("arbitration 'traded'", "threshold")
    with pytest.raises(InputError, match="threshold") as caught:
        make_arbiter("traded", options={"treshold": 0.4})
    assert caught.value.field == "treshold"


@pytest.mark.parametrize(
    ("threshold", "margin"), [(0.0, 0.0), (0.5, 0.5), (0.9, 0.2), (np.nan, 0.1), (0.5, -1)]
)
def test_a_band_beyond_what_a_confidence_can_be_is_refused(threshold, margin):
    with pytest.raises(ValueError, match="threshold"):
        TradedControl(threshold=threshold, margin=margin)


def test_a_band_of_no_width_and_one_up_to_certainty_are_allowed():
    for threshold, margin in ((0.5, 0.0), (1.0, 0.0), (0.75, 0.25)):
        expected = {"threshold": threshold, "margin": margin}
        assert TradedControl(threshold=threshold, margin=margin).configuration == expected


def test_a_system_is_taken_as_it_is(scenario, learner):
    trial = run(scenario, learner, None, ConstantWeightBlender(0.25))
    assert np.all(trial["human_weight"] == 0.25)
    assert trial.metadata["arbitration"] == {
        "name": "ConstantWeightBlender",
        "configuration": {"weight": 0.25},
    }
    assert describe_arbiter(ConfidenceBlender())["name"] == "blend"


def test_one_from_outside_divides_the_control_of_a_batch(outside, tmp_path):
    (row,) = run_batch(
        Batch(model=MODEL, config=SharedControlConfig(arbitration="two_thirds"), out=str(tmp_path / "logs"))
    )
    assert row["mean_human_weight"] == pytest.approx(2 / 3)
    trial = read_log(row["log"])
    assert trial.metadata["arbitration"] == {"name": "two_thirds", "configuration": {"share": 2 / 3}}
    assert "two_thirds" in arbiter_names()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("broken", r"'broken' \(no_such_module:Nothing\) cannot be imported .*no_such_module"),
        ("deaf", r"deaf.*human_command"),
        ("refuses", r"'refuses' cannot be made \(RuntimeError: not today\)"),
        ("nothing", r"nothing.*LeafSystem"),
        ("undescribed", r"configuration of 'undescribed' must be JSON"),
    ],
)
def test_one_that_is_none_is_refused_in_one_line(outside, scenario, name, said):
    with pytest.raises(InputError, match=said) as caught:
        Simulation(scenario, config=SharedControlConfig(arbitration=name))
    assert "\n" not in str(caught.value)


def test_simulate_names_the_arbiter_in_its_logs(capsys, tmp_path):
    arguments = ["simulate", "--arbitration", "human", "--json", "--out", str(tmp_path)]
    assert main(arguments) == 0
    (row,) = json.loads(capsys.readouterr().out)["trials"]
    assert read_log(row["log"]).metadata["mode"] == "human"
    assert main(["simulate", "--arbitration", "coin"]) == 2
    assert "arbitration" in capsys.readouterr().err
