"""The tasks of the tests, and stores to keep their results in."""

import os
from pathlib import Path

import pytest

import drake_shared
from drake_shared.simulation.runner import Store, Task

HERE = Path(__file__).parent
ROOT = Path(drake_shared.__file__).parents[1]


@pytest.fixture(autouse=True)
def _chores(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE))


@pytest.fixture(scope="session")
def environment() -> dict[str, str]:
    """For other processes: this code and the tasks."""
    return {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{HERE}"}


@pytest.fixture
def store(tmp_path) -> Store:
    return Store.open(tmp_path / "run", {"trials": 4})


def walks(count: int, **arguments) -> list[Task]:
    return [Task("chores:walk", {"seed": seed, **arguments}) for seed in range(count)]


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
