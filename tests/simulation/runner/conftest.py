"""Example tasks, and stores for their results."""

import os
from pathlib import Path

import pytest

import drake_shared
from drake_shared.simulation.runner import JsonStore, Task

HERE = Path(__file__).parent
ROOT = Path(drake_shared.__file__).parents[1]


@pytest.fixture(autouse=True)
def _example_tasks(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE))


@pytest.fixture(scope="session")
def environment() -> dict[str, str]:
    """The environment of other processes, in which they find this code and the tasks."""
    return {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{HERE}"}


@pytest.fixture
def store(tmp_path) -> JsonStore:
    return JsonStore.open(tmp_path / "run", {"trials": 4})


def walks(count: int, **arguments) -> list[Task]:
    return [Task("example_tasks:walk", {"seed": seed, **arguments}) for seed in range(count)]


@pytest.fixture(scope="session")
def make_walks():
    return walks


@pytest.fixture(scope="session")
def files_of():
    """The bytes of each file of a run."""

    def read(folder) -> dict[str, bytes]:
        folder = Path(folder)
        return {
            str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()
        }

    return read
