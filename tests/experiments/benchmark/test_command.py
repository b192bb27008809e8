"""``drake-shared benchmark``: output, files and invalid input."""

import json

import pytest

from drake_shared.cli.main import main
from drake_shared.experiments.benchmark import groups
from drake_shared.experiments.benchmark.figure import draw
from drake_shared.experiments.benchmark.results import GroupResult, Ratio, Trace, make_curve
from drake_shared.experiments.benchmark.table import describe
from drake_shared.experiments.benchmark.timing import spread


@pytest.fixture
def every_group(monkeypatch):
    """Groups with results that need no measurement."""
    curve = make_curve("a step, s", "obstacles", [2, 20], [[1.0, 1.1], [2.0, 2.1]])
    memory = {"trials": [3, 30], "megabytes": [200.0, 201.0], "growth": 1.0, "aim": "at most 5"}
    rates = {"1": spread([7.0]), "2": spread([14.0])}
    found = {
        "predict": {"seconds": {"drake_shared": spread([1e-4])}, "absent": {"torch.compile": "no compiler"}},
        "trial": {},
        "training": {
            "traces": [Trace(name="it", seconds=[1.0, 2.0], errors=[0.2, 0.1])],
            "details": {"target": 0.1},
        },
        "batch": {"details": {"memory": memory, "trials_per_second": rates}},
        "lockstep": {},
        "together": {},
        "many": {},
        "growth": {"curves": [curve]},
        "safety": {},
        "arbiters": {},
    }
    ratio = Ratio(name="this / that", spread=spread([1.0, 2.0, 3.0]), aim="at most 2", bound="at most")
    results = {
        name: GroupResult(name=name, method="none", ratios=[] if name == "growth" else [ratio], **options)
        for name, options in found.items()
    }
    monkeypatch.setattr(groups, "run_group", lambda name, setup: results[name])


def test_json_is_one_object_and_the_same_in_the_file(every_group, tmp_path, capsys):
    assert main(["benchmark", "--quick", "--json", "--out", str(tmp_path / "found")]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["format"] == "drake_shared.benchmark"
    assert list(printed["groups"]) == list(groups.GROUPS)
    spread = printed["groups"]["trial"]["ratios"][0]["spread"]
    assert spread == {"median": 2.0, "low": 1.2, "high": pytest.approx(2.8), "count": 3}
    assert printed["machine"]["cores"] >= 1
    assert printed["versions"]["drake"]
    assert json.loads((tmp_path / "found" / "benchmark.json").read_text()) == printed
    assert (tmp_path / "found" / "benchmark.png").read_bytes().startswith(b"\x89PNG")


def test_table_has_results_aims_and_absent_contenders(every_group, setup):
    lines = "\n".join(describe(groups.run_benchmark(setup)))
    for expected in (
        "this / that",
        "≤2",
        "at most 2",
        "0.29",
        "14",
        "1.00 MB",
        "torch.compile",
        "no compiler",
    ):
        assert expected in lines


def test_figure_has_two_panels_for_each_group(every_group, setup):
    report = groups.run_benchmark(setup, ["growth", "trial"])
    assert list(report.groups) == ["trial", "growth"]
    assert len(draw(report).axes) == 4


def test_one_group_is_measured(trained, tmp_path, capsys):
    arguments = ["benchmark", "--quick", "--only", "predict", "--repeats", "1", "--out", str(tmp_path)]
    assert main(arguments) == 0
    output = capsys.readouterr()
    assert "drake_shared / bare products, 301 queries" in output.out
    assert "predict" in output.err
    written = json.loads((tmp_path / "benchmark.json").read_text())
    assert list(written["groups"]) == ["predict"]
    assert written["repeats"] == 1


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--only", "nothing"], "only"),
        (["--repeats", "0"], "repeats"),
        (["--demos", "a.parquet"], "--test-demos"),
        (["--demos", "a.parquet", "--test-demos", "b.parquet"], "a.parquet"),
    ],
)
def test_invalid_input_is_named_in_one_line(arguments, named, capsys):
    assert main(["benchmark", *arguments]) == 2
    output = capsys.readouterr()
    assert named in output.err
    assert output.err.count("\n") == 1
    assert output.out == ""


def test_an_output_folder_that_cannot_be_written_is_refused_before_measuring(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["benchmark", "--out", str(tmp_path / "file" / "out")]) == 2
    assert str(tmp_path) in capsys.readouterr().err
