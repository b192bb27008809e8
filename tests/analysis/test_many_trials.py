"""One log of many trials is read like any log, and their metrics are those of each alone."""

import json
import os
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from drake_shared.analysis.batch import Batch, run_batch
from drake_shared.analysis.metrics import metrics, metrics_of
from drake_shared.cli.main import main
from drake_shared.common.errors import InputError
from drake_shared.common.memory import available_memory
from drake_shared.demonstrations import read_demonstrations
from drake_shared.simulation.log import read_log, read_logs, write_logs

MODEL = str(Path(__file__).parents[2] / "models" / "learners" / "two_obstacles_default.safetensors")
COUNT = 5


def run(out: Path, **changes) -> list[dict]:
    options = {name: changes.pop(name) for name in ("resume", "force", "workers") if name in changes}
    return list(run_batch(Batch(model=MODEL, count=COUNT, out=str(out), **changes), **options))


def measured(rows) -> list[str]:
    return [json.dumps({k: v for k, v in row.items() if k != "log"}) for row in rows]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("logs")


@pytest.fixture(scope="module")
def alone(folder) -> list[dict]:
    """Rows of trials with a log each."""
    return run(folder / "alone")


@pytest.fixture(scope="module")
def together(folder) -> list[dict]:
    """Rows of the same trials, three in a log."""
    return run(folder / "together", trials_per_log=3)


def test_trials_and_metrics_do_not_depend_on_how_they_are_logged(alone, together):
    assert measured(together) == measured(alone)
    for one, other in zip(alone, together, strict=True):
        first, second = read_log(one["log"]), read_log(other["log"])
        assert first.metadata == second.metadata
        assert list(first.columns) == list(second.columns)
        for name in first.columns:
            np.testing.assert_array_equal(first[name], second[name])
            assert first[name].dtype == second[name].dtype


def test_a_log_holds_consecutive_trials_by_number(together):
    files = sorted({Path(row["log"].partition("#")[0]) for row in together})
    assert [list(read_logs(file)) for file in files] == [[0, 1, 2], [3, 4]]
    assert pq.read_table(files[0])["trial"].to_pylist()[0] == 0


def test_a_trial_of_several_must_be_named(together):
    file = together[0]["log"].partition("#")[0]
    for path in (file, f"{file}#3"):
        with pytest.raises(InputError) as caught:
            read_log(path)
        assert caught.value.source in (file, path)
    with pytest.raises(InputError):
        read_log(f"{MODEL}#1")


def test_a_file_of_one_trial_has_no_number(alone):
    assert list(read_logs(alone[2]["log"])) == [0]
    with pytest.raises(InputError):
        read_log(alone[2]["log"] + "#0")


@pytest.mark.parametrize(
    "change",
    [
        lambda metadata: metadata | {"trials": {**metadata["trials"], "7": {}}},
        lambda metadata: metadata | {"trials": None},
        lambda metadata: metadata | {"version": 3},
    ],
)
def test_numbers_in_column_and_metadata_must_be_the_same(together, tmp_path, change):
    table = pq.read_table(together[0]["log"].partition("#")[0])
    metadata = change(json.loads(table.schema.metadata[b"drake_shared"]))
    damaged = tmp_path / "damaged.parquet"
    pq.write_table(table.replace_schema_metadata({b"drake_shared": json.dumps(metadata)}), damaged)
    for read in (read_logs, read_demonstrations):
        with pytest.raises(InputError):
            read(damaged)


def test_an_interrupted_batch_is_resumed(together, tmp_path):
    run(tmp_path, trials_per_log=3)
    (tmp_path / "trials_00000-00002.parquet").unlink()
    assert measured(run(tmp_path, trials_per_log=3, resume=True)) == measured(together)
    whole = (tmp_path / "trials_00003-00004.parquet").read_bytes()
    (tmp_path / "trials_00003-00004.parquet").write_bytes(whole[: len(whole) // 2])
    # Of trials that are logged alone none is in the way of the others.
    assert measured(run(tmp_path, trials_per_log=2, resume=True)) == measured(together)
    run(tmp_path, force=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"trial_{i:05d}.parquet" for i in range(COUNT)
    ]


def test_drake_and_several_workers_write_the_same_logs(together, tmp_path):
    rows = run(tmp_path, trials_per_log=3, engine="drake", workers=2)
    assert [Path(row["log"]).name for row in rows] == [Path(row["log"]).name for row in together]
    assert [row["success"] for row in rows] == [row["success"] for row in together]


def test_the_trials_of_a_log_are_demonstrations(alone, together):
    chosen = [index for index, row in enumerate(alone) if row["success"]]
    assert chosen
    for index in chosen:
        (one,) = read_demonstrations(alone[index]["log"])
        (other,) = read_demonstrations(together[index]["log"])
        np.testing.assert_array_equal(one.positions, other.positions)
        assert one.provenance["seed"] == other.provenance["seed"] == index


def test_commands_that_read_logs_take_a_trial_of_several(together, tmp_path, capsys):
    log = together[1]["log"]
    page = tmp_path / "trial.html"
    assert main(["replay", log, "--out", str(page)]) == 0
    assert page.stat().st_size > 10_000
    assert main(["simulate", "--operator", log, "--mode", "human", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["trials"][0]["human_effort"] > 0.0


def test_metrics_of_many_trials_are_those_of_each_alone(alone):
    trials = [read_log(row["log"]) for row in alone]
    for many, trial in zip(metrics_of(trials), trials, strict=True):
        assert {k: v for k, v in many.items() if v == v} == {
            k: v for k, v in metrics(trial).items() if v == v
        }
    assert metrics_of([]) == []


def test_trials_of_different_lengths_do_not_affect_each_other(alone):
    trial = read_log(alone[0]["log"])
    short = type(trial)(columns={k: v[:40] for k, v in trial.columns.items()}, metadata=trial.metadata)
    for many, one in zip(metrics_of([short, trial]), (short, trial), strict=True):
        for name, value in metrics(one).items():
            if not isinstance(value, float):
                assert many[name] == value
            else:  # The order of a sum depends on the length of its array.
                assert many[name] == pytest.approx(value, rel=1e-12, nan_ok=True)


def test_a_log_of_no_trials_and_too_many_in_one_are_refused(tmp_path):
    with pytest.raises(InputError) as caught:
        Batch(trials_per_log=0)
    assert caught.value.field == "trials_per_log"
    with pytest.raises(InputError):
        write_logs({}, tmp_path / "none.parquet")


def test_too_little_memory_is_said_before_any_trial_is_run(monkeypatch, tmp_path, capsys):
    out = tmp_path / "logs"
    monkeypatch.setattr("drake_shared.analysis.batch.available_memory", lambda: 1_000_000)
    assert main(["simulate", "--trials", "1000", "--engine", "lockstep", "--out", str(out)]) == 2
    assert "MB" in capsys.readouterr().err
    assert not out.exists()
    with pytest.raises(InputError) as caught:
        run_batch(Batch(model=MODEL, count=1_000), workers=2)
    assert caught.value.field == "trials"
    list(run_batch(Batch(model=MODEL, count=1, engine="drake")))


def test_available_memory_is_below_that_of_the_machine():
    available = available_memory()
    assert available is None or 0 < available < os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
