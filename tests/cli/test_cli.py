"""The command line: as a process where streams and exit status matter, in this one for the rest."""

import dataclasses
import json
import os
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from drake_shared.cli.main import main
from drake_shared.demonstrations import read_demonstrations, write_demonstrations
from drake_shared.learners import load_learner
from drake_shared.operators.named import OPERATORS
from drake_shared.simulation.trial import read_log, write_log

COMMANDS = ("drive", "teach", "train", "simulate", "fit-operator", "replay", "list", "show")
ROW = {
    *("seed", "route", "success", "intent_success", "collision", "timeout", "completion_time"),
    *("human_effort", "mean_human_weight", "disagreement", "dissimilarity", "agreement"),
    *("path_length", "clearance", "smoothness", "log"),
}


def process(*arguments: str, **options) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-m", "drake_shared.cli.main", *arguments],
        capture_output=True,
        text=True,
        timeout=100,
        **options,
    )


@pytest.fixture
def cli(capsys):
    """Runs a command in this process: its exit status, standard output and standard error."""

    def run(*arguments) -> tuple[int, str, str]:
        try:
            status = main([str(item) for item in arguments])
        except SystemExit as stopped:
            status = stopped.code
        told = capsys.readouterr()
        return status, told.out, told.err

    return run


@pytest.fixture(scope="module")
def log(human_trial, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("cli") / "trial.parquet"
    write_log(human_trial, path)
    return path


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("simulate", "--nonsense", "3"), "Unrecognized options: --nonsense"),
        (("simulate", "--trials", "many"), "--trials"),
        (("frobnicate",), "frobnicate"),
        (("simulat", "--trials", "3"), "(did you mean 'simulate'?)"),
        (("--trials", "3"), "first argument"),
        (("train", "--out", "x"), "--demos"),
        (("simulate", "--driver", "x"), "'shared', 'human', 'agent'"),
        ((), "drive, teach, train"),
    ],
)
def test_usage_that_is_wrong_is_told_in_one_line(cli, arguments, said):
    status, out, err = cli(*arguments)
    assert (status, out) == (2, "")
    assert err.startswith("drake-shared: usage: ")
    assert err.count("\n") == 1
    assert said in err


def test_simulate_as_a_process_prints_one_json_object_and_nothing_else_on_standard_output(tmp_path):
    done = process(
        *("simulate", "--driver", "human", "--trials", "2", "--seed", "3", "--json", "--out", str(tmp_path))
    )
    assert done.returncode == 0
    result = json.loads(done.stdout)
    assert done.stdout.count("\n") == 1
    assert set(result) == {"trials", "summary"}
    assert [row["seed"] for row in result["trials"]] == [3, 4]
    assert [row["route"] for row in result["trials"]] == ["left_right", "right_left"]
    for row in result["trials"]:
        assert set(row) >= ROW
        assert row["success"] is row["intent_success"] is True
        assert row["mean_human_weight"] == 1.0
        # The learner that ships looks on: what it would have done is measured, too.
        assert row["disagreement"] > 0
        assert read_log(row["log"]).metadata["seed"] == row["seed"]
    assert set(result["summary"]) == set(result["trials"][0]) - {"seed", "route", "log"}
    assert all(set(item) == {"mean", "low", "high", "n"} for item in result["summary"].values())
    assert result["summary"]["success"]["mean"] == 1.0
    assert "wrote 2 logs" in done.stderr


