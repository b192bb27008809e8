"""A folder holds complete files of one run of one version of the code."""

import errno
import importlib.metadata
import json
from pathlib import Path

import pytest

from drake_shared.common.errors import InputError, RunError
from drake_shared.simulation.runner import JsonStore, Task, run_tasks, store as store_module

TASK = Task("example_tasks:extremes")


def test_a_stored_value_is_the_value_returned(store):
    (fresh,) = run_tasks([TASK], store)
    assert repr(store.read(TASK)) == repr(fresh) == repr(TASK.run())


def test_a_task_that_was_not_run_has_no_value(store):
    with pytest.raises(KeyError):
        store.read(TASK)


@pytest.mark.parametrize("content", ["", "[]", '{"value":1}', '{"function":"a:b","arguments":{},"value":1}'])
def test_a_damaged_result_is_computed_again(store, content):
    run_tasks([TASK], store)
    (path,) = (store.folder / "results").iterdir()
    path.write_text(content)
    with pytest.raises(KeyError):
        store.read(TASK)
    assert repr(run_tasks([TASK], store)) == repr([TASK.run()])


def test_the_folder_describes_the_run_and_its_code(store):
    run = json.loads((store.folder / "run.json").read_text())
    assert run["description"] == {"trials": 4}
    assert run["package"]["version"] == importlib.metadata.version("drake_shared")
    assert len(run["package"]["source"]) == 24


def test_a_folder_with_results_needs_resume_or_force(store):
    with pytest.raises(InputError, match=r"--resume .* --force") as caught:
        JsonStore.open(store.folder, {"trials": 4})
    assert "\n" not in str(caught.value)


def test_a_folder_with_other_files_is_refused_and_left_unchanged(tmp_path):
    (tmp_path / "thesis.tex").write_text("years")
    with pytest.raises(InputError, match="--force"):
        JsonStore.open(tmp_path, {})
    with pytest.raises(InputError, match=str(tmp_path)):
        JsonStore.open(tmp_path, {}, resume=True)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_resume_starts_a_run_in_a_new_folder(tmp_path):
    JsonStore.open(tmp_path / "new", {"trials": 4}, resume=True)
    assert (tmp_path / "new" / "run.json").is_file()


def test_only_the_same_run_is_resumed(store):
    run_tasks([TASK], store)
    assert repr(JsonStore.open(store.folder, {"trials": 4}, resume=True).read(TASK)) == repr(TASK.run())
    with pytest.raises(InputError, match="trials is 4, not 5"):
        JsonStore.open(store.folder, {"trials": 5}, resume=True)


def test_a_difference_in_a_long_description_is_reported_in_short(tmp_path):
    scenario = {"name": "doorway", "obstacles": [{"name": f"crate {i}", "x": float(i)} for i in range(50)]}
    JsonStore.open(tmp_path, {"scenario": scenario})
    with pytest.raises(InputError, match=r"scenario\.name is 'doorway', not 'room'"):
        JsonStore.open(tmp_path, {"scenario": {"name": "room", "obstacles": []}}, resume=True)
    with pytest.raises(InputError, match=r"scenario\.obstacles is \[.*\.\.\.\], not \[\]; ") as caught:
        JsonStore.open(tmp_path, {"scenario": {**scenario, "obstacles": []}}, resume=True)
    assert len(str(caught.value)) < 500


def test_results_of_other_code_are_not_resumed(store, monkeypatch):
    other = {**store_module.identity(), "source": "0" * 24}
    monkeypatch.setattr(store_module, "identity", lambda: other)
    with pytest.raises(InputError, match=r"source is .*0000"):
        JsonStore.open(store.folder, {"trials": 4}, resume=True)


@pytest.mark.parametrize("content", ["", "{", "[]", '{"format": "other"}'])
def test_a_damaged_description_is_not_resumed(store, content):
    (store.folder / "run.json").write_text(content)
    with pytest.raises(InputError, match=r"run\.json"):
        JsonStore.open(store.folder, {"trials": 4}, resume=True)


def test_force_removes_only_files_of_the_store(store):
    run_tasks([TASK], store)
    notes = store.folder / "results" / "notes.txt"
    notes.write_text("mine")
    (store.folder / "results" / f".{TASK.key}.json.k3v9_2ab").write_text("half")
    (store.folder / ".run.json.k3v9_2ab").write_text("half")
    (store.folder / "figure.png").write_text("mine")
    restarted = JsonStore.open(store.folder, {"trials": 5}, force=True)
    assert sorted(path.name for path in store.folder.rglob("*")) == [
        "figure.png",
        "notes.txt",
        "results",
        "run.json",
    ]
    with pytest.raises(KeyError):
        restarted.read(TASK)


def test_resume_and_force_exclude_each_other(store):
    with pytest.raises(InputError, match="--resume or --force"):
        JsonStore.open(store.folder, {"trials": 4}, resume=True, force=True)


def test_temporary_files_of_a_killed_run_are_ignored(tmp_path, make_walks, files_of):
    (tmp_path / ".run.json.k3v9_2ab").write_text("{")
    store = JsonStore.open(tmp_path, {})
    (first, second) = make_walks(2)
    run_tasks([first], store)
    (tmp_path / "results" / f".{second.key}.json.abcdefgh").write_text("{")
    assert repr(run_tasks([first, second], JsonStore.open(tmp_path, {}, resume=True))) == repr(
        [first.run(), second.run()]
    )


def full_disk(*_args, **_options):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    "where", ["drake_shared.common.files.tempfile.TemporaryFile", "pathlib.Path.write_text"]
)
def test_a_full_disk_ends_the_run_and_keeps_completed_results(
    store, make_walks, files_of, monkeypatch, where
):
    done, to_do = make_walks(2)
    run_tasks([done], store)
    before = files_of(store.folder)
    with monkeypatch.context() as patch:
        patch.setattr(where, full_disk)
        with pytest.raises(RunError, match="No space left on device") as caught:
            run_tasks([done, to_do], store)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(store.folder))
    assert files_of(store.folder) == before
    assert len(run_tasks([done, to_do], JsonStore.open(store.folder, {"trials": 4}, resume=True))) == 2


def test_a_removed_folder_ends_the_run_and_is_not_created_again(store, make_walks):
    for path in [*store.folder.iterdir()]:
        path.unlink()
    store.folder.rmdir()
    with pytest.raises(RunError, match=r"run\.json"):
        run_tasks(make_walks(1), store)
    assert not store.folder.exists()


def test_a_folder_that_cannot_be_made_is_bad_input():
    with pytest.raises(InputError, match="/proc/run must be a folder to write to"):
        JsonStore.open("/proc/run", {})
    with pytest.raises(InputError, match="must be a folder to write to"):
        JsonStore.open(Path(__file__), {})
