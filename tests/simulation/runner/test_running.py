"""Tasks in this process and in pools of processes give the same bits, whatever fails meanwhile."""

import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from drake_shared.common.errors import InputError, RunError
from drake_shared.simulation.runner import JsonStore, Task, run, run_tasks

# A process of its own, which Ctrl-C reaches as in a terminal.
RUN = """
import sys
from drake_shared.simulation.runner import JsonStore, Task, run_tasks
folder, workers, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
tasks = [Task("example_tasks:walk", {"seed": seed, "seconds": seconds}) for seed in range(8)]
store = JsonStore.open(folder, {}, resume=True)
try:
    run_tasks(tasks, store, workers=workers, progress=lambda done, total: print(done, total, flush=True))
except KeyboardInterrupt:
    sys.exit(130)
"""


def test_the_number_of_workers_changes_no_bit(make_walks, tmp_path, files_of):
    tasks = make_walks(6)
    values = [
        run_tasks(tasks, JsonStore.open(tmp_path / str(workers), {}), workers=workers) for workers in (1, 2)
    ]
    assert repr(values[0]) == repr(values[1])
    assert [value["seed"] for value in values[0]] == list(range(6))
    assert files_of(tmp_path / "1") == files_of(tmp_path / "2")


def test_completed_tasks_are_not_repeated_and_equal_tasks_are_run_once(store, tmp_path):
    task = Task("example_tasks:fails_once", {"seed": 3, "marker": str(tmp_path / "marker")})
    (tmp_path / "marker").touch()
    calls = []
    first = run_tasks([task, task], store, progress=lambda *numbers: calls.append(numbers))
    assert repr(first[0]) == repr(first[1])
    assert calls == [(0, 1), (1, 1)]
    (tmp_path / "marker").unlink()
    assert repr(run_tasks([task], store, retries=0)) == repr(first[:1])
    assert not (tmp_path / "marker").exists()


@pytest.mark.parametrize("workers", [1, 2])
def test_libraries_run_on_one_thread(store, workers):
    assert run_tasks([Task("example_tasks:threads")], store, workers=workers) == [{"torch": 1, "blas": 1}]


def test_thread_limits_are_restored_afterwards(store):
    import torch
    from threadpoolctl import threadpool_info, threadpool_limits

    before, environment = torch.get_num_threads(), dict(os.environ)
    torch.set_num_threads(2)
    try:
        with threadpool_limits(2):
            run_tasks([Task("example_tasks:threads")], store)
            assert torch.get_num_threads() == 2
            assert max(item["num_threads"] for item in threadpool_info() if item["user_api"] == "blas") == 2
        assert dict(os.environ) == environment
    finally:
        torch.set_num_threads(before)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_failed_task_is_retried(store, tmp_path, make_walks, workers, caplog):
    tasks = make_walks(3)
    tasks[1] = Task("example_tasks:fails_once", {"seed": 1, "marker": str(tmp_path / "marker")})
    assert repr(run_tasks(tasks, store, workers=workers)) == repr([task.run() for task in make_walks(3)])
    assert "fails_once failed (OSError: connection lost)" in caplog.text


@pytest.mark.parametrize(("workers", "retries"), [(1, 0), (2, 2)])
def test_a_task_that_always_fails_ends_the_run(store, tmp_path, workers, retries):
    calls = tmp_path / "calls"
    with pytest.raises(RunError) as caught:
        run_tasks(
            [Task("example_tasks:fails", {"calls": str(calls)})], store, workers=workers, retries=retries
        )
    assert {"example_tasks:fails", str(retries + 1)} <= set(str(caught.value).split())
    assert "\n" not in str(caught.value)
    assert len(calls.read_text().splitlines()) == retries + 1
    assert "in fails" in caught.value.__notes__[0]


@pytest.mark.parametrize("workers", [1, 2])
def test_bad_input_is_not_retried(store, tmp_path, workers):
    calls = tmp_path / "calls"
    with pytest.raises(InputError, match=r"^scenario\.yaml: duration"):
        run_tasks([Task("example_tasks:refuses", {"calls": str(calls)})], store, workers=workers)
    assert calls.read_text() == "called\n"