def test_bad_input_as_a_process_is_status_2_and_one_line(tmp_path):
    done = process("simulate", "--scenario", "nowhere.yaml", "--json", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "nowhere.yaml must be a scenario file" in done.stderr


def test_file_names_that_are_not_utf8_are_bad_input(cli):
    status, out, err = cli("train", "--demos", os.fsdecode(b"\xff.parquet"), "--out", "x")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.isascii()


def test_output_that_nobody_reads_to_its_end_is_no_failure():
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-m", "drake_shared.cli.main", "simulate", "--help"],
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("command", COMMANDS)
def test_help_says_what_the_command_does(cli, command):
    status, out, err = cli(command, "--help")
    assert (status, err) == (0, "")
    assert f"usage: drake-shared {command}" in out
    assert "--help" in out
    for option in ("--scenario", "--model", "--out", "--count"):
        # Options that may be left out do not have the default None.
        line = next((text for text in out.splitlines() if f" {option} " in text), "")
        assert "None" not in line


def test_help_names_every_command(cli):
    status, out, _ = cli("--help")
    assert status == 0
    assert all(f" {command} " in out for command in COMMANDS)


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("fly",),
        ("simulate", "--trials", "many"),
        ("simulate", "--driver", "both"),
        ("simulate", "--colour", "red"),
        ("teach",),
        ("train", "--out", "x"),
        ("replay",),
    ],
)
def test_bad_usage_is_status_2_and_nothing_on_standard_output(cli, arguments):
    status, out, err = cli(*arguments)
    assert status == 2
    assert out == ""
    assert err


ALONE = ("simulate", "--driver", "human")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((*ALONE, "--scenario", "nowhere.yaml"), "nowhere.yaml must be a scenario file"),
        ((*ALONE, "--model", "none"), "none must be a file"),
        (("simulate", "--model", "{log}"), "{log} must be a whole safetensors file"),
        ((*ALONE, "--operator", "none"), "none must be a log or one of surrogate, primary, noisy, laggy"),
        ((*ALONE, "--operator", "noisy", "--delay", "0.3"), "has a behaviour of its own; leave out --delay"),
        ((*ALONE, "--operator", "{text}"), "{text} cannot be read as a log"),
        ((*ALONE, "--out", "{text}"), "{text} must be a folder to write to"),
        ((*ALONE, "--out", "/proc/logs"), "/proc/logs must be a folder to write to"),
        ((*ALONE, "--trials", "0"), "trials must be at least 1"),
        ((*ALONE, "--workers", "0"), "workers must be at least 1"),
        ((*ALONE, "--seed", "-1"), "seed must be from 0 to 4294967295, got -1"),
        ((*ALONE, "--seed", "4294967296"), "seed must be from 0 to 4294967295"),
        ((*ALONE, "--confidence-gain", "0"), "--confidence-gain must be positive"),
        ((*ALONE, "--safety-clearance", "nan"), "--safety-clearance"),
        ((*ALONE, "--safety-clearance", "-0.1"), "--safety-clearance"),
        ((*ALONE, "--noise", "-1"), "noise must be finite and not negative"),
        ((*ALONE, "--delay", "nan"), "delay must be finite and not negative"),
        (("teach", "--out", "{folder}"), "{folder} must be a file to write, not a folder"),
        (("teach", "--out", "{text}/x"), "{text} must be a folder to write to"),
        (("teach", "--out", "{folder}/x", "--count", "0"), "must be at least"),
        (("teach", "--out", "{folder}/x", "--seed", "-1"), "seed must be from 0"),
        (("teach", "--out", "{folder}/x", "--scenario", "none"), "none must be a scenario file"),
        (("train", "--demos", "none", "--out", "{folder}/x"), "none must be a file"),
        (("train", "--demos", "{text}", "--out", "{folder}/x"), "{text} must be a whole Parquet file"),
        (("train", "--demos", "{log}", "--out", "{folder}"), "{folder} must be a file to write"),
        (("train", "--demos", "{log}", "--scenario", "doorway", "--out", "{folder}/x"), "must be 'doorway'"),
        (("replay", "none", "--out", "{folder}/x.html"), "none must be a log; there is no such file"),
        (("replay", "{text}", "--out", "{folder}/x.html"), "{text} cannot be read as a log"),
        (("replay", "{log}", "--out", "{folder}"), "{folder} must be a file to write, not a folder"),
        (("replay", "{log}", "--out", "{text}/x.html"), "{text} must be a folder to write to"),
        (("replay", "{log}", "--out", "{folder}/x.html", "--model", "none"), "none must be a file"),
        (("fit-operator",), "fit: trials must be at least one"),
        (("fit-operator", "none"), "none must be a log; there is no such file"),
        (("fit-operator", "{log}", "{text}"), "{text} cannot be read as a log"),
        (("evaluate", "--demos", "{log}", "--scenario", "doorway"), "scenario must be 'doorway'"),
        (("reproduce", "--out", "{folder}/x", "--only", "none"), "only must be among weighting"),
        (("reproduce", "--out", "{folder}/x", "--workers", "0"), "workers must be at least 1, got 0"),
        (("reproduce", "--out", "{folder}/x", "--workers", "-1"), "workers must be at least 1, got -1"),
        (("reproduce", "--out", "{folder}/x", "--cluster", "me"), "--cluster must be the"),
        (("reproduce", "--out", "{folder}/x", "--cluster", "tcp://me:1", "--workers", "1"), "combined with"),
        (("reproduce", "--out", "{text}"), "{text} must be a folder to write to"),
        (("drive", "--scenario", "none"), "none must be a scenario file"),
        (("drive", "--model", "none"), "none must be a file"),
        (("drive", "--safety-clearance", "5"), "must be from 0.001 to 1 m"),
        (("drive", "--authority.floor", "2"), "must be from 0 to 1"),
    ],
)
def test_bad_input_is_status_2_and_one_line_that_names_it(cli, log, tmp_path, arguments, said):
    folder, text = tmp_path / "folder", tmp_path / "text"
    folder.mkdir()
    text.write_text("nothing of use")
    places = {"log": log, "folder": folder, "text": text}
    status, out, err = cli(*(item.format(**places) for item in arguments))
    assert status == 2
    assert out == ""
    assert err.startswith("drake-shared: ")
    assert err.count("\n") == 1
    assert said.format(**places) in err
    assert list(folder.iterdir()) == []


