"""A small study without a learner, whose trials are quick."""

from pathlib import Path
from typing import Any

import pytest
import yaml

STUDY: dict[str, Any] = {
    "name": "small",
    "conditions": {"plain": {"config": {"driver": "human"}}, "slow": {"config": {"driver": "human"}}},
    "participants": 4,
    "trials": 3,
    "practice": 1,
    "texts": {"consent": "Do you agree?", "introduction": "Drive to the goal."},
    "questionnaires": {"participant": ["demographics"], "block": ["raw_tlx"]},
    "measures": {
        "primary": [
            {"name": "completion_time", "smallest_effect": 0.5},
            {"name": "raw_tlx.workload", "smallest_effect": 10.0},
        ],
        "secondary": [{"name": "intent_success", "smallest_effect": 0.2}],
    },
    "exclusions": [
        {"measure": "late_share", "above": 0.05},
        {"measure": "success", "below": 0.1, "of": "participant"},
    ],
}


@pytest.fixture
def small(tmp_path) -> Path:
    """Folder of the study, not yet planned."""
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(STUDY))
    return tmp_path
