"""Lineage of learners: their data and the learners before them."""

import json

import pytest

from drake_shared.analysis.lineage import autonomy_share, driver_of, lineage, trace
from drake_shared.cli.main import main
from drake_shared.common.errors import InputError
from drake_shared.demonstrations import read_demonstrations, write_demonstrations
from drake_shared.learners import load_learner, save_learner, train
from drake_shared.scenario import load_scenario
from drake_shared.simulation.teaching import teach
from drake_shared.simulation.trial import Simulation, TrialSettings, write_log


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    """A folder: demos.parquet, first (trained on it), logs with first, second (trained on all)."""
    folder = tmp_path_factory.mktemp("family")
    scenario = load_scenario()
    write_demonstrations(folder / "demos.parquet", teach(scenario))
    save_learner(
        train(read_demonstrations(folder / "demos.parquet"), learner="cesn"), folder / "first.safetensors"
    )
    simulation = Simulation(scenario, learner=load_learner(folder / "first.safetensors"))
    logs = [folder / f"log{index}.parquet" for index in range(2)]
    for index, log in enumerate(logs):
        write_log(simulation.run(TrialSettings(route="left_right", seed=index)), log)
    write_log(simulation.run(TrialSettings(route="left_left", driver="human")), folder / "alone.parquet")
    files = [folder / "demos.parquet", *logs, folder / "alone.parquet"]
    save_learner(train(read_demonstrations(files), learner="cesn"), folder / "second.safetensors")
    return folder


def test_lineage_has_the_data_and_the_learner_that_took_part(family):
    second = lineage(family / "second.safetensors", [family])
    assert second.counts == {"human": 4, "shared": 2, "agent": 0, "unknown": 0}
    assert second.drivers == {"simulated operator": 4, "shared with simulated operator": 2}
    (first,) = second.parents
    assert first.file == str(family / "first.safetensors")
    assert first.id == load_learner(first.file).metadata["id"]
    assert first.counts == {"human": 3, "shared": 0, "agent": 0, "unknown": 0}
    assert (first.autonomy, first.parents) == (0.0, ())
    assert [item.state for item in second.data] == ["unchanged"] * 4
    shared = [item for item in second.data if item.sources[0]["mode"] == "shared"]
    assert [item.sources[0]["seed"] for item in shared] == [0, 1]
    weights = [item.sources[0]["human_weight"] for item in shared]
    assert all(0.0 < weight < 1.0 for weight in weights)
    # Four of the six are by the human alone.
    assert second.autonomy == pytest.approx(sum(1.0 - weight for weight in weights) / 6)


def test_a_learner_without_influence_on_the_human_alone_is_not_a_parent(family):
    data = read_demonstrations(family / "alone.parquet")
    assert data[0].provenance["learner_id"] == lineage(family / "first.safetensors").id
    learner = train(data, learner="cesn")
    assert "learner_id" in learner.metadata["training"]["sources"][0]
    save_learner(learner, family / "alone.safetensors")
    assert lineage(family / "alone.safetensors", [family]).parents == ()


def test_changed_and_missing_files_are_reported(family, tmp_path):
    for name in ("second.safetensors", "demos.parquet"):
        (tmp_path / name).write_bytes((family / name).read_bytes())
    first = lineage(family / "first.safetensors")
    described = {"training": {"sources": [dict(item) for file in first.data for item in file.sources]}}
    for source in described["training"]["sources"]:
        source["file"] = "demos.parquet"
    files = {"a": str(tmp_path / "second.safetensors")}
    assert trace("a", files.get, lambda _: described).data[0].state == "unchanged"
    (tmp_path / "demos.parquet").write_bytes(b"something else")
    assert trace("a", files.get, lambda _: described).data[0].state == "changed"
    (tmp_path / "demos.parquet").unlink()
    assert trace("a", files.get, lambda _: described).data[0].state == "missing"
    (parent,) = lineage(tmp_path / "second.safetensors", [tmp_path]).parents
    assert (parent.file, parent.id) == (None, first.id)


