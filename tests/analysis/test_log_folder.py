"""What a batch keeps: whatever kills it or fails it, trials that ended are whole and the rest can follow."""

import dataclasses
import errno
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
KILLS = 8
FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(["drake_shared.analysis.batch"])
# Without the pauses between trials, and with ten of them in a second, it writes much of the time.
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
    """A task that is over after a second and a half."""
    path = tmp_path_factory.mktemp("short") / "short.yaml"
    path.write_text(re.sub(r"(?m)^duration: .*$", "duration: 1.5", TASK.read_text()))
    return str(path)


ALONE = SharedControlConfig(driver="human")


@pytest.fixture
def batch(short, tmp_path):
    """Makes a batch of three short trials that are kept in ``tmp_path / "logs"``."""

    def make(**changes) -> Batch:
        given = {"scenario": short, "config": ALONE, "count": 3, "out": str(tmp_path / "logs")}
        return Batch(**given | changes)

    return make


def contents(folder: Path) -> dict[str, str]:
    """Every bit of the logs in a folder, by name; each must be whole."""
    found = {}
    for path in sorted(folder.glob("trial_?????.parquet")):
        trial = read_log(path)
        columns = {name: column.tobytes().hex() for name, column in trial.columns.items()}
        found[path.name] = json.dumps([columns, trial.metadata])
    return found


def plain(rows) -> str:
    """Rows as text, where NaN equals itself; without the folder of their logs."""
    return repr([row | {"log": Path(row["log"]).name} for row in rows])


def command(short: str, out: Path) -> list[str]:
    options = ("--scenario", short, "--driver", "human", "--trials", str(TRIALS), "--json", "--out", str(out))
    return ["simulate", *options]


def simulate(short: str, out: Path, *options: str, start_new_session: bool = False) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "drake_shared.cli.main", *command(short, out), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=start_new_session,
    )


def survive(short: str, folder: Path, kills: int) -> tuple[int, int]:
    """Kills ``simulate --out`` by SIGKILL at random moments, each time going on where it was.

    A folder that is nearly full is begun anew. Trials that were there before a kill must be there after it,
    unchanged, and every log must be whole.

    Returns:
        How many trials ended, and how many files were left half written under another name.
    """
    moments = random.Random(7)
    ended, torn, before = 0, 0, {}
    for _ in range(kills):
        if len(before) > TRIALS - 10:
            shutil.rmtree(folder)
            before = {}
        # From a fork server that has everything loaded: most of a short run would be its start.
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
        ended += len(after) - len(before)
        torn += len(os.listdir(folder)) - len(after)
        before = after
    return ended, torn


@pytest.fixture(scope="module")
def undisturbed(short, tmp_path_factory) -> tuple[str, dict[str, str]]:
    """What an undisturbed run says and keeps."""
    folder = tmp_path_factory.mktemp("undisturbed")
    said, errors = simulate(short, folder).communicate()
    assert errors == f"wrote {TRIALS} logs to {folder}\n"
    return said.replace(str(folder), "FOLDER"), contents(folder)


def test_a_killed_run_leaves_whole_logs_and_resuming_gives_the_same_bits(short, undisturbed, tmp_path):
    survive(short, tmp_path, KILLS)
    assert 0 < len(contents(tmp_path)) < TRIALS
    process = simulate(short, tmp_path, "--resume")
    said, errors = process.communicate()
    assert process.returncode == 0, errors
    assert (said.replace(str(tmp_path), "FOLDER"), contents(tmp_path)) == undisturbed
    assert not [name for name in os.listdir(tmp_path) if name.startswith(".")]


def test_workers_end_with_a_run_that_is_killed_and_the_rest_can_follow(short, undisturbed, tmp_path):
    process = simulate(short, tmp_path, "--workers", "2")
    while not contents(tmp_path):
        time.sleep(0.01)
    process.kill()
    # All of them hold these streams: they end when the last process does.
    process.communicate(timeout=10)
    assert 0 < len(contents(tmp_path)) < TRIALS
    said, errors = simulate(short, tmp_path, "--workers", "2", "--resume").communicate()
    assert errors == f"{TRIALS} logs are in {tmp_path}\n"
    assert (said.replace(str(tmp_path), "FOLDER"), contents(tmp_path)) == undisturbed