def test_a_value_that_is_not_json_serializable_fails(store):
    with pytest.raises(RunError, match=r"not_json .*TypeError: set"):
        run_tasks([Task("example_tasks:not_json")], store, retries=0)


def test_a_killed_worker_is_replaced(store, tmp_path, make_walks):
    tasks = make_walks(6)
    tasks[2] = Task("example_tasks:killed_once", {"seed": 2, "marker": str(tmp_path / "marker")})
    values = run_tasks(tasks, store, workers=2)
    assert (tmp_path / "marker").exists()
    assert repr(values) == repr([task.run() for task in make_walks(6)])


def test_a_task_that_always_kills_its_worker_ends_the_run(store, tmp_path):
    calls = tmp_path / "calls"
    with pytest.raises(RunError, match="workers were lost 2 times"):
        run_tasks([Task("example_tasks:killed", {"calls": str(calls)})], store, workers=2, retries=1)
    assert len(calls.read_text().splitlines()) == 2


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_a_bar_unless_the_caller_shows_the_progress(store, make_walks, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    run_tasks(make_walks(1), store, progress=lambda _done, _total: None)
    assert sys.stderr.getvalue() == ""
    run_tasks(make_walks(1), store)
    assert "1/1" in sys.stderr.getvalue()


def test_a_worker_with_other_code_is_refused(store, make_walks, monkeypatch):
    other = {**run.identity(), "source": "0" * 24}
    monkeypatch.setattr(run, "identity", lambda: other)
    with pytest.raises(InputError, match=r"^process \d+ on .* source is") as caught:
        run_tasks(make_walks(1), store, workers=2)
    assert "\n" not in str(caught.value)
    assert not (store.folder / "results").exists()


def start(folder: Path, workers: int, environment, seconds: float = 0.2) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", RUN, str(folder), str(workers), str(seconds)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A group of its own, as a terminal gives it: Ctrl-C reaches the workers, too.
        start_new_session=True,
    )


@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_keeps_completed_results_and_resuming_gives_the_same_bits(
    tmp_path, environment, files_of, workers
):
    process = start(tmp_path / "run", workers, environment)
    while process.stdout.readline() != "2 8\n":
        assert process.poll() is None, process.stderr.read()
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=20)
    assert (process.returncode, errors) == (130, "")
    done = files_of(tmp_path / "run" / "results")
    assert 2 <= len(done) < 8
    tasks = [Task("example_tasks:walk", {"seed": seed, "seconds": 0.2}) for seed in range(8)]
    calls = []
    values = run_tasks(
        tasks,
        JsonStore.open(tmp_path / "run", {}, resume=True),
        workers=workers,
        progress=lambda *numbers: calls.append(numbers),
    )
    assert calls[0] == (len(done), 8)
    quick = [Task("example_tasks:walk", {"seed": seed}) for seed in range(8)]
    assert repr(values) == repr(run_tasks(quick, JsonStore.open(tmp_path / "uninterrupted", {})))
    assert done.items() <= files_of(tmp_path / "run" / "results").items()


def test_workers_exit_with_the_process_that_started_them(tmp_path, environment):
    process = start(tmp_path / "run", 2, environment, seconds=0.5)
    while process.stdout.readline() != "1 8\n":
        assert process.poll() is None, process.stderr.read()
    assert len(members(process.pid)) >= 4  # With the fork server and the tracker of resources.
    process.kill()
    process.communicate()
    deadline = time.monotonic() + 30
    while members(process.pid):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def members(session: int) -> list[int]:
    """The processes of a session."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(stat.parent.name))
    return found


def test_numbers_out_of_range_are_bad_input(store):
    with pytest.raises(InputError, match=r"workers .* 0$"):
        run_tasks([Task("example_tasks:threads")], store, workers=0)
    with pytest.raises(InputError, match=r"retries .* -1$"):
        run_tasks([], store, retries=-1)
