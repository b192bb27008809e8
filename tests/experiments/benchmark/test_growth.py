"""Growth of computing times with obstacles, queries, demonstrations and trials."""

import pytest

from drake_shared.experiments.benchmark import growth
from drake_shared.scenario import check_scenario


@pytest.mark.parametrize("count", [1, 2, 3, 40])
def test_further_obstacles_stand_beside_the_workspace(scenario, count):
    crowded = growth.add_obstacles(scenario, count, duration=2.0)
    assert len(crowded.obstacles) == count
    assert len({item.name for item in crowded.obstacles}) == count
    assert crowded.obstacles[: min(count, 2)] == scenario.obstacles[:count]
    top = scenario.workspace.y_max
    assert all(item.y - item.bounding_radius() > top for item in crowded.obstacles[2:])
    crowded.routes = [growth.dataclasses.replace(scenario.routes[0], sides={}) for _ in range(1)]
    for item in crowded.obstacles:
        crowded.routes[0].sides[item.name] = scenario.routes[0].sides.get(item.name, "right")
    check_scenario(crowded)


def test_quick_run(setup, monkeypatch, check_result):
    monkeypatch.setattr(growth, "OBSTACLES", (2, 5, 20))
    monkeypatch.setattr(growth, "DEMONSTRATIONS", (3, 5, 9))
    monkeypatch.setattr(growth, "QUERIES", (75, 150))
    result = growth.run(setup)
    check_result(result)
    assert {curve.size for curve in result.curves} == {"obstacles", "queries", "demonstrations", "trials"}
    assert result.curves[0].sizes == [2, 20]
