"""Runs every attack for half a second; `scripts/assault` runs each for a minute and checks timing as well.

Missed control steps can be judged only on an idle machine, and growth of memory only over a longer time. Here
nothing may crash, no driver may be disconnected and no limit be exceeded."""

import json
import subprocess
import sys
from pathlib import Path

ENDURANCE = Path(__file__).parent / "endurance"
NEEDS_LONGER = ("control steps were missed", "ms old", "memory grew", "TimeoutError")
NAMES = ("random_messages", "oversized_frames", "silence", "slow_readers", "churn", "flood")


def test_no_attack_disturbs_the_driver():
    command = [sys.executable, str(ENDURANCE), "assault", "--seconds", "0.5", "--only", *NAMES, "--json"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert run.returncode in (0, 1), run.stderr
    report = json.loads(run.stdout)
    assert [what for what in report["broken"] if not any(part in what for part in NEEDS_LONGER)] == []
    assert set(report["assaults"]) == set(NAMES)
    assert report["assaults"]["random_messages"]["did"]["messages"] > 10
    assert report["assaults"]["silence"]["did"]["connections"] >= 200
