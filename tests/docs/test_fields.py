"""The reference pages list the fields that there are: of scenarios, files and metrics."""

import dataclasses
import json
import re
from pathlib import Path

import pytest
from pyarrow import parquet

from drake_shared import (
    Arm,
    Authority,
    Box,
    Circle,
    DiffDrive,
    Goal,
    Route,
    Scenario,
    SharedControlConfig,
    Start,
    TrialSettings,
    Workspace,
    load_learner,
    load_scenario,
    metrics,
    read_demonstrations,
    run_trial,
    write_demonstrations,
)
from drake_shared.analysis.metrics import Metrics
from drake_shared.arbitration.feedback import Feedback
from drake_shared.simulation.faults import Faults

REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"


def listed(page: str, section: str) -> set[str]:
    """Names in the first column of the tables below a heading."""
    text = (REFERENCE / page).read_text(encoding="utf-8")
    body = re.split(rf"^#+ {re.escape(section)}$", text, flags=re.MULTILINE)[1]
    body = re.split(r"^#", body, flags=re.MULTILINE)[0]
    return {name for line in body.splitlines() if line.startswith("| `") for name in names(line)}


def names(line: str) -> list[str]:
    return re.findall(r"`([\w.]+)`", line.split("|")[1])


@pytest.mark.parametrize("kind", [Scenario, Start, Goal, Workspace, Route, Circle, Box, DiffDrive, Arm])
def test_scenario_fields(kind):
    assert listed("scenario.md", kind.__name__) == {field.name for field in dataclasses.fields(kind)}


@pytest.mark.parametrize("kind", [SharedControlConfig, Authority, Feedback, Faults])
def test_every_field_of_the_config_is_described(kind):
    # These tables are made of the docstrings of the fields.
    import sys

    sys.path.insert(0, str(REFERENCE.parent / "_ext"))
    from fields import described_fields

    assert all(text for _, _, text in described_fields(kind))


@pytest.fixture(scope="module")
def trial():
    config = SharedControlConfig(
        safety_clearance=0.05,
        feedback=Feedback(tone=True),
        faults=Faults(delay=0.1, pose_noise=0.001, slip=0.01, late_learner=0.05),
    )
    scenario = load_scenario("two_obstacles")
    return run_trial(scenario, load_learner("two_obstacles"), config=config, route="left_right")


def test_log_columns_and_metadata(trial):
    assert listed("files.md", "Logs") == {
        *trial.columns,
        *trial.metadata,
        "recording",
        # Of the arbiter fusion, which has no feedback.
        "driver_noise",
        "another_driver",
    }


def test_demonstration_columns_and_metadata(tmp_path):
    path = tmp_path / "again.parquet"
    shipped = Path(__file__).resolve().parents[2] / "models" / "demonstrations" / "two_obstacles.parquet"
    write_demonstrations(path, read_demonstrations(shipped))
    schema = parquet.read_schema(path)
    assert listed("files.md", "Demonstrations") >= {
        *schema.names,
        *json.loads(schema.metadata[b"drake_shared"]),
    }


def test_learner_metadata():
    described = set(load_learner("two_obstacles").metadata) - {"id", "file"}
    inner = {"scale", "sigma_floor", "sigma_scale", "doubt_reach", "doubt_gain"}
    assert described - inner <= listed("files.md", "Learner files")


def test_metrics(trial):
    page = (REFERENCE / "metrics.md").read_text(encoding="utf-8").split("## Of predictions")[0]
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    described = {name for line in rows for name in names(line)}
    assert described == set(Metrics.__annotations__) >= set(metrics(trial))


def test_settings_of_a_trial_are_in_its_log(trial):
    kept = {"driver": "mode"}
    assert {kept.get(field.name, field.name) for field in dataclasses.fields(TrialSettings)} <= set(
        trial.metadata
    ) | {"recording"}