def test_a_run_that_fails_is_status_1(cli, tmp_path):
    status, out, err = cli("teach", "--out", tmp_path / "demos", "--late-start", "14")
    assert status == 1
    assert out == ""
    assert "the operator failed on route left_right" in err
    assert not (tmp_path / "demos").exists()


def test_simulate_prints_a_table_for_people(cli):
    status, out, _ = cli(*ALONE, "--trials", "2")
    assert status == 0
    assert out.startswith("2 trials")
    lines = {line.split()[0]: line for line in out.splitlines()[1:]}
    assert "disagreement" in lines
    # Each figure with its unit, which way is better, and what it means.
    assert " m " in lines["path_length"]
    assert "lower is better" in lines["path_length"]
    assert "Length of the path driven." in lines["path_length"]


def test_list_names_everything_that_can_be_named(cli):
    status, out, _ = cli("list")
    assert status == 0
    words = set(out.split())
    assert {"two_obstacles", "cnmp", "two_obstacles_paper", "traded", "laggy", "pioneer_p3dx.sdf"} <= words
    status, out, _ = cli("list", "arbiters", "operators", "--json")
    listed = json.loads(out)
    assert set(listed) == {"arbiters", "operators"}
    assert set(OPERATORS) <= set(listed["operators"])
    assert all(text.endswith((".", ")")) for names in listed.values() for text in names.values())


def test_list_includes_what_other_packages_register(cli, monkeypatch):
    point = EntryPoint("mine", "collections:OrderedDict", "drake_shared.arbiters")
    broken = EntryPoint("broken", "no_such_module:Thing", "drake_shared.arbiters")

    def registered(*, group):
        return [point, broken] if group == "drake_shared.arbiters" else []

    monkeypatch.setattr("drake_shared.common.entry_points.entry_points", registered)
    status, out, _ = cli("list", "arbiters", "--json")
    arbiters = json.loads(out)["arbiters"]
    assert status == 0
    assert arbiters["mine"].startswith("Dictionary that remembers insertion order")
    assert "no_such_module" in arbiters["broken"]


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("simulate", "--scenario", "two_obstacle"), "'two_obstacles'"),
        (("simulate", "--operator", "nosy"), "'noisy'"),
        (("simulate", "--arbitration", "blnd"), "'blend'"),
        (("simulate", "--model", "doorway_papr"), "'doorway_paper'"),
        (("drive", "--operator", "surogate"), "'surrogate'"),
    ],
)
def test_a_misspelt_name_is_answered_with_the_likely_one(cli, tmp_path, monkeypatch, arguments, name):
    monkeypatch.chdir(tmp_path)
    status, _, err = cli(*arguments)
    assert status == 2
    assert f"(did you mean {name}?)" in err


