"""Data of a study: every step is there once, whoever is killed, and of this study only."""

import datetime
import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from drake_shared.cli.main import main
from drake_shared.common.errors import InputError, RunError
from drake_shared.study.block import TimedSource
from drake_shared.study.dry_run import simulate
from drake_shared.study.protocol import plan
from drake_shared.study.store import StudyData
from drake_shared.study.tidy import trial_rows
from drake_shared.systems.mouse_input import MouseSample

PATIENCE = 60.0


def files_of(folder: Path) -> dict[str, bytes]:
    """The content of all data, without the times at which it was written."""
    found = {}
    for path in sorted((folder / "data").glob("*/[!.]*.*")):
        if path.suffix == ".json":
            content = json.loads(path.read_text())
            content.pop("time")
            found[f"{path.parent.name}/{path.name}"] = json.dumps(content).encode()
        else:
            found[f"{path.parent.name}/{path.name}"] = path.read_bytes()
    return found


def full_disk(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.fixture
def whole(small) -> Path:
    plan(small)
    assert list(simulate(StudyData(small), 4)) == ["P01", "P02", "P03", "P04"]
    return small


def test_every_step_is_there_once_and_simulating_again_changes_nothing(whole):
    data = StudyData(whole)
    before = files_of(whole)
    assert len(before) == sum(map(len, data.steps.values()))
    assert all(data.next_step(name) is None for name in data.steps)
    list(simulate(data, 4))
    assert files_of(whole) == before


def test_a_trial_that_a_full_disk_keeps_from_being_written_is_the_next_step_again(whole, monkeypatch):
    data = StudyData(whole)
    step, trial = next(data.trials())
    path = whole / "data" / step.participant / f"{step.name}.parquet"
    path.unlink()
    with monkeypatch.context() as patched:
        patched.setattr(os, "link", full_disk)
        with pytest.raises(RunError):
            data.write_trial(step, trial)
    assert not path.exists()
    assert data.next_step(step.participant) == step
    data.write_trial(step, trial)
    assert path.is_file()


def test_a_killed_run_continues_as_if_it_had_not_been(whole, tmp_path_factory):
    other = tmp_path_factory.mktemp("killed")
    for name in ("study.yaml", "protocol.json"):
        shutil.copy(whole / name, other)
    command = [sys.executable, "-m", "drake_shared.cli.main", "study", "run", str(other), "--simulate", "4"]
    running = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + PATIENCE
    while len(list(other.glob("data/P02/[!.]*.*"))) < 2 and running.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.002)
    running.send_signal(signal.SIGKILL)
    running.wait()
    list(simulate(StudyData(other), 4))
    assert files_of(other) == files_of(whole)


def test_a_step_is_written_once_and_resumed_at_the_right_place(small):
    plan(small)
    data = StudyData(small)
    consent, introduction = data.steps["P01"][:2]
    assert data.next_step("P01") == consent
    data.write_answers(consent, {"agreed": True})
    assert StudyData(small).next_step("P01") == introduction
    with pytest.raises(InputError):
        data.write_answers(consent, {"agreed": False})
    stored = json.loads((small / "data" / "P01" / "000_consent.json").read_text())
    assert stored["answers"] == {"agreed": True}


def test_a_clock_that_is_set_back_changes_no_order(small, monkeypatch):
    plan(small)
    data = StudyData(small)
    for number, year in enumerate((2030, 2020, 2010)):
        now = datetime.datetime(year, 1, 1, tzinfo=datetime.UTC)
        clock = type("Clock", (datetime.datetime,), {"now": classmethod(lambda *_, now=now: now)})
        monkeypatch.setattr(datetime, "datetime", clock)
        data.write_answers(data.steps["P01"][number], {})
        data.note("P01", f"note {number}")
    monkeypatch.undo()
    assert StudyData(small).next_step("P01") == data.steps["P01"][3]
    assert data.notes("P01") == ["note 0", "note 1", "note 2"]


def test_latency_is_measured_by_the_clock_of_the_samples():
    times = iter([10.0, 10.5])
    source = TimedSource(
        SimpleNamespace(latest=lambda: MouseSample(engaged=True, arrival=9.98)), lambda: next(times)
    )
    source.latest()
    source.latest()  # The same sample again is no new event.
    assert source.ages == [pytest.approx(0.02)]


def test_a_full_disk_leaves_no_part_of_a_step(small, monkeypatch):
    plan(small)
    data = StudyData(small)

    with monkeypatch.context() as patched:
        patched.setattr(os, "link", full_disk)
        with pytest.raises(RunError):
            data.write_answers(data.steps["P01"][0], {})
    assert list((small / "data" / "P01").iterdir()) == []
    data.write_answers(data.steps["P01"][0], {})


def test_who_drops_out_or_is_excluded_has_no_next_step_and_a_reason(small):
    plan(small)
    data = StudyData(small)
    list(simulate(data, 4, dropout=1.0))
    ends = {name: data.ended(name) for name in data.steps}
    assert all(end is not None and end["kind"] == "withdrawn" for end in ends.values())
    assert all(data.next_step(name) is None for name in data.steps)
    assert all(0 < len(data.completed(name)) < len(steps) for name, steps in data.steps.items())
    data.note("P01", "spilled coffee")
    data.end("P01", "excluded", "did not understand the task")
    assert data.notes("P01") == ["spilled coffee"]
    rows = [row for row in trial_rows(data) if row["participant"] == "P01"]
    assert {row["excluded"] for row in rows} <= {"participant: did not understand the task"}


def test_data_of_another_study_or_a_renamed_file_are_refused(whole, tmp_path_factory):
    log = next(iter(sorted((whole / "data" / "P01").glob("*_trial_*.parquet"))))
    twin = log.with_name(next(path.name for path in sorted(log.parent.glob("*.parquet")) if path != log))
    twin.unlink()
    shutil.copy(log, twin)
    with pytest.raises(InputError) as caught:
        list(StudyData(whole).trials())
    assert caught.value.field == "step"
    twin.unlink()
    shutil.copy(log, log.with_name("foreign.parquet"))
    with pytest.raises(InputError):
        list(StudyData(whole).trials())
    log.with_name("foreign.parquet").unlink()
    other = tmp_path_factory.mktemp("other")
    (other / "study.yaml").write_text(
        (whole / "study.yaml").read_text().replace("name: small", "name: other")
    )
    plan(other)
    shutil.copytree(whole / "data", other / "data", dirs_exist_ok=True)
    with pytest.raises(InputError) as caught:
        list(StudyData(other).trials())
    assert caught.value.field == "study"


def test_people_and_simulated_participants_are_not_mixed(small):
    plan(small)
    data = StudyData(small)
    data.write_answers(data.steps["P01"][0], {"agreed": True})
    with pytest.raises(InputError):
        list(simulate(data, 4))


@pytest.mark.parametrize("options", [["--simulate", "5"], ["--simulate", "2", "--dropout", "2"]])
def test_options_of_a_dry_run_are_checked(small, options, capsys):
    plan(small)
    assert main(["study", "run", str(small), *options]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
