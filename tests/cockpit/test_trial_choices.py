"""What a person may choose between trials, and what follows from it."""

import dataclasses
import shutil

import pytest

from drake_shared.arbitration.feedback import Feedback
from drake_shared.cockpit.drive_history import DriveHistory
from drake_shared.cockpit.messages import Setup
from drake_shared.cockpit.page_state import describe_result
from drake_shared.cockpit.trial_choices import ASK, FREE, TrialChoices
from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.learners import load_learner
from drake_shared.scenario import load_scenario
from drake_shared.simulation.trial import Simulation, TrialSettings

CHOICE = Setup(
    scenario="two_obstacles",
    learner="two_obstacles_default",
    arbitration="blend",
    confidence_gain=None,
    route=None,
)


def choice(**changes) -> Setup:
    return dataclasses.replace(CHOICE, **changes)


@pytest.fixture
def choices(scenario):
    return TrialChoices(scenario, load_learner("two_obstacles"))


def test_the_arbiter_and_k_can_be_chosen(choices):
    assert choices.choose(choice(arbitration="halves", confidence_gain=50.0))
    assert (choices.config.arbitration, choices.config.confidence_gain) == ("halves", 50.0)
    assert choices.choose(CHOICE)
    assert (choices.config.arbitration, choices.config.confidence_gain) == ("blend", None)
    assert choices.config.authority.enabled


def test_what_is_felt_can_be_chosen(choices):
    assert choices.choose(choice(rumble=True, resistance=0.25))
    assert choices.config.feedback == Feedback(rumble=True, resistance=0.25)
    described = choices.describe(usable_drives=0)
    assert (described["rumble"], described["tone"], described["resistance"]) == (True, False, 0.25)
    assert choices.choose(CHOICE)
    assert not choices.config.feedback


def test_a_choice_that_changes_nothing_but_the_route_keeps_the_simulation(choices):
    choices.choose(CHOICE)
    assert not choices.choose(choice(route="left_right"))
    assert choices.route == "left_right"


def test_another_scenario_brings_a_learner_of_its_own(choices):
    assert choices.choose(choice(scenario="doorway"))
    assert choices.scenario.name == "doorway"
    assert choices.learner.metadata["scenario"] == "doorway"
    assert choices.choose(choice(scenario="doorway", learner=None))
    assert choices.learner is None


def test_a_scenario_of_ones_own_is_driven_alone_and_can_be_chosen_again(short_floor):
    choices = TrialChoices(short_floor, None)
    described = choices.describe(usable_drives=0)
    assert described["learners"] == []
    assert {"short_floor", "two_obstacles"} <= set(described["scenarios"])
    choices.choose(CHOICE)
    assert choices.choose(choice(scenario="short_floor"))
    assert choices.scenario is short_floor
    assert choices.learner is None


@pytest.mark.parametrize(
    "bad", [{"scenario": "nowhere"}, {"learner": "nobody"}, {"arbitration": "traded", "learner": "../x"}]
)
def test_a_choice_that_cannot_be_made_changes_nothing_and_says_why(choices, bad):
    before = (choices.scenario, choices.learner, choices.config, choices.route)
    assert not choices.choose(choice(**bad))
    assert choices.error
    assert (choices.scenario, choices.learner, choices.config, choices.route) == before


def test_a_scenario_edited_while_the_program_runs_counts_when_it_is_chosen_next(
    tmp_path, monkeypatch, choices
):
    shutil.copytree(models_directory() / "scenarios", tmp_path / "scenarios")
    monkeypatch.setattr("drake_shared.scenario.files.models_directory", lambda: tmp_path)
    running = choices.scenario
    edited = TrialChoices(running, None)
    for name, old, new in (("two_obstacles", "radius: 0.25", "raduis: 0.25"), ("doorway", "x: ", "x: far")):
        file = tmp_path / "scenarios" / f"{name}.yaml"
        file.write_text(file.read_text().replace(old, new, 1))
    # The one that is driven stays as it is in memory; a broken one is refused, and driving goes on.
    assert not edited.choose(choice(learner=None))
    assert (edited.scenario, edited.error) == (running, None)
    assert not edited.choose(choice(scenario="doorway", learner=None))
    assert "doorway.yaml" in edited.error
    assert edited.scenario is running
    (tmp_path / "scenarios" / "three_obstacles.yaml").unlink()
    assert not edited.choose(choice(scenario="three_obstacles", learner=None))
    assert "three_obstacles" in edited.error
    shutil.copy(models_directory() / "scenarios" / "doorway.yaml", tmp_path / "scenarios")
    assert edited.choose(choice(scenario="doorway", learner=None))
    assert edited.scenario.name == "doorway"


def test_an_instructed_route_is_named_for_every_trial_or_before_each(scenario):
    always = TrialChoices(scenario, None, route="left_right")
    always.next_trial()
    assert always.route == "left_right"
    free = TrialChoices(scenario, None, route=FREE)
    assert not free.needs_route
    ask = TrialChoices(scenario, None, route=ASK)
    assert ask.needs_route
    ask.choose(choice(learner=None, route="left_right"))
    assert not ask.needs_route
    ask.next_trial()
    assert ask.needs_route
    with pytest.raises(InputError):
        TrialChoices(scenario, None, route="nowhere")


@pytest.fixture(scope="module")
def drives():
    """One drive along each of three routes."""
    simulation = Simulation(load_scenario("two_obstacles"))
    routes = [route.name for route in simulation.scenario.routes[:3]]
    return [simulation.run(TrialSettings(driver="human", route=route, seed=9)) for route in routes]


def test_a_learner_is_trained_on_three_drives_and_saved(choices, drives, tmp_path):
    learner = choices.train(drives, tmp_path)
    assert choices.learner is learner
    (file,) = tmp_path.iterdir()
    assert load_learner(file).metadata["scenario"] == "two_obstacles"
    assert file.stem in choices.describe(usable_drives=3)["learners"]
    # The folder keeps what an earlier session, or another one, has trained.
    kept = file.read_bytes()
    choices.train(drives, tmp_path)
    assert len(list(tmp_path.iterdir())) == 2
    assert file.read_bytes() == kept


def test_the_history_lists_drives_and_deletes_the_log_of_one(drives, tmp_path):
    history = DriveHistory(tmp_path)
    for number, trial in enumerate(drives, start=1):
        (tmp_path / f"{number}.parquet").touch()
        history.add(number, describe_result(trial, f"{number}.parquet", None), trial)
    assert [drive["number"] for drive in history.describe()["drives"]] == [3, 2, 1]
    assert len(history.usable("two_obstacles")) == 3
    assert history.usable("doorway") == []
    assert history.discard(2) == "2.parquet"
    assert history.discard(2) is None
    assert [drive["number"] for drive in history.describe()["drives"]] == [3, 1]
    assert sorted(history.rows) == [1, 3]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["1.parquet", "3.parquet"]


def test_only_drives_to_the_goal_without_contact_teach(drives):
    history = DriveHistory(None)
    failed = dataclasses.replace(drives[0], metadata=drives[0].metadata | {"status": "timed_out"})
    touched = dataclasses.replace(
        drives[0], columns=dict(drives[0].columns) | {"contact": drives[0]["t"] > 1}
    )
    for number, trial in enumerate((failed, touched, drives[1]), start=1):
        history.add(number, describe_result(trial, None, None), trial)
    assert history.usable("two_obstacles") == [drives[1]]
