"""What the page is told about the task and its learner."""

from types import SimpleNamespace

from pydrake.systems.framework import LeafSystem

from drake_shared.cockpit.page_state import describe_scene
from drake_shared.learners import load_learner
from drake_shared.scenario import load_scenario


def test_the_scene_has_a_warning_about_a_learner_whose_training_stopped_early():
    scenario = load_scenario("two_obstacles")
    training = {"parameters": {"loss_threshold": -6.0}, "loss": [[15_000, -1.92]]}
    early = SimpleNamespace(name="cnmp", metadata={"training": training})
    assert "-1.92" in describe_scene(scenario, LeafSystem(), early)["learner_warning"]
    for learner in (None, load_learner("two_obstacles_paper"), load_learner("two_obstacles_default")):
        assert describe_scene(scenario, LeafSystem(), learner)["learner_warning"] is None
