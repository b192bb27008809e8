"""The assaults, each for a moment: `scripts/assault` does each for a minute, and holds them to the clock.

How many control steps were missed is for an idle machine to say, and a moment says nothing of growth. Here
nothing may crash, nobody be thrown out and nothing take more than its bound."""

import json
import subprocess
import sys
from pathlib import Path

ENDURANCE = Path(__file__).parent / "endurance"
NOT_FOR_A_MOMENT = ("control steps were missed", "ms old", "memory grew")
NAMES = ("random_messages", "oversized_frames", "silence", "slow_readers", "churn", "flood")


def test_no_assault_disturbs_the_driver_or_leaves_anything_behind():
    command = [sys.executable, str(ENDURANCE), "assault", "--seconds", "1", "--only", *NAMES, "--json"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert run.returncode in (0, 1), run.stderr
    report = json.loads(run.stdout)
    assert [what for what in report["broken"] if not any(part in what for part in NOT_FOR_A_MOMENT)] == []
    assert set(report["assaults"]) == set(NAMES)
    assert report["assaults"]["random_messages"]["did"]["messages"] > 50
    assert report["assaults"]["silence"]["did"]["connections"] >= 200
    assert all(result["steps"] > 10 for result in report["assaults"].values())
