"""Every figure has a unit, a direction and a meaning, and the reference page says the same."""

import re
from pathlib import Path

import pytest

from drake_shared.analysis.glossary import OF_LEARNERS, OF_TRIALS, measure
from drake_shared.analysis.metrics import Metrics

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "metrics.md"


def test_every_metric_of_a_trial_is_explained_in_its_order():
    assert list(OF_TRIALS) == list(Metrics.__annotations__)


@pytest.mark.parametrize(
    ("heading", "measures"), [("# Metrics", OF_TRIALS), ("## Of predictions", OF_LEARNERS)]
)
def test_the_reference_page_gives_the_same_units_directions_and_meanings(heading, measures):
    section = PAGE.read_text(encoding="utf-8").partition(heading)[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \| (.*?) ?\| (.*?) ?\| (.*?) \|$", section, flags=re.MULTILINE)
    assert {row[0]: row[1:] for row in rows} == {
        name: (item.unit, item.better, item.meaning) for name, item in measures.items()
    }


def test_higher_clearance_and_lower_error_are_better():
    assert measure("clearance").direction == "higher is better"
    assert measure("ade").direction == "lower is better"
    assert measure("no such figure") is None
