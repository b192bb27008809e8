"""Files about the project agree with each other."""

import re
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_citation_names_this_version_and_licence():
    citation = yaml.safe_load(read("CITATION.cff"))
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]


def test_changelog_covers_this_version():
    assert PROJECT["version"] in re.findall(r"^## (\S+)", read("CHANGELOG.md"), re.MULTILINE)


def test_hosted_checks_run_the_local_script_on_every_supported_python():
    workflow = yaml.safe_load(read(".github/workflows/ci.yml"))
    matrix = workflow["jobs"]["test"]["strategy"]["matrix"]
    classifiers = re.findall(r"3\.\d+", PROJECT["requires-python"])
    assert (matrix["python"][0], f"3.{int(matrix['python'][-1][2:]) + 1}") == tuple(classifiers)
    assert {name.split("-")[0] for name in matrix["os"]} == {"ubuntu", "macos"}
    assert "scripts/test" in [step.get("run") for step in workflow["jobs"]["test"]["steps"]]


def test_pre_commit_hooks_are_local():
    assert {
        repository["repo"] for repository in yaml.safe_load(read(".pre-commit-config.yaml"))["repos"]
    } == {"local"}
