"""The scripts, in a copy of the checkout whose virtual environment only reports how it was called."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
REPORT = '#!/bin/sh\necho "$PWD" "$@"\n'


@pytest.fixture
def checkout(tmp_path) -> Path:
    root = tmp_path / "a checkout"
    shutil.copytree(ROOT / "scripts", root / "scripts")
    (root / ".venv/bin").mkdir(parents=True)
    for name in ("python", "drake-shared", "sphinx-build"):
        (root / ".venv/bin" / name).write_text(REPORT)
        (root / ".venv/bin" / name).chmod(0o755)
    locks = ("requirements.lock", "requirements-test.lock")
    for name in ("pyproject.toml", *locks):
        shutil.copy(ROOT / name, root / name)
    for lock in locks:
        checksum = subprocess.run(
            ["cksum"], input=(root / lock).read_bytes() + (root / "pyproject.toml").read_bytes(), **CAPTURE
        )
        (root / ".venv" / f"installed-{lock}").write_bytes(checksum.stdout)
    return root


CAPTURE = {"capture_output": True, "check": True}


def test_drive_runs_in_the_folder_of_its_caller(checkout, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    called = subprocess.run(
        [checkout / "scripts/drive", "--scenario", "my.yaml"], cwd=elsewhere, text=True, **CAPTURE
    )
    assert called.stdout.split() == [os.fspath(elsewhere), "drive", "--scenario", "my.yaml"]
    assert not called.stderr  # Nothing was installed again.


def test_docs_treat_warnings_as_errors(checkout, tmp_path):
    called = subprocess.run([checkout / "scripts/docs"], cwd=tmp_path, text=True, **CAPTURE)
    assert called.stdout.startswith(os.fspath(checkout))
    assert "--fail-on-warning" in called.stdout


def test_models_makes_the_demonstrations_and_learners_that_ship(checkout):
    called = subprocess.run([checkout / "scripts/models"], text=True, **CAPTURE)
    made = [line.partition("--out ")[2] for line in called.stdout.splitlines()]
    shipped = [*ROOT.glob("models/demonstrations/*"), *ROOT.glob("models/learners/*")]
    assert sorted(made) == sorted(path.relative_to(ROOT).as_posix() for path in shipped)


def test_lock_files_pin_versions_and_name_no_host():
    for lock in ROOT.glob("requirements*.lock"):
        lines = [line for line in lock.read_text().splitlines() if not line.startswith("#")]
        assert lines
        assert not [line for line in lines if "==" not in line or "://" in line]
