"""A folder holds one run of one code, whole files, and nothing of it is lost by accident."""

import errno
import json
from pathlib import Path

import pytest

from drake_shared.common.errors import InputError, RunError
from drake_shared.simulation.runner import Store, Task, run_tasks
from drake_shared.simulation.runner import store as store_module

TASK = Task("chores:extremes")


def test_what_is_read_is_what_the_task_returned(store):
    (fresh,) = run_tasks([TASK], store)
    assert repr(store.read(TASK)) == repr(fresh) == repr(TASK.run())


def test_a_task_that_is_not_done_is_not_there(store):
    with pytest.raises(KeyError):
        store.read(TASK)


@pytest.mark.parametrize("content", ["", "[]", '{"value":1}', '{"function":"a:b","arguments":{},"value":1}'])
def test_a_file_that_does_not_hold_the_result_is_no_result(store, content):
    run_tasks([TASK], store)
    (path,) = (store.folder / "results").iterdir()
    path.write_text(content)
    with pytest.raises(KeyError):
        store.read(TASK)
    assert repr(run_tasks([TASK], store)) == repr([TASK.run()])


def test_the_folder_says_what_the_run_is_and_what_code_made_it(store):
    said = json.loads((store.folder / "run.json").read_text())
    assert said["description"] == {"trials": 4}
    assert said["package"]["version"] == "0.1.0"
    assert len(said["package"]["source"]) == 24


def test_a_folder_with_results_is_refused_in_one_line_that_says_what_to_do(store):
    with pytest.raises(
        InputError, match=r"must be empty: give --resume .* --force .* or another folder"
    ) as caught:
        Store.open(store.folder, {"trials": 4})
    assert "\n" not in str(caught.value)


def test_a_folder_with_anything_else_is_refused_and_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years")
    with pytest.raises(InputError, match="must be empty: give --force to begin a run beside what is there"):
        Store.open(tmp_path, {})
    with pytest.raises(InputError, match="must hold a run to be resumed"):
        Store.open(tmp_path, {}, resume=True)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_run_that_was_not_begun_can_be_resumed(tmp_path):
    Store.open(tmp_path / "new", {"trials": 4}, resume=True)
    assert (tmp_path / "new" / "run.json").is_file()


def test_only_the_same_run_is_resumed(store):
    run_tasks([TASK], store)
    assert repr(Store.open(store.folder, {"trials": 4}, resume=True).read(TASK)) == repr(TASK.run())
    with pytest.raises(
        InputError, match="must hold the same run to be resumed: trials is 4, not 5; give --force"
    ):
        Store.open(store.folder, {"trials": 5}, resume=True)


def test_a_long_description_that_differs_is_said_in_short(tmp_path):
    scenario = {"name": "doorway", "obstacles": [{"name": f"crate {i}", "x": float(i)} for i in range(50)]}
    Store.open(tmp_path, {"scenario": scenario})
    with pytest.raises(InputError, match=r"scenario\.name is 'doorway', not 'room'; give --force"):
        Store.open(tmp_path, {"scenario": {"name": "room", "obstacles": []}}, resume=True)
    with pytest.raises(InputError, match=r"scenario\.obstacles is \[.*\.\.\.\], not \[\]; ") as caught:
        Store.open(tmp_path, {"scenario": {**scenario, "obstacles": []}}, resume=True)
    assert len(str(caught.value)) < 500


def test_results_of_other_code_are_not_resumed(store, monkeypatch):
    other = {**store_module.identity(), "source": "0" * 24}
    monkeypatch.setattr(store_module, "identity", lambda: other)
    with pytest.raises(
        InputError, match=f"of the same code .*source is [0-9a-f]{{24}}, not {'0' * 24}; give --force"
    ):
        Store.open(store.folder, {"trials": 4}, resume=True)


@pytest.mark.parametrize("content", ["", "{", "[]", '{"format": "other"}'])
def test_a_description_that_is_none_is_not_resumed(store, content):
    (store.folder / "run.json").write_text(content)
    with pytest.raises(InputError, match=r"run\.json.* must be .*--force"):
        Store.open(store.folder, {"trials": 4}, resume=True)


def test_beginning_anew_removes_what_the_store_wrote_and_nothing_else(store):
    run_tasks([TASK], store)
    notes = store.folder / "results" / "notes.txt"
    notes.write_text("mine")
    (store.folder / "results" / f".{TASK.key}.json.k3v9_2ab").write_text("half")
    (store.folder / "figure.png").write_text("mine")
    anew = Store.open(store.folder, {"trials": 5}, force=True)
    assert sorted(path.name for path in store.folder.rglob("*")) == [
        "figure.png",
        "notes.txt",
        "results",
        "run.json",
    ]
    with pytest.raises(KeyError):
        anew.read(TASK)


def test_both_at_once_is_refused(store):
    with pytest.raises(InputError, match="not both"):
        Store.open(store.folder, {"trials": 4}, resume=True, force=True)


def test_what_a_killed_run_left_half_written_does_no_harm(tmp_path, make_walks, files_of):
    (tmp_path / ".run.json.k3v9_2ab").write_text("{")
    store = Store.open(tmp_path, {})
    (first, second) = make_walks(2)
    run_tasks([first], store)
    (tmp_path / "results" / f".{second.key}.json.abcdefgh").write_text("{")
    assert repr(run_tasks([first, second], Store.open(tmp_path, {}, resume=True))) == repr(
        [first.run(), second.run()]
    )


def full_disk(*_args, **_options):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    "where", ["drake_shared.common.files.tempfile.TemporaryFile", "pathlib.Path.write_text"]
)
def test_a_full_disk_is_said_and_what_is_complete_is_kept(store, make_walks, files_of, monkeypatch, where):
    done, to_do = make_walks(2)
    run_tasks([done], store)
    before = files_of(store.folder)
    with monkeypatch.context() as patch:
        patch.setattr(where, full_disk)
        with pytest.raises(
            RunError, match=r"\(No space left on device\); what is complete is kept.*--resume"
        ) as caught:
            run_tasks([done, to_do], store)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(store.folder))
    assert files_of(store.folder) == before
    assert len(run_tasks([done, to_do], Store.open(store.folder, {"trials": 4}, resume=True))) == 2


def test_a_folder_that_is_removed_is_said_and_not_made_anew(store, make_walks):
    for path in [*store.folder.iterdir()]:
        path.unlink()
    store.folder.rmdir()
    with pytest.raises(RunError, match=r"run\.json was removed"):
        run_tasks(make_walks(1), store)
    assert not store.folder.exists()


def test_a_folder_that_cannot_be_made_is_bad_input():
    with pytest.raises(InputError, match="/proc/run must be a folder to write to"):
        Store.open("/proc/run", {})
    with pytest.raises(InputError, match="must be a folder to write to"):
        Store.open(Path(__file__), {})
