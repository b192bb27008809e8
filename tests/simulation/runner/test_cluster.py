"""Tasks on a Dask scheduler and workers that run on this machine."""

import contextlib
import dataclasses
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import drake_shared
from drake_shared.common.errors import InputError, RunError
from drake_shared.simulation.runner import JsonStore, Task, executors, run_tasks

DASK = Path(sys.executable).with_name("dask")
# Without the second, the diagnostics server listens on every interface, even with --no-dashboard.
LOCAL = ("--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0")


@dataclasses.dataclass
class Cluster:
    """A scheduler and its workers, each a process of its own. Nannies would be as many more processes."""

    environment: dict[str, str]
    folder: Path
    processes: list[subprocess.Popen] = dataclasses.field(default_factory=list)
    address: str = ""

    def start_scheduler(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self._start("scheduler", "--port", str(port))

    def start_worker(self, *options: str, environment: dict[str, str] | None = None) -> subprocess.Popen:
        options = options or ("--nthreads", "1")
        return self._start("worker", self.address, "--no-nanny", *options, environment=environment)

    def _start(self, *command: str, environment: dict[str, str] | None = None) -> subprocess.Popen:
        with (self.folder / f"{len(self.processes)}.log").open("w") as log:
            process = subprocess.Popen(
                [str(DASK), *command, *LOCAL],
                cwd=self.folder,
                env=environment or self.environment,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        self.processes.append(process)
        return process

    def wait_for(self, workers: int) -> None:
        from distributed import Client

        with Client(self.address, timeout=20, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=30)

    def stop(self) -> None:
        for process in self.processes:
            kill(process)


def kill(process: subprocess.Popen) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@contextlib.contextmanager
def cluster_of(workers: int, environment, folder: Path) -> Iterator[Cluster]:
    cluster = Cluster(environment, folder)
    try:
        cluster.start_scheduler()
        for _ in range(workers):
            cluster.start_worker()
        if workers:
            cluster.wait_for(workers)
        yield cluster
    finally:
        cluster.stop()


@pytest.fixture(scope="module")
def cluster(environment, tmp_path_factory) -> Iterator[Cluster]:
    with cluster_of(2, environment, tmp_path_factory.mktemp("cluster")) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def other_code(environment, tmp_path_factory) -> dict[str, str]:
    """The environment of a worker whose copy of the package differs by one comment."""
    root = tmp_path_factory.mktemp("other")
    source = Path(drake_shared.__file__).parent
    shutil.copytree(source, root / "drake_shared", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(source.parent / "models", root / "models")
    with (root / "drake_shared" / "common" / "files.py").open("a") as file:
        file.write("# Another version.\n")
    return {**environment, "PYTHONPATH": f"{root}{os.pathsep}{environment['PYTHONPATH']}"}


def test_a_cluster_gives_the_bits_of_one_process(cluster, make_walks, tmp_path, files_of):
    tasks = [*make_walks(8), Task("example_tasks:extremes")]
    calls = []
    there = run_tasks(
        tasks,
        JsonStore.open(tmp_path / "there", {}),
        cluster=cluster.address,
        progress=lambda *numbers: calls.append(numbers),
    )
    assert repr(there) == repr(run_tasks(tasks, JsonStore.open(tmp_path / "here", {})))
    assert files_of(tmp_path / "there") == files_of(tmp_path / "here")
    assert calls == [(done, 9) for done in range(10)]


def test_libraries_run_on_one_thread_on_a_cluster(cluster, store):
    assert run_tasks([Task("example_tasks:threads")], store, cluster=cluster.address) == [
        {"torch": 1, "blas": 1}
    ]


def test_a_killed_worker_changes_no_result_and_a_killed_scheduler_keeps_completed_ones(
    environment, make_walks, tmp_path, monkeypatch
):
    tasks = make_walks(16, seconds=0.1)
    uninterrupted = run_tasks(make_walks(16), JsonStore.open(tmp_path / "here", {}))
    with cluster_of(2, environment, tmp_path) as cluster:
        scheduler, _, worker = cluster.processes

        def kill_worker(done: int, _total: int) -> None:
            if done == 3:
                kill(worker)

        values = run_tasks(
            tasks, JsonStore.open(tmp_path / "there", {}), cluster=cluster.address, progress=kill_worker
        )
        assert worker.returncode == -signal.SIGKILL
        assert repr(values) == repr(uninterrupted)

        def kill_scheduler(done: int, _total: int) -> None:
            if done == 3:
                kill(scheduler)

        monkeypatch.setattr(executors, "CONNECT_TIMEOUT", 1.0)
        with pytest.raises(InputError, match="--cluster"):
            run_tasks(
                tasks, JsonStore.open(tmp_path / "cut", {}), cluster=cluster.address, progress=kill_scheduler
            )
    assert 3 <= len(list((tmp_path / "cut" / "results").iterdir())) < 16
    assert repr(run_tasks(tasks, JsonStore.open(tmp_path / "cut", {}, resume=True), workers=2)) == repr(
        uninterrupted
    )


def test_a_failed_task_is_retried(cluster, store, tmp_path, make_walks, caplog):
    task = Task("example_tasks:fails_once", {"seed": 1, "marker": str(tmp_path / "marker")})
    assert repr(run_tasks([task], store, cluster=cluster.address)) == repr([make_walks(2)[1].run()])
    assert "fails_once failed" in caplog.text


def test_failures_on_a_cluster_are_reported_as_in_this_process(cluster, store, tmp_path):
    calls = tmp_path / "calls"
    with pytest.raises(RunError, match=r"example_tasks:fails.* 2 .*ZeroDivisionError"):
        run_tasks(
            [Task("example_tasks:fails", {"calls": str(calls)})], store, cluster=cluster.address, retries=1
        )
    calls.unlink()
    with pytest.raises(InputError, match=r"^scenario\.yaml: duration"):
        run_tasks([Task("example_tasks:refuses", {"calls": str(calls)})], store, cluster=cluster.address)
    assert calls.read_text() == "called\n"


def test_ctrl_c_keeps_completed_results_and_frees_the_cluster(cluster, store, make_walks, files_of):
    tasks = make_walks(30, seconds=0.2)

    def interrupt(done: int, _total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_tasks(tasks, store, cluster=cluster.address, progress=interrupt)
    done = files_of(store.folder / "results")
    assert len(done) == 2
    values = run_tasks(
        tasks[:3], JsonStore.open(store.folder, {"trials": 4}, resume=True), cluster=cluster.address
    )
    assert [value["seed"] for value in values] == [0, 1, 2]
    assert done.items() <= files_of(store.folder / "results").items()


def test_a_worker_with_other_code_is_refused_whenever_it_joins(
    cluster, other_code, store, make_walks, tmp_path
):
    tasks = make_walks(200, seconds=0.1)
    stranger = None

    def progress(done: int, _total: int) -> None:
        nonlocal stranger
        if done == 1:
            stranger = cluster.start_worker(environment=other_code)

    names_worker_and_source = r"^worker tcp://127\.0\.0\.1:\d+ .*source"
    try:
        with pytest.raises(InputError, match=names_worker_and_source):
            run_tasks(tasks, store, cluster=cluster.address, progress=progress)
        assert len(list((store.folder / "results").iterdir())) >= 1
        with pytest.raises(InputError, match=names_worker_and_source) as caught:
            run_tasks(tasks, JsonStore.open(tmp_path / "second", {}), cluster=cluster.address)
        assert "\n" not in str(caught.value)
        assert not (tmp_path / "second" / "results").exists()
    finally:
        if stranger is not None:
            kill(stranger)


def test_a_cluster_needs_workers_with_one_thread(environment, store, make_walks, tmp_path, monkeypatch):
    monkeypatch.setattr(executors, "CONNECT_TIMEOUT", executors.CONNECT_TIMEOUT / 4)
    with cluster_of(0, environment, tmp_path) as cluster:
        with pytest.raises(InputError, match="--cluster"):
            run_tasks(make_walks(1), store, cluster=cluster.address)
        monkeypatch.setattr(executors, "CONNECT_TIMEOUT", 4.0)
        cluster.start_worker("--nthreads", "2")
        cluster.wait_for(1)
        with pytest.raises(InputError, match=r"^worker tcp://[\d.:]+: --nthreads .*2$"):
            run_tasks(make_walks(1), store, cluster=cluster.address)


def hang_up(server: socket.socket) -> None:
    """Answers every connection with a reply that is not a scheduler's."""
    with contextlib.suppress(OSError):
        while True:
            with server.accept()[0] as connection:
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n" * 10)


@pytest.mark.parametrize("kind", ["closed", "silent", "nonsense", "stranger"])
def test_an_unreachable_cluster_is_bad_input(store, make_walks, monkeypatch, kind):
    monkeypatch.setattr(executors, "CONNECT_TIMEOUT", executors.CONNECT_TIMEOUT / 4)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        if kind == "closed":
            server.close()
        if kind == "stranger":
            threading.Thread(target=hang_up, args=(server,), daemon=True).start()
        address = "somewhere://else" if kind == "nonsense" else f"tcp://127.0.0.1:{port}"
        with pytest.raises(InputError, match=r"^--cluster") as caught:
            run_tasks(make_walks(1), store, cluster=address)
    assert address in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_dask_is_bad_input_that_names_the_extra(store, make_walks, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"\[distributed\]"):
        run_tasks(make_walks(1), store, cluster="tcp://127.0.0.1:1")
