"""The assaults, each for a moment: `scripts/assault` does them for a minute each, and holds them to the clock.

How many control steps were missed is for an idle machine to say. Here nothing may crash, nobody be thrown out
and nothing grow."""

import json
import subprocess
import sys
from pathlib import Path

ENDURANCE = Path(__file__).parent / "endurance"
OF_THE_MACHINE = ("control steps were missed", "ms old")


def test_no_assault_disturbs_the_driver_or_leaves_anything_behind():
    command = [sys.executable, str(ENDURANCE), "assault", "--seconds", "1.5", "--json"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert run.returncode in (0, 1), run.stderr
    report = json.loads(run.stdout)
    assert [what for what in report["broken"] if not any(part in what for part in OF_THE_MACHINE)] == []
    assert len(report["assaults"]) == 7
    assert report["assaults"]["random_messages"]["did"]["messages"] > 100
    assert report["assaults"]["silence"]["did"]["connections"] >= 200
    assert all(result["steps"] > 15 for result in report["assaults"].values())