def members(session: int) -> list[int]:
    """The processes of a session that are alive."""
    found = subprocess.run(
        ["ps", "-o", "pid=,stat=", "-s", str(session)], capture_output=True, text=True
    ).stdout.splitlines()
    return [int(line.split()[0]) for line in found if "Z" not in line]


@pytest.mark.parametrize("workers", ["1", "2"])
@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_signal_ends_it_at_once_and_leaves_whole_logs_and_no_process(
    short, tmp_path, workers, number, status
):
    process = simulate(short, tmp_path, "--trials", "2000", "--workers", workers, start_new_session=True)
    while len(contents(tmp_path)) < 2:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.01)
    # A terminal sends Ctrl-C to all of them, a supervisor its signal to the first.
    (os.killpg if number == signal.SIGINT else os.kill)(process.pid, number)
    assert process.communicate(timeout=20) == ("", "")
    assert process.returncode == status
    # Not even what a worker was given, 16 trials at a time, is run to its end.
    assert 2 <= len(contents(tmp_path)) < 24
    assert members(process.pid) == []


def test_a_worker_that_is_killed_ends_the_program_in_one_line_and_the_logs_are_whole(short, tmp_path):
    process = simulate(short, tmp_path, "--trials", "2000", "--workers", "2", start_new_session=True)
    while len(contents(tmp_path)) < 2:
        time.sleep(0.01)
    os.kill(max(members(process.pid)), signal.SIGKILL)
    said, errors = process.communicate(timeout=20)
    assert (process.returncode, said) == (1, "")
    assert re.fullmatch(r"drake-shared: a worker was lost \(.*\); earlier logs are kept\n", errors)
    assert len(contents(tmp_path)) >= 2


def test_logs_that_are_there_are_neither_overwritten_nor_mixed_with_others(batch, tmp_path):
    rows = list(run_batch(batch()))
    kept = contents(tmp_path / "logs")
    with pytest.raises(InputError, match=r"logs must hold no logs .* --resume .* --force") as caught:
        run_batch(batch())
    assert "\n" not in str(caught.value)
    assert plain(run_batch(batch(), resume=True)) == plain(rows)
    more = list(run_batch(batch(count=4), resume=True))
    assert (plain(more[:3]), more[3]["seed"]) == (plain(rows), 3)
    assert kept.items() < contents(tmp_path / "logs").items()
    with pytest.raises(InputError, match=r"trial_00003\.parquet must be one of 3 trials to be resumed"):
        run_batch(batch(), resume=True)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"seed": 1}, "seed is 0, not 1"),
        ({"config": dataclasses.replace(ALONE, end="duration")}, "config.end is 'reached', not 'duration'"),
        ({"config": dataclasses.replace(ALONE, safety_clearance=0.05)}, "safety_clearance is None, not 0.05"),
        ({"behaviour": Behaviour(delay=0.1)}, "behaviour.delay is 0.2, not 0.1"),
        (
            {"config": dataclasses.replace(ALONE, faults=Faults(loss=0.1))},
            "config.faults.loss is 0.0, not 0.1",
        ),
        ({"scenario": "two_obstacles"}, "scenario.duration is 1.5, not 15.0"),
        (
            {"config": SharedControlConfig(arbitration="halves")},
            "config.*'human', not 'shared'|config.arbitration",
        ),
    ],
)
def test_experiments_refuse_to_mix_configurations(batch, tmp_path, changes, said):
    list(run_batch(batch(count=1)))
    kept = contents(tmp_path / "logs")
    with pytest.raises(InputError, match=f"same configuration.*{said}; experiments refuse to mix") as caught:
        run_batch(batch(**changes), resume=True)
    assert "\n" not in str(caught.value)
    assert contents(tmp_path / "logs") == kept


def test_a_recording_is_a_part_of_the_configuration(batch, tmp_path):
    first, second = (row["log"] for row in run_batch(batch(count=2)))
    played = batch(recording=first, count=1, out=str(tmp_path / "played"))
    rows = list(run_batch(played))
    assert plain(run_batch(played, resume=True)) == plain(rows)
    with pytest.raises(InputError, match="refuse to mix"):
        run_batch(dataclasses.replace(played, recording=second), resume=True)
    with pytest.raises(InputError, match=r"trial_00000\.parquet must not be in .*logs, which is begun anew"):
        run_batch(batch(recording=first), force=True)
    assert Path(first).is_file()


