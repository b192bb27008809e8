"""The second training sets: paired seeds, probabilities, and the report."""

import dataclasses

import pytest

from drake_shared.common.errors import RunError
from drake_shared.experiments import fig5_sets as second_sets, training
from drake_shared.experiments.section import QUICK

SIZE = dataclasses.replace(QUICK, learners=1, paper=None)


@pytest.fixture(scope="module")
def results(run_plan):
    # With fewer iterations the learner leads some drives away from the goal.
    short = dataclasses.replace(training.STUDIED["default"], iterations=300)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "STUDIED", {"paper": short, "default": short})
        yield run_plan(second_sets, SIZE)


def test_each_set_has_the_same_known_and_as_many_new_demonstrations(results):
    rows = [row for result in results for row in result["rows"]]
    sets = {name: [r for r in rows if r["set"] == name] for name in ("paper", "default", "human")}
    first = {name: [(r["route"], r["score"]) for r in own if not r["new"]] for name, own in sets.items()}
    assert first["paper"] == first["default"] == first["human"]
    for own in sets.values():
        assert [r["new"] for r in own] == [False] * 3 + [True] * 3
        assert [r["route"] for r in own[:3]] == [r["route"] for r in own[3:]]
        assert sum(r["probability"] for r in own) == pytest.approx(1.0)
        assert max(own, key=lambda r: r["score"]) == max(own, key=lambda r: r["probability"])


def test_a_set_that_cannot_be_driven_is_reported_as_missing(monkeypatch, run_plan):
    usual = second_sets.demonstrate

    def demonstrate(scenario, teaching):
        if any(one.learner for one in teaching):
            return [RunError("the simulated operator fails")] * len(teaching)
        return usual(scenario, teaching)

    monkeypatch.setattr(second_sets, "demonstrate", demonstrate)
    monkeypatch.setattr(second_sets, "train_all", lambda sets, *_, **__: ["a learner"] * len(sets))
    found = run_plan(second_sets, SIZE)
    assert {row["set"] for result in found for row in result["rows"]} == {"human"}
    text = second_sets.report(None, SIZE, found).text
    assert sum("the simulated operator fails" in paragraph for paragraph in text) == 2


def test_the_table_gives_the_probability_of_new_demonstrations(results):
    section = second_sets.report(None, SIZE, results)
    new = sum(
        r["probability"] for result in results for r in result["rows"] if r["set"] == "human" and r["new"]
    )
    assert section.tables[0].rows[2][1].startswith(f"{new:.3g} [")
    assert section.pictures[0].svg.startswith("<svg")