def test_a_learner_that_is_its_own_ancestor_is_listed_once():
    sources = {
        "a": [{"mode": "shared", "learner_id": "b", "human_weight": 0.25}],
        "b": [{"mode": "shared", "learner_id": "a"}, {}],
    }
    files = {"a": "a", "b": "b"}
    one = trace("a", files.get, lambda file: {"training": {"sources": sources[file]}})
    (other,) = one.parents
    (again,) = other.parents
    assert (one.id, other.id, again.id) == ("a", "b", "a")
    assert again.told
    assert again.parents == ()
    assert one.autonomy == 0.75
    assert other.autonomy is None


def test_autonomy_share_follows_from_the_mode_if_the_weight_is_unknown():
    assert autonomy_share([{"mode": "human"}, {"mode": "agent"}, {"mode": "shared"}, {}]) == 0.5


@pytest.mark.parametrize(
    ("source", "driver"),
    [
        ({"mode": "human", "operator": "SurrogateOperator"}, "simulated operator"),
        ({"mode": "human", "operator": "MouseInput"}, "person"),
        ({"mode": "human"}, "unknown operator"),
        ({"mode": "human", "operator": "RecordedInput"}, "recorded commands"),
        ({"mode": "human", "operator": "Joystick"}, "operator Joystick"),
        ({"mode": "shared", "operator": "MouseInput"}, "shared with person"),
        ({"mode": "agent", "operator": "SurrogateOperator"}, "agent"),
        ({}, "unknown"),
    ],
)
def test_the_driver_of_a_demonstration_follows_from_mode_and_operator(source, driver):
    assert driver_of(source) == driver


@pytest.mark.parametrize("learner", ["cnmp", "ensemble", "mixture", "cesn", "promp"])
def test_every_learner_keeps_its_sources(learner, family, tmp_path):
    if learner == "promp":
        pytest.importorskip("movement_primitives")
    options = {"members": 2} if learner == "ensemble" else {}
    data = read_demonstrations(family / "demos.parquet")
    save_learner(train(data, learner=learner, iterations=2, **options), tmp_path / "learner")
    sources = load_learner(tmp_path / "learner").metadata["training"]["sources"]
    assert [item["route"] for item in sources] == ["left_right", "right_left", "left_left"]
    assert {item["sha256"] for item in sources} == {data[0].provenance["sha256"]}


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="none"):
        lineage(tmp_path / "none")


def test_command_prints_two_generations(family, capsys):
    assert main(["lineage", str(family / "second.safetensors")]) == 0
    printed = capsys.readouterr().out
    for name in ("first", "second"):
        assert lineage(family / f"{name}.safetensors").id in printed
        assert str(family / f"{name}.safetensors") in printed
    assert "4 simulated operator" in printed
    assert "2 shared with simulated operator" in printed
    assert main(["lineage", str(family / "second.safetensors"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["parents"][0]["file"] == str(family / "first.safetensors")


def test_commands_from_teaching_to_lineage(tmp_path, capsys):
    demos, first, second = (str(tmp_path / name) for name in ("demos.parquet", "first", "second"))
    logs = tmp_path / "logs"
    few = ("--iterations", "20")
    commands = [
        ("teach", "--out", demos),
        ("train", "--demos", demos, "--out", first, "--learner", "cesn"),
        ("simulate", "--model", first, "--out", str(logs)),
    ]
    for command in commands:
        assert main(list(command)) == 0
    (log,) = logs.iterdir()
    assert main(["train", "--demos", demos, str(log), "--out", second, *few]) == 0
    capsys.readouterr()
    assert main(["lineage", second, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["counts"]["shared"] == 1
    assert [parent["file"] for parent in printed["parents"]] == [first]
    assert main(["lineage", str(tmp_path / "none")]) == 2
    assert str(tmp_path / "none") in capsys.readouterr().err