def test_a_learner_implies_its_scenario(cli, tmp_path, monkeypatch, taught):
    _, out, err = cli("simulate", "--model", "doorway_default", "--json", "--out", tmp_path / "logs")
    (row,) = json.loads(out)["trials"]
    assert read_log(row["log"]).metadata["scenario"]["name"] == "doorway"
    assert "warning" not in err
    # One of a task of someone's own finds the file beside it, or says that it must be given.
    own = tmp_path / "own.yaml"
    shipped = Path(__file__).parents[2] / "models" / "scenarios" / "two_obstacles.yaml"
    own.write_text(shipped.read_text().replace("name: two_obstacles", "name: own"))
    demos = read_demonstrations(taught / "demos.parquet")
    (tmp_path / "models").mkdir()
    demos = dataclasses.replace(demos, metadata={**demos.metadata, "scenario": "own"})
    write_demonstrations(tmp_path / "own.parquet", demos)
    model = tmp_path / "models" / "own.safetensors"
    assert cli("train", "--demos", tmp_path / "own.parquet", "--out", model, "--learner", "cesn")[0] == 0
    monkeypatch.chdir(tmp_path / "models")
    status, _, err = cli("simulate", "--model", model)
    assert (status, err.count("\n")) == (2, 1)
    assert "--scenario must be given" in err
    monkeypatch.chdir(tmp_path)
    status, out, _ = cli("simulate", "--model", model, "--json")
    assert status == 0


def test_a_replay_that_leaves_the_recording_gives_no_figures(cli, log, taught, tmp_path):
    arguments = ("replay", log, "--out", tmp_path / "x.html", "--model", taught / "learner")
    status, out, _ = cli(*arguments, "--arbitration", "agent")
    assert status == 0
    assert "left" in out
    assert "path_length" not in out
    status, out, _ = cli(*arguments, "--arbitration", "human")
    assert status == 0
    assert "path_length" in out


def test_a_folder_is_taken_where_logs_are(cli, log, tmp_path):
    status, out, _ = cli("fit-operator", log.parent)
    assert status == 0
    assert out.startswith("a model fitted to 1 trial")
    status, _, err = cli("fit-operator", tmp_path)
    assert status == 2
    assert str(tmp_path) in err


def test_simulate_takes_an_operator_by_name(cli, tmp_path):
    status, out, _ = cli(*ALONE, "--operator", "resting", "--json", "--out", tmp_path)
    assert status == 0
    told = read_log(json.loads(out)["trials"][0]["log"]).metadata
    assert (told["operator"], told["behaviour"]["pause"]) == ("SurrogateOperator", 2.0)
    status, out, _ = cli(*ALONE, "--operator", "switching", "--json", "--out", tmp_path / "other")
    assert status == 0
    assert read_log(json.loads(out)["trials"][0]["log"]).metadata["then"] == "left_left"


def test_simulate_takes_a_registered_operator(cli, tmp_path, monkeypatch):
    point = EntryPoint("idle", "tests_idle_operator:make_operator", "drake_shared.operators")
    (tmp_path / "tests_idle_operator.py").write_text(IDLE_OPERATOR)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(
        "drake_shared.common.entry_points.entry_points",
        lambda *, group: [point] if group == "drake_shared.operators" else [],
    )
    arguments = (*ALONE, "--operator", "idle")
    status, out, _ = cli(*arguments, "--json", "--out", tmp_path / "logs")
    assert status == 0
    told = read_log(json.loads(out)["trials"][0]["log"]).metadata
    assert (told["operator"], told["route"], told["status"]) == ("IdleOperator", None, "timed_out")
    assert cli(*arguments, "--noise", "0.5")[0] == 2


IDLE_OPERATOR = """
from pydrake.systems.framework import LeafSystem

class IdleOperator(LeafSystem):
    def __init__(self):
        super().__init__()
        self.DeclareStateOutputPort("human_command", self.DeclareDiscreteState(2))

def make_operator(*, scenario, source, period):
    return IdleOperator()
"""


