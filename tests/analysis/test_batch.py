"""A batch gives the same rows whatever the number of workers, and writes the requested logs."""

import dataclasses

import pytest

from drake_shared.analysis.batch import Batch, run_batch
from drake_shared.analysis.metrics import metrics
from drake_shared.common.errors import InputError
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import read_log, write_log

HUMAN = SharedControlConfig(driver="human")
ALONE = Batch(config=HUMAN, count=4, seed=7)


@pytest.fixture(scope="module")
def rows() -> list[dict]:
    return list(run_batch(ALONE))


def plain(rows) -> str:
    """All values of the rows except the paths of logs, as text, in which NaN equals itself."""
    return repr([{name: value for name, value in row.items() if name != "log"} for row in rows])


def test_the_number_of_workers_changes_nothing(rows, tmp_path):
    batch = dataclasses.replace(ALONE, out=str(tmp_path))
    assert plain(run_batch(batch, workers=2)) == plain(rows)
    assert plain([read_row(tmp_path, index) for index in range(4)]) == plain(rows)


def read_row(folder, index: int) -> dict:
    trial = read_log(folder / f"trial_{index:05d}.parquet")
    return {"seed": trial.metadata["seed"], "route": trial.metadata["route"], **metrics(trial), "log": None}


def test_trials_alternate_routes_and_count_seeds(rows):
    assert [row["route"] for row in rows] == ["left_right", "right_left", "left_left", "left_right"]
    assert [row["seed"] for row in rows] == [7, 8, 9, 10]
    assert len({row["human_effort"] for row in rows}) == 4


def test_a_trial_does_not_depend_on_earlier_trials(rows):
    (last,) = run_batch(dataclasses.replace(ALONE, seed=10, count=1))
    assert plain([last]) == plain([rows[3]])


def test_without_a_folder_no_log_is_written(rows):
    assert all(row["log"] is None for row in rows)


def test_each_row_names_its_log(tmp_path):
    (row,) = run_batch(Batch(config=HUMAN, out=str(tmp_path / "new" / "folder")))
    assert row["log"] == str(tmp_path / "new" / "folder" / "trial_00000.parquet")
    assert read_log(row["log"]).metadata["seed"] == row["seed"]


def test_a_log_is_played_back(human_trial, tmp_path):
    write_log(human_trial, tmp_path / "log.parquet")
    (row,) = run_batch(Batch(config=HUMAN, recording=str(tmp_path / "log.parquet"), out=str(tmp_path)))
    assert row["route"] == "left_right"
    assert row["human_effort"] == metrics(human_trial)["human_effort"]
    assert (read_log(row["log"]).positions == human_trial.positions).all()


def test_a_trial_can_last_beyond_the_goal():
    reached, lasting = (
        next(iter(run_batch(Batch(config=dataclasses.replace(HUMAN, end=end)))))
        for end in ("reached", "duration")
    )
    assert lasting["completion_time"] == reached["completion_time"]
    assert lasting["path_length"] > reached["path_length"]


@pytest.mark.parametrize(
    ("batch", "named"),
    [
        ({"scenario": "four_obstacles"}, "four_obstacles"),
        ({"model": "none.safetensors"}, r"none\.safetensors"),
        ({"recording": "none.parquet"}, r"none\.parquet"),
        ({"out": "/proc/logs"}, "/proc/logs"),
    ],
)
def test_bad_input_is_reported_in_one_line(batch, named):
    with pytest.raises(InputError, match=named) as caught:
        list(run_batch(Batch(**{"config": HUMAN, "count": 2} | batch)))
    assert "\n" not in str(caught.value)


def test_bad_input_in_a_worker_is_reported_as_in_this_process():
    with pytest.raises(InputError, match=r"^none\.parquet"):
        list(run_batch(Batch(config=HUMAN, count=2, recording="none.parquet"), workers=2))


def test_numbers_below_1_are_bad_input():
    with pytest.raises(InputError, match=r"trials .* 0$"):
        Batch(count=0)
    with pytest.raises(InputError, match=r"workers .* 0$"):
        list(run_batch(ALONE, workers=0))
