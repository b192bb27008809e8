"""Trials that qualify become demonstrations."""

import dataclasses

import numpy as np
import pytest

from drake_shared.cockpit.demonstration_collector import DemonstrationCollector
from drake_shared.cockpit.messages import Move
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import read_demonstrations


@pytest.fixture
def driven(human_trial):
    """A trial that a person drove."""
    return dataclasses.replace(human_trial, metadata={**human_trial.metadata, "operator": "MouseInput"})


def test_collects_trials_that_reach_the_goal_without_contact(human_trial, scenario):
    collector = DemonstrationCollector(scenario, wanted=2)
    missed = dataclasses.replace(human_trial, metadata={**human_trial.metadata, "status": "stopped"})
    touched = dataclasses.replace(
        human_trial, columns={**human_trial.columns, "contact": np.ones_like(human_trial["contact"])}
    )
    assert [collector(trial) for trial in (human_trial, missed, touched)] == [False] * 3
    assert collector(human_trial)
    assert len(collector.demonstrations) == 2
    demonstration = collector.demonstrations[0]
    np.testing.assert_array_equal(demonstration.positions, human_trial.positions)
    assert demonstration.score == pytest.approx(human_trial["clearance"].min(), abs=0.01)


def test_each_demonstration_is_in_the_file_when_it_ends(driven, scenario, tmp_path):
    collector = DemonstrationCollector(scenario, wanted=3, out=tmp_path / "demos.parquet")
    for count in (1, 2):
        collector(driven)
        found = read_demonstrations(tmp_path / "demos.parquet", scenario=scenario.name)
        assert len(found) == count
        np.testing.assert_array_equal(found.items[-1].positions, driven.positions)


def test_a_session_that_was_ended_early_is_continued(driven, scenario, tmp_path):
    first = DemonstrationCollector(scenario, wanted=3, out=tmp_path / "demos.parquet")
    first(driven)
    second = DemonstrationCollector(scenario, wanted=3, out=tmp_path / "demos.parquet")
    assert len(second.demonstrations) == 1
    assert [second(driven) for _ in range(2)] == [False, True]
    assert len(read_demonstrations(tmp_path / "demos.parquet")) == 3
    # A file that is complete is begun anew.
    assert DemonstrationCollector(scenario, wanted=3, out=tmp_path / "demos.parquet").demonstrations == []


def test_demonstrations_of_a_simulated_operator_or_another_task_are_not_continued(
    driven, human_trial, scenario, open_floor, tmp_path
):
    DemonstrationCollector(scenario, wanted=3, out=tmp_path / "simulated")(human_trial)
    DemonstrationCollector(scenario, wanted=3, out=tmp_path / "mouse")(driven)
    assert DemonstrationCollector(scenario, wanted=3, out=tmp_path / "simulated").demonstrations == []
    assert DemonstrationCollector(open_floor, wanted=3, out=tmp_path / "mouse").demonstrations == []


def test_what_a_full_disk_refused_is_written_with_the_next_demonstration(
    driven, scenario, tmp_path, monkeypatch
):
    def full(*_, **__):
        raise RunError("no space left")

    collector = DemonstrationCollector(scenario, wanted=3, out=tmp_path / "demos.parquet")
    with monkeypatch.context() as patch:
        patch.setattr("drake_shared.cockpit.demonstration_collector.write_demonstrations", full)
        with pytest.raises(RunError):
            collector(driven)
        assert collector.unsaved
    collector(driven)
    assert not collector.unsaved
    assert len(read_demonstrations(tmp_path / "demos.parquet")) == 2


def test_a_demonstration_can_be_discarded_and_what_became_of_a_trial_is_told(driven, scenario, tmp_path):
    collector = DemonstrationCollector(scenario, wanted=2, out=tmp_path / "demos.parquet")
    touched = dataclasses.replace(driven, columns={**driven.columns, "contact": np.ones(len(driven["t"]))})
    collector(touched)
    assert (collector.describe()["void"], collector.describe()["kept"]) == ("contact", 0)
    collector(driven)
    collector(driven)
    assert collector.complete
    assert collector.describe()["void"] is None
    assert not collector.discard(1)
    assert collector.discard(3)
    assert (collector.complete, collector.describe()["void"]) == (False, "discarded")
    assert len(read_demonstrations(tmp_path / "demos.parquet")) == 1
    assert collector.discard(2)
    assert not (tmp_path / "demos.parquet").exists()


def test_the_route_with_the_fewest_demonstrations_is_next(driven, scenario):
    collector = DemonstrationCollector(scenario, wanted=9)
    asked = []
    for _ in range(2 * len(scenario.routes)):
        asked.append(collector.next_route)
        route = {**driven.metadata, "route": collector.next_route}
        collector(dataclasses.replace(driven, metadata=route))
    assert asked == [route.name for route in scenario.routes] * 2


def test_without_obstacles_demonstrations_have_no_score_and_can_be_read(driven, open_floor, tmp_path):
    collector = DemonstrationCollector(open_floor, wanted=1, out=tmp_path / "demos.parquet")
    collector(driven)
    (found,) = read_demonstrations(tmp_path / "demos.parquet")
    assert found.score is None


def test_a_session_of_teaching_ends_when_there_are_enough_and_keeps_no_logs(
    start_cockpit, short_floor, until
):
    collector = DemonstrationCollector(short_floor, wanted=1)
    cockpit = start_cockpit(short_floor, teaching=collector)
    lock = cockpit.driver_lock
    until(lambda: cockpit.session.phase == "ready", "the session")
    lock.engage(1)
    until(lambda: cockpit.session.phase == "armed", "the trial")

    def reached() -> bool:
        lock.move(1, Move(x=0, y=0, forward=1, turn=0))
        return collector.complete

    until(reached, "the goal")
    until(lambda: cockpit.session.phase == "ended", "the end")
    assert collector.demonstrations[0].provenance["route"] == short_floor.routes[0].name
    assert list(cockpit.record.iterdir()) == []
