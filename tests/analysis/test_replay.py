"""A trial as a self-contained page."""

import logging

import pytest

from drake_shared.analysis.replay import write_replay
from drake_shared.common.errors import InputError
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings


@pytest.fixture(scope="module")
def page(human_trial, _two_obstacles, route_learner, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("replay") / "deep" / "trial.html"
    write_replay(human_trial, path, learner=route_learner(_two_obstacles))
    return path.read_text(encoding="utf-8")


def test_the_page_is_self_contained(page):
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert 'src="http' not in page
    assert 'src="meshcat.js' not in page


def test_the_address_of_the_meshcat_that_draws_it_is_not_logged(human_trial, tmp_path, caplog):
    logger = logging.getLogger("drake")
    with caplog.at_level(logging.INFO, logger="drake"):
        logger.info("recorded")
        write_replay(human_trial, tmp_path / "trial.html", learner=None)
    assert [record.message for record in caplog.records if record.name == "drake"] == ["recorded"]


def scene(page: str) -> bytes:
    """The base64 messages of the page, concatenated."""
    import base64
    import re

    return b"".join(base64.b64decode(text) for text in re.findall(r"base64,([A-Za-z0-9+/=]+)", page))


def test_the_page_holds_robot_and_obstacles(page):
    messages = scene(page)
    for path in (b"scene/robot/base_pioneer_p3dx_body", b"first_drawn", b"second_drawn"):
        assert path in messages, path


def content(page: str) -> dict:
    """What the page shows."""
    import json
    import re

    return json.loads(re.search(r'<script type="application/json" id="replay">(.*?)</script>', page)[1])


def test_the_page_holds_task_rows_and_predictions(page, human_trial):
    shown = content(page)
    assert shown["task"]["goal"][:2] == [5.0, 0.0]
    assert len(shown["task"]["obstacles"]) == 2
    rows = shown["rows"]
    assert rows["t"] == pytest.approx(human_trial["t"].tolist(), abs=1e-4)
    assert [x for x, _, _ in rows["pose"]] == pytest.approx(human_trial["x"].tolist(), abs=1e-4)
    assert len(shown["routes"]) == (len(rows["t"]) + 1) // 2
    (route,) = shown["routes"][0]
    assert route["probability"] == 1.0
    assert route["center"][0] == pytest.approx([0.0, 0.0], abs=1e-4)
    assert shown["status"] == human_trial.status


def test_obstacles_that_move_are_moved_where_the_page_has_them(human_trial, tmp_path):
    cart = {"name": "cart", "radius": 0.1, "path": [[0.0, 2.5, 1.4], [10.0, 2.5, 1.0]]}
    scenario = human_trial.metadata["scenario"]
    moving = scenario | {"obstacles": [*scenario["obstacles"], cart]}
    trial = Trial(columns=human_trial.columns, metadata=human_trial.metadata | {"scenario": moving})
    write_replay(trial, tmp_path / "trial.html")
    page = (tmp_path / "trial.html").read_text(encoding="utf-8")
    (path, positions), *others = content(page)["moving"].items()
    assert others == []
    assert f"{path}/cart_drawn".encode() in scene(page)
    assert positions[0] == [2.5, 1.4]
    assert positions[20] == pytest.approx([2.5, 1.36])


def without_repetitions(calls) -> list:
    """The calls for what was observed; others ask for the routes, given later points too."""
    observed = [[part.tolist() for part in call] for call in calls if len(call[0]) <= 2]
    return [call for index, call in enumerate(observed) if index == 0 or call != observed[index - 1]]


@pytest.mark.parametrize("clock", ["time", "progress"])
def test_the_prediction_is_the_one_that_the_trial_had(scenario, route_learner, tmp_path, clock):
    """The observations at every step are the same: the position and that to which the command leads."""
    learner = route_learner(scenario, variance=0.05, clock=clock)
    learner.metadata |= {"evidence": "pose+command"}
    simulation = Simulation(scenario, learner=learner)
    learner.calls.clear()
    trial = simulation.run(TrialSettings(route="right_left"))
    recorded = without_repetitions(learner.calls)
    learner.calls.clear()
    write_replay(trial, tmp_path / "trial.html", learner=learner)
    replayed = without_repetitions(learner.calls)
    # The page is drawn every other step, perhaps not at the last row, which takes two predictions.
    assert len(recorded) - len(replayed) in (0, 1, 2)
    assert replayed == recorded[: len(replayed)]
    assert max(len(times) for times, _, _ in recorded) == 2


def test_a_trial_without_steps_is_drawn(scenario, tmp_path):
    write_replay(Simulation(scenario).begin(TrialSettings()).finish(), tmp_path / "trial.html")
    assert (tmp_path / "trial.html").stat().st_size > 1e5


def test_without_a_learner_the_page_has_no_prediction(human_trial, tmp_path):
    write_replay(human_trial, tmp_path / "trial.html")
    assert (tmp_path / "trial.html").stat().st_size > 1e5


def test_an_invalid_scenario_is_refused_and_leaves_no_file(human_trial, tmp_path):
    broken = Trial(columns=human_trial.columns, metadata=human_trial.metadata | {"scenario": {"name": "x"}})
    with pytest.raises(InputError, match="the log's scenario"):
        write_replay(broken, tmp_path / "trial.html")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_refused(human_trial, tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="taken"):
        write_replay(human_trial, tmp_path / "taken" / "trial.html")


def test_another_robot_is_refused(human_trial, tmp_path):
    robot = {**human_trial.metadata["robot"], "type": "Quadrotor"}
    other = Trial(columns=human_trial.columns, metadata={**human_trial.metadata, "robot": robot})
    with pytest.raises(InputError, match="Quadrotor"):
        write_replay(other, tmp_path / "trial.html")
