"""The replay of an arm: a whole page with an animation."""

import json
import re

import numpy as np
import pytest

from drake_shared.analysis.replay import write_replay
from drake_shared.analysis.viewer import Catalogue
from drake_shared.analysis.viewer.details import details
from drake_shared.scenario import load_scenario
from drake_shared.scenario.space_path import SpacePath
from drake_shared.simulation.trial import Simulation, TrialSettings, write_log
from drake_shared.systems.strip_mesh import strip_mesh

CUPS = load_scenario("table_three_cups")


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> str:
    trial = Simulation(CUPS).run(TrialSettings(route="left"))
    path = tmp_path_factory.mktemp("replay") / "replay.html"
    write_replay(trial, path, note="<seen> & kept")
    return path.read_text(encoding="utf-8")


def test_the_page_holds_the_trial(page):
    found = re.search(r'<script type="application/json" id="trial">(.*?)</script>', page, re.DOTALL)
    metadata = json.loads(found.group(1))
    assert metadata["route"] == "left"
    assert "scenario" not in metadata


def test_the_note_is_escaped_and_the_title_names_the_scenario(page):
    assert "&lt;seen&gt; &amp; kept" in page
    assert "<title>table_three_cups: replay</title>" in page


def test_a_strip_lies_level_across_its_curve_and_follows_it_upward():
    center = SpacePath(CUPS.routes[1].waypoints).points[100:]
    width = np.full(len(center), 0.02)
    vertices, faces = strip_mesh(center, width)
    left, right = vertices.T[::2], vertices.T[1::2]
    np.testing.assert_allclose((left + right) / 2, center, atol=1e-12)
    np.testing.assert_allclose(left[:, 2], right[:, 2])
    np.testing.assert_allclose(np.linalg.norm(left - right, axis=1), 0.04, atol=1e-9)
    assert faces.shape == (3, 2 * (len(center) - 1))


def test_no_strip_is_drawn_where_nothing_is_known():
    center = np.column_stack([np.linspace(0.0, 1.0, 11), np.zeros((11, 2))])
    known = np.arange(11) < 6
    _, faces = strip_mesh(center, np.full(11, 0.1), known)
    assert faces.max() == 2 * 5 + 1


def test_show_draws_the_log_from_above(tmp_path):
    trial = Simulation(CUPS).run(TrialSettings(route="over"))
    write_log(trial, tmp_path / "log.parquet")
    catalogue = Catalogue(tmp_path)
    (entry,) = catalogue.read()
    scene = details(entry)["scene"]
    assert [route["name"] for route in scene["routes"]] == ["left", "over", "right"]
    assert "table" not in [item["name"] for item in scene["obstacles"]]