def test_the_help_of_simulate_names_every_operator(cli):
    status, out, _ = cli("simulate", "--help")
    assert status == 0
    words = out.replace(",", " ").replace(";", " ").split()
    assert set(OPERATORS) <= set(words)


def test_a_name_wins_over_a_file_of_that_name(cli, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "laggy").write_text("nothing of use")
    assert cli(*ALONE, "--operator", "laggy", "--json")[0] == 0


def test_fit_operator_says_whose_model_it_is_and_how_well_it_fits(cli, log, human_trial, tmp_path):
    status, out, err = cli("fit-operator", log)
    assert (status, err) == (0, "")
    assert out.startswith("a model fitted to 1 trial (")
    assert "of a simulated operator" in out
    assert "set to 0.2" in out
    assert "of the variance of the commands" in out
    status, out, _ = cli("fit-operator", log, log, "--json")
    assert status == 0
    fit = json.loads(out)
    assert out.count("\n") == 1
    assert fit["operator"] == "simulated operator"
    assert set(fit["skill"]) == {"value", "low", "high"}
    assert fit["yielding"] is None
    assert fit["set"]["delay"] == 0.2
    person = {**human_trial.metadata, "operator": "MouseInput"}
    write_log(dataclasses.replace(human_trial, metadata=person), tmp_path / "person.parquet")
    status, out, _ = cli("fit-operator", tmp_path / "person.parquet")
    assert status == 0
    assert "of a person" in out
    assert "set to" not in out
    assert "a fit of a model to these drives" in out


def test_fit_operator_keeps_no_person_of_drives_that_it_cannot_fit(cli, human_trial, tmp_path):
    wheel = np.full(len(human_trial["t"]), 3.0)
    columns = {**human_trial.columns, "human_left": wheel, "human_right": wheel}
    write_log(dataclasses.replace(human_trial, columns=columns), tmp_path / "constant.parquet")
    file = tmp_path / "anna.json"
    status, out, err = cli("fit-operator", tmp_path / "constant.parquet", "--json", "--person", file)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "constant.parquet" in err
    assert not file.exists()


def test_simulate_plays_a_log_back(cli, log, human_trial, tmp_path):
    status, out, _ = cli(*ALONE, "--operator", log, "--out", tmp_path, "--json")
    assert status == 0
    (row,) = json.loads(out)["trials"]
    back = read_log(row["log"])
    assert back.metadata["operator"] == "RecordedInput"
    assert (back.positions == human_trial.positions).all()


def test_a_log_of_another_task_is_played_back_with_a_warning_that_names_both(cli, log):
    status, _, err = cli(*ALONE, "--operator", log, "--scenario", "doorway", "--json")
    assert status == 0
    assert f"{log} was recorded in scenario 'two_obstacles', not 'doorway'" in err


def test_simulate_needs_no_learner_for_a_human_alone_in_a_task_of_someones_own(cli, tmp_path):
    task = Path(__file__).parents[2] / "models" / "scenarios" / "doorway.yaml"
    (tmp_path / "mine.yaml").write_text(task.read_text().replace("name: doorway", "name: mine"))
    status, out, _ = cli(*ALONE, "--scenario", tmp_path / "mine.yaml", "--json")
    assert status == 0
    assert json.loads(out)["trials"][0]["success"]
    status, _, err = cli("simulate", "--scenario", tmp_path / "mine.yaml")
    assert status == 2
    assert "--model must be given: no learner ships for scenario 'mine'" in err


def test_behaviour_of_the_operator_can_be_set(cli):
    def effort(*options) -> float:
        _, out, _ = cli(*ALONE, "--json", *options)
        return json.loads(out)["trials"][0]["completion_time"]

    assert effort("--speed-factor", "1.3") < effort() - 1.0


@pytest.fixture(scope="module")
def taught(tmp_path_factory) -> Path:
    """A folder with demonstrations and a learner that was trained on them, both by the command line."""
    folder = tmp_path_factory.mktemp("taught")
    assert main(["teach", "--out", str(folder / "demos.parquet")]) == 0
    training = ["train", "--demos", str(folder / "demos.parquet"), "--out", str(folder / "learner")]
    assert main([*training, "--iterations", "300", "--seed", "1"]) == 0
    return folder