def test_begun_anew_only_what_is_ours_is_removed(batch, tmp_path):
    list(run_batch(batch()))
    others = {"notes.txt", "two_obstacles_20260101-120000_001.parquet", "trial_1.parquet", ".hidden"}
    for name in [*others, ".trial_00002.parquet.k3v9x2ab"]:
        (tmp_path / "logs" / name).write_text("")
    with pytest.raises(InputError, match="coin"):
        run_batch(batch(config=SharedControlConfig(arbitration="coin")), force=True)
    assert len(contents(tmp_path / "logs")) == 3
    list(run_batch(batch(seed=5, count=1), force=True))
    assert set(os.listdir(tmp_path / "logs")) == others | {"trial_00000.parquet"}


def test_a_torn_log_is_run_again_and_what_is_no_log_is_refused(batch, tmp_path):
    rows = list(run_batch(batch()))
    whole = Path(rows[1]["log"]).read_bytes()
    for torn in (b"", whole[:100], whole[:-100]):
        Path(rows[1]["log"]).write_bytes(torn)
        assert plain(run_batch(batch(), resume=True)) == plain(rows)
        assert Path(rows[1]["log"]).read_bytes() == whole
    pq.write_table(pa.table({"x": [1]}), rows[1]["log"])
    with pytest.raises(InputError, match="format must be"):
        run_batch(batch(), resume=True)


def test_what_makes_no_sense_together_is_refused(batch):
    with pytest.raises(InputError, match="not both"):
        run_batch(batch(), resume=True, force=True)
    with pytest.raises(InputError, match="resume must be left out where no logs are kept"):
        run_batch(batch(out=None), resume=True)


def test_a_full_disk_is_said_in_one_line_and_the_trials_before_are_whole(batch, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    rows = run_batch(batch())
    before = [next(rows), next(rows)]
    with monkeypatch.context() as patched:
        patched.setattr("pyarrow.parquet.write_table", full)
        with pytest.raises(
            RunError, match=r"trial_00002\.parquet: cannot be written \(No space left on device\); earlier"
        ) as caught:
            next(rows)
    assert "\n" not in str(caught.value)
    assert sorted(os.listdir(tmp_path / "logs")) == [Path(row["log"]).name for row in before]
    rows = list(run_batch(batch(), resume=True))
    assert plain(rows[:2]) == plain(before)
    assert plain(rows) == plain(run_batch(batch(out=str(tmp_path / "other"))))


def test_a_disk_that_is_full_ends_the_program_with_status_1_and_one_line(short, tmp_path):
    ran = subprocess.run(
        [sys.executable, "-c", LIMITED, *command(short, tmp_path / "logs"), "--workers", "2"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (ran.returncode, ran.stdout) == (1, "")
    assert re.fullmatch(
        r"drake-shared: .*trial_00000\.parquet: cannot be written \(File too large\); earlier .*\n",
        ran.stderr,
    )
    assert os.listdir(tmp_path / "logs") == []


def test_a_folder_that_is_removed_is_not_made_anew(batch, tmp_path):
    rows = run_batch(batch())
    next(rows)
    shutil.rmtree(tmp_path / "logs")
    with pytest.raises(RunError, match=r"trial_00001\.parquet: cannot be written: its folder was removed"):
        next(rows)
    assert not (tmp_path / "logs").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_permission_that_is_lost_is_said_in_one_line(batch, tmp_path):
    rows = run_batch(batch())
    next(rows)
    (tmp_path / "logs").chmod(0o500)
    try:
        with pytest.raises(RunError, match=r"folder to write to \(Permission denied\); earlier"):
            next(rows)
    finally:
        (tmp_path / "logs").chmod(0o700)
    assert list(contents(tmp_path / "logs")) == ["trial_00000.parquet"]


def test_what_drive_kept_is_whole_wherever_it_is_killed(short, tmp_path):
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
        after = {path.name: path.read_bytes() for path in tmp_path.glob("[!.]*")}
        assert kept.items() < after.items()
        assert all(read_log(tmp_path / name).metadata["operator"] == "SurrogateOperator" for name in after)
        kept = after
