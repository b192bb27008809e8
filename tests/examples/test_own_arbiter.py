"""The example of an arbiter, as a system, as a program and by name, and the example of a config."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from drake_shared.arbitration.authority import Authority
from drake_shared.cli.main import main
from drake_shared.simulation.config import load_config
from drake_shared.simulation.log import read_log

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def module():
    spec = importlib.util.spec_from_file_location("own_arbiter", EXAMPLES / "own_arbiter.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(("confidence", "weight"), [(0.0, 1.0), (0.7, 1.0), (0.71, 0.0), (np.nan, 1.0)])
def test_the_agent_drives_above_the_threshold(module, confidence, weight):
    dut = module.ThresholdArbiter(0.7)
    context = dut.CreateDefaultContext()
    human, autonomous = [1.0, 3.0], [5.0, 4.0]
    dut.get_human_command_input_port().FixValue(context, human)
    dut.get_autonomous_command_input_port().FixValue(context, autonomous)
    dut.get_confidence_input_port().FixValue(context, [confidence])
    assert dut.get_human_weight_output_port().Eval(context).item() == weight
    command = dut.get_shared_command_output_port().Eval(context)
    np.testing.assert_array_equal(command, human if weight else autonomous)


def test_the_example_runs_as_a_program():
    ran = subprocess.run(
        [sys.executable, EXAMPLES / "own_arbiter.py"], capture_output=True, text=True, check=True
    )
    assert ran.stdout.startswith("reached ")


def test_registered_it_is_found_by_name_with_its_options(tmp_path, monkeypatch, capsys):
    info = tmp_path / "own_arbiter-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: own-arbiter\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[drake_shared.arbiters]\nthreshold = own_arbiter:ThresholdArbiter\n"
    )
    monkeypatch.syspath_prepend(str(EXAMPLES))
    monkeypatch.syspath_prepend(str(tmp_path))
    name = "threshold:threshold=0.6"
    assert main(["simulate", "--arbitration", name, "--json", "--out", str(tmp_path / "logs")]) == 0
    (row,) = json.loads(capsys.readouterr().out)["trials"]
    trial = read_log(row["log"])
    assert trial.metadata["arbitration"] == {"name": "threshold", "configuration": {"threshold": 0.6}}
    np.testing.assert_array_equal(trial["human_weight"], trial["confidence"] <= 0.6)
    sys.modules.pop("own_arbiter")


def test_the_example_of_a_config_is_valid():
    config = load_config(EXAMPLES / "cautious.yaml")
    assert config.authority == Authority(floor=0.3, conflict_time=0.2)
    assert config.safety_clearance == 0.05
