"""A batch keeps complete logs whatever interrupts it, and can be resumed."""

import contextlib
import dataclasses
import errno
import io
import json
import multiprocessing
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from drake_shared.analysis.batch import Batch, run_batch
from drake_shared.cli.main import main
from drake_shared.common.errors import InputError, RunError
from drake_shared.operators.behaviour import Behaviour
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.faults import Faults
from drake_shared.simulation.trial import read_log

TASK = Path(__file__).parents[2] / "models" / "scenarios" / "two_obstacles.yaml"
TRIALS = 30
KILLS = 4
FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(["drake_shared.analysis.batch"])
# Trials of 0.1 s without pauses: it is writing logs much of the time.
DRIVE = """
import dataclasses, sys
from drake_shared.cockpit import drive, session
from drake_shared.scenario import (load_scenario)
session._PAUSE = 0.0
scenario = dataclasses.replace(load_scenario(sys.argv[1]), duration=0.1)
drive(scenario, operator="surrogate", record=sys.argv[2], port=0, open_browser=False)
"""
LIMITED = """
import resource, sys
from drake_shared.cli.main import main
resource.setrlimit(resource.RLIMIT_FSIZE, (5_000, 5_000))
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture(scope="module")
def short(tmp_path_factory) -> str:
    """A scenario whose trials last 1.5 s."""
    path = tmp_path_factory.mktemp("short") / "short.yaml"
    path.write_text(re.sub(r"(?m)^duration: .*$", "duration: 1.5", TASK.read_text()))
    return str(path)


HUMAN = SharedControlConfig(driver="human")


@pytest.fixture
def batch(short, tmp_path):
    """Makes a batch of three short trials with logs in ``tmp_path / "logs"``."""

    def make(**changes) -> Batch:
        given = {"scenario": short, "config": HUMAN, "count": 3, "out": str(tmp_path / "logs")}
        return Batch(**given | changes)

    return make


def contents(folder: Path) -> dict[str, str]:
    """All values of the logs in a folder, by name; each must be complete."""
    found = {}
    for path in sorted(folder.glob("trial_?????.parquet")):
        trial = read_log(path)
        columns = {name: column.tobytes().hex() for name, column in trial.columns.items()}
        found[path.name] = json.dumps([columns, trial.metadata])
    return found


def plain(rows) -> str:
    """Rows as text, in which NaN equals itself, without the folder of their logs."""
    return repr([row | {"log": Path(row["log"]).name} for row in rows])


def command(short: str, out: Path) -> list[str]:
    options = ["--scenario", short, "--driver", "human", "--trials", str(TRIALS), "--json", "--out", str(out)]
    # Drake writes one log after another; lock-step writes a block of them, which may be all.
    return ["simulate", *options, "--engine", "drake"]


def simulate(short: str, out: Path, *options: str, start_new_session: bool = False) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "drake_shared.cli.main", *command(short, out), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=start_new_session,
    )


def kill_and_resume(short: str, folder: Path, kills: int) -> tuple[int, int]:
    """Runs ``simulate --out --resume`` again and again, killed by SIGKILL at random moments.

    A folder with nearly all logs is emptied. Logs must be the same after a kill as before it, and complete.

    Returns:
        How many trials were completed, and how many temporary files were left.
    """
    moments = random.Random(7)
    completed, temporary, before = 0, 0, {}
    for _ in range(kills):
        if len(before) > TRIALS - 10:
            shutil.rmtree(folder)
            before = {}
        # From a fork server that has the modules loaded: otherwise most of a short run is its start.
        process = FORKS.Process(target=main, args=([*command(short, folder), "--resume"],))
        process.start()
        while len(list(folder.glob("trial_*"))) == len(before) and process.is_alive():
            time.sleep(0.001)
        time.sleep(moments.uniform(0.0, 0.04))
        process.kill()
        process.join()
        assert process.exitcode == -signal.SIGKILL
        after = contents(folder)
        assert before.items() <= after.items()
        completed += len(after) - len(before)
        temporary += len(os.listdir(folder)) - len(after)
        before = after
    return completed, temporary


@pytest.fixture(scope="module")
def uninterrupted(short, tmp_path_factory) -> tuple[str, dict[str, str]]:
    """The output and the logs of a run that is not interrupted."""
    folder = tmp_path_factory.mktemp("uninterrupted")
    output, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        assert main(command(short, folder)) == 0
    assert str(folder) in errors.getvalue()
    return output.getvalue().replace(str(folder), "FOLDER"), contents(folder)


def resumed(short: str, folder: Path, capsys) -> tuple[str, dict[str, str]]:
    """The output and the logs of a run that is resumed and completed in this process."""
    assert main([*command(short, folder), "--resume"]) == 0
    captured = capsys.readouterr()
    assert str(folder) in captured.err
    return captured.out.replace(str(folder), "FOLDER"), contents(folder)


def test_a_killed_run_leaves_complete_logs_and_resuming_gives_the_same_bits(
    short, uninterrupted, tmp_path, capsys
):
    kill_and_resume(short, tmp_path, KILLS)
    assert 0 < len(contents(tmp_path)) < TRIALS
    assert resumed(short, tmp_path, capsys) == uninterrupted
    assert not [name for name in os.listdir(tmp_path) if name.startswith(".")]


def test_workers_exit_with_a_killed_run_which_can_be_resumed(short, uninterrupted, tmp_path, capsys):
    process = simulate(short, tmp_path, "--workers", "2")
    while not contents(tmp_path):
        time.sleep(0.01)
    process.kill()
    # Every process holds these streams: they are closed when the last one exits.
    process.communicate(timeout=10)
    assert 0 < len(contents(tmp_path)) < TRIALS
    assert resumed(short, tmp_path, capsys) == uninterrupted


def members(session: int) -> list[int]:
    """The running processes of a session."""
    found = subprocess.run(
        ["ps", "-o", "pid=,stat=", "-s", str(session)], capture_output=True, text=True
    ).stdout.splitlines()
    return [int(line.split()[0]) for line in found if "Z" not in line]


@pytest.mark.parametrize(
    ("workers", "number", "status"),
    [("1", signal.SIGTERM, 143), ("2", signal.SIGTERM, 143), ("2", signal.SIGINT, 130)],
)
def test_a_signal_ends_the_run_and_leaves_complete_logs_and_no_process(
    short, tmp_path, workers, number, status
):
    process = simulate(short, tmp_path, "--trials", "2000", "--workers", workers, start_new_session=True)
    while (before := len(list(tmp_path.glob("trial_*")))) < 2:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.01)
    # A terminal sends SIGINT to all processes, a supervisor sends SIGTERM to the first.
    (os.killpg if number == signal.SIGINT else os.kill)(process.pid, number)
    assert process.communicate(timeout=20) == ("", "")
    assert process.returncode == status
    # Queued trials are not run.
    assert before <= len(contents(tmp_path)) < before + 24
    assert members(process.pid) == []


def test_a_killed_worker_ends_the_run_with_status_1_and_leaves_complete_logs(short, tmp_path):
    process = simulate(
        short, tmp_path, "--trials", "2000", "--workers", "2", "--engine", "drake", start_new_session=True
    )
    while len(contents(tmp_path)) < 2:
        time.sleep(0.01)
    os.kill(max(members(process.pid)), signal.SIGKILL)
    output, errors = process.communicate(timeout=20)
    assert (process.returncode, output) == (1, "")
    assert re.fullmatch(r"drake-shared: .*worker.*\n", errors)
    assert len(contents(tmp_path)) >= 2


def test_existing_logs_are_neither_overwritten_nor_mixed_with_others(batch, tmp_path):
    rows = list(run_batch(batch()))
    kept = contents(tmp_path / "logs")
    with pytest.raises(InputError, match=r"--resume .* --force") as caught:
        run_batch(batch())
    assert "\n" not in str(caught.value)
    assert plain(run_batch(batch(), resume=True)) == plain(rows)
    more = list(run_batch(batch(count=4), resume=True))
    assert (plain(more[:3]), more[3]["seed"]) == (plain(rows), 3)
    assert kept.items() < contents(tmp_path / "logs").items()
    with pytest.raises(InputError, match=r"trial_00003\.parquet"):
        run_batch(batch(), resume=True)


@pytest.mark.parametrize(
    ("changes", "difference"),
    [
        ({"seed": 1}, "seed is 0, not 1"),
        ({"config": dataclasses.replace(HUMAN, end="duration")}, "end is 'reached', not 'duration'"),
        ({"config": dataclasses.replace(HUMAN, safety_clearance=0.05)}, "safety_clearance is None, not 0.05"),
        ({"behaviour": Behaviour(delay=0.1)}, "behaviour.delay is 0.2, not 0.1"),
        ({"config": dataclasses.replace(HUMAN, faults=Faults(loss=0.1))}, "faults.loss is 0.0, not 0.1"),
        ({"scenario": "two_obstacles"}, "scenario.duration is 1.5, not 15.0"),
        ({"config": SharedControlConfig(arbitration="halves")}, "'human', not 'shared'|arbitration"),
    ],
)
def test_a_batch_of_another_configuration_is_not_resumed(batch, tmp_path, changes, difference):
    list(run_batch(batch(count=1)))
    kept = contents(tmp_path / "logs")
    with pytest.raises(InputError, match=difference) as caught:
        run_batch(batch(**changes), resume=True)
    assert "\n" not in str(caught.value)
    assert contents(tmp_path / "logs") == kept


def test_a_recording_is_part_of_the_configuration(batch, tmp_path):
    first, second = (row["log"] for row in run_batch(batch(count=2)))
    played = batch(recording=first, count=1, out=str(tmp_path / "played"))
    rows = list(run_batch(played))
    assert plain(run_batch(played, resume=True)) == plain(rows)
    with pytest.raises(InputError, match="recording"):
        run_batch(dataclasses.replace(played, recording=second), resume=True)
    with pytest.raises(InputError, match=r"trial_00000\.parquet"):
        run_batch(batch(recording=first), force=True)
    assert Path(first).is_file()


def test_force_removes_only_logs_of_batches(batch, tmp_path):
    list(run_batch(batch()))
    others = {"notes.txt", "two_obstacles_20260101-120000_001.parquet", "trial_1.parquet", ".hidden"}
    for name in [*others, ".trial_00002.parquet.k3v9x2ab"]:
        (tmp_path / "logs" / name).write_text("")
    with pytest.raises(InputError, match="coin"):
        run_batch(batch(config=SharedControlConfig(arbitration="coin")), force=True)
    assert len(contents(tmp_path / "logs")) == 3
    list(run_batch(batch(seed=5, count=1), force=True))
    assert set(os.listdir(tmp_path / "logs")) == others | {"trial_00000.parquet"}


def test_the_trial_of_an_incomplete_log_is_repeated_and_other_files_are_refused(batch, tmp_path):
    rows = list(run_batch(batch()))
    whole = Path(rows[1]["log"]).read_bytes()
    for torn in (b"", whole[:100], whole[:-100]):
        Path(rows[1]["log"]).write_bytes(torn)
        assert plain(run_batch(batch(), resume=True)) == plain(rows)
        assert Path(rows[1]["log"]).read_bytes() == whole
    pq.write_table(pa.table({"x": [1]}), rows[1]["log"])
    with pytest.raises(InputError, match="format"):
        run_batch(batch(), resume=True)


def test_contradicting_options_are_bad_input(batch):
    with pytest.raises(InputError, match="--resume or --force"):
        run_batch(batch(), resume=True, force=True)
    with pytest.raises(InputError, match="resume"):
        run_batch(batch(out=None), resume=True)


def test_a_full_disk_ends_the_batch_and_keeps_earlier_logs(batch, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    rows = run_batch(batch(engine="drake"))
    before = [next(rows), next(rows)]
    with monkeypatch.context() as patched:
        patched.setattr("pyarrow.parquet.write_table", full)
        with pytest.raises(RunError, match=r"trial_00002\.parquet: .*No space left on device") as caught:
            next(rows)
    assert "\n" not in str(caught.value)
    assert sorted(os.listdir(tmp_path / "logs")) == [Path(row["log"]).name for row in before]
    rows = list(run_batch(batch(engine="drake"), resume=True))
    assert plain(rows[:2]) == plain(before)
    assert plain(rows) == plain(run_batch(batch(engine="drake", out=str(tmp_path / "other"))))


def test_a_full_disk_ends_the_program_with_status_1_and_one_line(short, tmp_path):
    ran = subprocess.run(
        [
            sys.executable,
            "-B",  # The limit would also cut the bytecode of modules that were not compiled yet.
            "-c",
            LIMITED,
            *command(short, tmp_path / "logs"),
            "--workers",
            "2",
        ],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (ran.returncode, ran.stdout) == (1, "")
    assert re.fullmatch(r"drake-shared: .*trial_0000[01]\.parquet: .*File too large.*\n", ran.stderr)
    assert os.listdir(tmp_path / "logs") == []


def test_a_removed_folder_is_not_created_again(batch, tmp_path):
    rows = run_batch(batch(engine="drake"))
    next(rows)
    shutil.rmtree(tmp_path / "logs")
    with pytest.raises(RunError, match=r"trial_00001\.parquet"):
        next(rows)
    assert not (tmp_path / "logs").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root can write everywhere")
def test_a_lost_permission_ends_the_batch(batch, tmp_path):
    rows = run_batch(batch(engine="drake"))
    next(rows)
    (tmp_path / "logs").chmod(0o500)
    try:
        with pytest.raises(RunError, match="Permission denied"):
            next(rows)
    finally:
        (tmp_path / "logs").chmod(0o700)
    assert list(contents(tmp_path / "logs")) == ["trial_00000.parquet"]


def test_logs_of_drive_are_complete_whenever_it_is_killed(short, tmp_path):
    moments = random.Random(3)
    kept: dict[str, bytes] = {}
    for _ in range(2):
        process = subprocess.Popen(
            [sys.executable, "-c", DRIVE, short, str(tmp_path)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        while "saved as" not in process.stderr.readline():
            assert process.poll() is None
        time.sleep(moments.uniform(0.0, 0.2))
        process.kill()
        process.communicate()
        after = {path.name: path.read_bytes() for path in tmp_path.glob("[!.]*.parquet")}
        assert kept.items() < after.items()
        assert all(read_log(tmp_path / name).metadata["operator"] == "SurrogateOperator" for name in after)
        kept = after