def test_teach_then_train_make_a_learner_of_the_task(taught):
    demonstrations = read_demonstrations(taught / "demos.parquet")
    assert len(demonstrations) == 3
    assert demonstrations.scenario == "two_obstacles"
    learner = load_learner(taught / "learner")
    assert learner.metadata["scenario"] == "two_obstacles"
    assert learner.demonstrations.shape[0] == 3


def test_a_training_that_stops_early_is_reported_by_train_and_evaluate(cli, taught, tmp_path):
    arguments = (
        "train",
        "--demos",
        taught / "demos.parquet",
        "--out",
        tmp_path / "early",
        "--preset",
        "paper",
    )
    status, out, err = cli(*arguments, "--iterations", 5, "--calibration", "largest", "--json")
    assert (status, json.loads(out)["training"]["reached_threshold"]) == (0, False)
    assert "warning" in err
    evaluate = ("evaluate", "--demos", taught / "demos.parquet", "--trials", 0, "--json")
    found = json.loads(cli(*evaluate, "--model", tmp_path / "early")[1])["loss_threshold"]
    assert found["threshold"] == -6.0 < found["loss"]
    assert not found["reached"]
    assert json.loads(cli(*evaluate, "--preset", "paper")[1])["loss_threshold"]["reached"]
    assert json.loads(cli(*evaluate)[1])["loss_threshold"] is None


def test_evaluate_writes_a_learner_whose_confidence_is_a_probability(cli, taught, tmp_path):
    evaluate = ("evaluate", "--model", taught / "learner", "--demos", taught / "demos.parquet", "--json")
    file = tmp_path / "calibrated"
    assert cli(*evaluate, "--trials", 1, "--calibrate", file)[0] == 0
    calibration = load_learner(file).metadata["confidence_calibration"]
    assert load_learner(taught / "learner").metadata.get("confidence_calibration") is None
    status, out, _ = cli("simulate", "--model", file, "--json", "--out", tmp_path / "logs")
    assert status == 0
    confidence = read_log(json.loads(out)["trials"][0]["log"])["confidence"]
    assert confidence.max() <= max(calibration["probability"])
    for where, trials in ((tmp_path, 1), (file / "inside", 1), (tmp_path / "other", 0)):
        status, out, err = cli(*evaluate, "--trials", trials, "--calibrate", where)
        assert (status, out, err.count("\n")) == (2, "", 1)
    assert not (tmp_path / "other").exists()


def test_simulate_shares_the_control_with_it(cli, taught, tmp_path):
    arguments = ("simulate", "--model", taught / "learner", "--trials", "2", "--json", "--out")
    status, out, err = cli(*arguments, tmp_path / "one")
    assert status == 0
    assert "warning" not in err
    rows = json.loads(out)["trials"]
    assert all(0.0 < row["mean_human_weight"] < 1.0 for row in rows)
    assert all(row["disagreement"] > 0 for row in rows)
    again = json.loads(cli(*arguments, tmp_path / "two")[1])["trials"]
    assert [{**row, "log": None} for row in again] == [{**row, "log": None} for row in rows]


def test_a_learner_of_another_task_is_used_with_a_warning_that_names_both(cli, taught):
    status, _, err = cli("simulate", "--model", taught / "learner", "--scenario", "doorway", "--json")
    assert status == 0
    assert "was taught scenario 'two_obstacles', not 'doorway'" in err


def test_replay_writes_a_page_with_the_prediction(cli, log, taught, tmp_path):
    status, out, err = cli("replay", log, "--out", tmp_path / "with.html", "--model", taught / "learner")
    assert (status, out) == (0, "")
    assert f"wrote {tmp_path / 'with.html'}" in err
    other = Path(__file__).parents[2] / "models" / "learners" / "doorway_default.safetensors"
    status, _, err = cli("replay", log, "--out", tmp_path / "other.html", "--model", other)
    assert status == 0
    assert "was taught scenario 'doorway', not 'two_obstacles'" in err
    status, _, err = cli("replay", log, "--out", tmp_path / "without.html")
    assert status == 0
    assert "without a prediction" in err
    assert (tmp_path / "with.html").stat().st_size > (tmp_path / "without.html").stat().st_size
