"""Rows of a trial under way survive whatever ends the process, up to the last that were written."""

import os
import shutil
import threading
import time

import numpy as np
import pytest

from drake_shared.simulation import journal as journals
from drake_shared.simulation.journal import Journal, recover_trials
from drake_shared.simulation.log import read_log

ROWS = 60


def rows(trial, first: int, last: int):
    return {name: values[first:last] for name, values in trial.columns.items()}


@pytest.fixture
def metadata(human_trial):
    return {name: value for name, value in human_trial.metadata.items() if name != "status"}


@pytest.fixture
def killed(tmp_path, human_trial, metadata):
    """The journal of a process that was killed when it had written 60 rows in blocks of 10."""
    journal = Journal(tmp_path, "trial", metadata)
    for first in range(0, ROWS, 10):
        journal.append(rows(human_trial, first, first + 10))
    journal.close()
    (path,) = tmp_path.iterdir()
    return path


def test_a_trial_that_ends_leaves_its_log_alone(tmp_path, human_trial, metadata):
    journal = Journal(tmp_path / "logs", "trial", metadata)
    journal.append(rows(human_trial, 0, 10))
    assert journal.finish(human_trial) == tmp_path / "logs" / "trial.parquet"
    assert [path.name for path in (tmp_path / "logs").iterdir()] == ["trial.parquet"]
    assert read_log(tmp_path / "logs" / "trial.parquet").metadata == human_trial.metadata


def test_what_a_killed_process_wrote_becomes_an_interrupted_trial(tmp_path, killed, human_trial, metadata):
    assert recover_trials(tmp_path) == [tmp_path / "trial.parquet"]
    assert not killed.exists()
    trial = read_log(tmp_path / "trial.parquet")
    assert (trial.status, trial.metadata["recovered"]) == ("interrupted", True)
    assert {name: trial.metadata[name] for name in metadata} == metadata
    for name, values in human_trial.columns.items():
        np.testing.assert_array_equal(trial[name], values[:ROWS])
        assert trial[name].dtype == values.dtype
    assert recover_trials(tmp_path) == []


@pytest.mark.parametrize("tail", [b"", b"\0" * 4096, b"\xff" * 100])
def test_wherever_the_file_is_cut_off_the_blocks_before_are_recovered(tmp_path, killed, human_trial, tail):
    whole = killed.read_bytes()
    found = set()
    for length in range(0, len(whole), len(whole) // 40):
        folder = tmp_path / str(length)
        folder.mkdir()
        (folder / killed.name).write_bytes(whole[:length] + tail)
        logs = recover_trials(folder)
        count = len(read_log(logs[0])["t"]) if logs else 0
        assert count % 10 == 0
        assert [path.suffix for path in folder.iterdir()] == [".parquet"] * bool(logs)
        found.add(count)
        shutil.rmtree(folder)
    # The longest cut-off part lacks one block at most.
    assert {0, ROWS - 10} <= found


def test_rows_survive_the_process_while_the_disk_is_slow(tmp_path, human_trial, metadata, monkeypatch):
    disk, asked, fsync = threading.Event(), threading.Event(), os.fsync

    def slow_fsync(descriptor: int):
        if threading.current_thread().name == "journal":
            asked.set()
            disk.wait()
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", slow_fsync)
    journal = Journal(tmp_path / "logs", "trial", metadata)
    (path,) = (tmp_path / "logs").iterdir()
    journal.append(rows(human_trial, 0, 10))
    assert asked.wait(30)
    journal.append(rows(human_trial, 10, 20))
    found, deadline = 0, time.monotonic() + 30
    while found < 20:
        assert time.monotonic() < deadline
        shutil.copy(path, tmp_path)
        (log,) = recover_trials(tmp_path)
        found = len(read_log(log)["t"])
        log.unlink()
    disk.set()
    journal.discard()


def test_a_trial_under_way_is_left_to_its_process(tmp_path, human_trial, metadata):
    journal = Journal(tmp_path, "trial", metadata)
    journal.append(rows(human_trial, 0, 10))
    assert recover_trials(tmp_path) == []
    assert journal.finish(human_trial).exists()


def test_names_are_unique_among_logs_and_trials_under_way(tmp_path, human_trial, metadata):
    first, second = (Journal(tmp_path, "trial", metadata) for _ in range(2))
    paths = [first.finish(human_trial), second.finish(human_trial)]
    third = Journal(tmp_path, "trial", metadata)
    paths.append(third.finish(human_trial))
    assert len(set(paths)) == 3
    assert sorted(tmp_path.iterdir()) == sorted(paths)


def test_a_log_that_was_written_before_the_kill_is_kept(tmp_path, killed, human_trial):
    journals.write_log(human_trial, tmp_path / "trial.parquet")
    assert recover_trials(tmp_path) == []
    assert read_log(tmp_path / "trial.parquet").status == human_trial.status
    assert not killed.exists()


def test_a_trial_that_is_kept_elsewhere_leaves_nothing(tmp_path, human_trial, metadata):
    journal = Journal(tmp_path, "trial", metadata)
    journal.append(rows(human_trial, 0, 10))
    journal.discard()
    assert list(tmp_path.iterdir()) == []
