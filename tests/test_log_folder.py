"""What a batch keeps: whatever kills it or fails it, trials that ended are whole and the rest can follow."""

import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from drake_shared import log_folder
from drake_shared.batch import Batch, run_batch
from drake_shared.cli import main
from drake_shared.errors import InputError, RunError
from drake_shared.operators import OPERATORS
from drake_shared.trial import read_log

TASK = Path(__file__).parents[1] / "models" / "scenarios" / "two_obstacles.yaml"
TRIALS = 40
KILLS = 8
LIMITED = """
import resource, sys
from drake_shared.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture(scope="module")
def short(tmp_path_factory) -> str:
    """A task that is over after a second and a half."""
    path = tmp_path_factory.mktemp("short") / "short.yaml"
    path.write_text(re.sub(r"(?m)^duration: .*$", "duration: 1.5", TASK.read_text()))
    return str(path)


@pytest.fixture
def batch(short, tmp_path):
    """Makes a batch of three short trials that are kept in ``tmp_path / "logs"``."""

    def make(**changes) -> Batch:
        given = {"scenario": short, "mode": "human", "count": 3, "out": str(tmp_path / "logs")}
        return Batch(**given | changes)

    return make


def contents(folder: Path) -> dict[str, str]:
    """Every bit of the logs in a folder, by name; each must be whole."""
    found = {}
    for path in sorted(folder.glob("trial_*.parquet")):
        trial = read_log(path)
        columns = {name: column.tobytes().hex() for name, column in trial.columns.items()}
        found[path.name] = json.dumps([columns, trial.metadata])
    return found


def plain(rows) -> str:
    """Rows as text, where NaN equals itself; without the folder of their logs."""
    return repr([row | {"log": Path(row["log"]).name} for row in rows])


def simulate(short: str, out: Path, *options: str, **given) -> subprocess.Popen:
    command = ("simulate", "--scenario", short, "--mode", "human", "--trials", str(TRIALS), "--json")
    return subprocess.Popen(
        [sys.executable, "-m", "drake_shared.cli", *command, "--out", str(out), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **given,
    )


def kill_while_it_writes(process: subprocess.Popen, folder: Path, delay: float) -> None:
    """Ends the process by SIGKILL ``delay`` after it put the next file into the folder, in [s]."""
    before = set(os.listdir(folder)) if folder.is_dir() else set()
    while process.poll() is None:
        if folder.is_dir() and set(os.listdir(folder)) - before:
            time.sleep(delay)
            break
        time.sleep(0.001)
    process.kill()
    process.communicate()


def survive(short: str, folder: Path, kills: int, *, trials_a_kill: float = 4.0) -> int:
    """Kills ``simulate --out`` at random moments, goes on, and counts what was left half written.

    A folder that is full is begun anew. Every trial that was there before a kill must be there after it,
    unchanged, and every log must be whole.
    """
    moments = random.Random(7)
    half_written, before = 0, {}
    for _ in range(kills):
        options = ("--resume",) if before else ()
        if len(before) > TRIALS - 2 * trials_a_kill:
            options, before = ("--force",), {}
        process = simulate(short, folder, *options)
        if options == ("--force",):
            while (folder / f"trial_{TRIALS - 1:05d}.parquet").exists() and process.poll() is None:
                time.sleep(0.001)
        kill_while_it_writes(process, folder, moments.uniform(0.0, 0.01 * trials_a_kill))
        after = contents(folder)
        assert before.items() <= after.items()
        half_written += sum(name.startswith(".") for name in os.listdir(folder))
        before = after
    return half_written


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
    said, _ = simulate(short, tmp_path, "--workers", "2", "--resume").communicate()
    assert (said.replace(str(tmp_path), "FOLDER"), contents(tmp_path)) == undisturbed
