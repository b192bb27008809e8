"""Many trials: the same rows whatever the number of workers, and the logs that were asked for."""

import dataclasses

import pytest

from drake_shared.analysis.batch import Batch, run_batch
from drake_shared.analysis.metrics import metrics
from drake_shared.common.errors import InputError
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import read_log, write_log

ALONE = Batch(config=SharedControlConfig(driver="human"), count=4, seed=7)


@pytest.fixture(scope="module")
def rows() -> list[dict]:
    return list(run_batch(ALONE))


def plain(rows) -> str:
    """Every bit of the rows but where their logs are; NaN as text is equal to itself."""
    return repr([{name: value for name, value in row.items() if name != "log"} for row in rows])


def test_the_number_of_workers_changes_nothing(rows, tmp_path):
    batch = dataclasses.replace(ALONE, out=str(tmp_path))
    assert plain(run_batch(batch, workers=2)) == plain(rows)
    assert plain([read_row(tmp_path, index) for index in range(4)]) == plain(rows)


def read_row(folder, index: int) -> dict:
    trial = read_log(folder / f"trial_{index:05d}.parquet")
    return {"seed": trial.metadata["seed"], "route": trial.metadata["route"], **metrics(trial), "log": None}


def test_routes_take_turns_and_each_trial_has_the_next_seed(rows):
    assert [row["route"] for row in rows] == ["left_right", "right_left", "left_left", "left_right"]
    assert [row["seed"] for row in rows] == [7, 8, 9, 10]
    assert len({row["human_effort"] for row in rows}) == 4


def test_a_trial_does_not_depend_on_those_before_it(rows):
    (last,) = run_batch(dataclasses.replace(ALONE, seed=10, count=1))
    assert plain([last]) == plain([rows[3]])


def test_without_a_folder_no_log_is_kept(rows):
    assert all(row["log"] is None for row in rows)


def test_each_row_names_its_log(tmp_path):
    (row,) = run_batch(
        Batch(config=SharedControlConfig(driver="human"), out=str(tmp_path / "new" / "folder"))
    )
    assert row["log"] == str(tmp_path / "new" / "folder" / "trial_00000.parquet")
    assert read_log(row["log"]).metadata["seed"] == row["seed"]


def test_a_log_is_played_back(human_trial, tmp_path):
    write_log(human_trial, tmp_path / "log.parquet")
    (row,) = run_batch(
        Batch(
            config=SharedControlConfig(driver="human"),
            recording=str(tmp_path / "log.parquet"),
            out=str(tmp_path),
        )
    )
    assert row["route"] == "left_right"
    assert row["human_effort"] == metrics(human_trial)["human_effort"]
    assert (read_log(row["log"]).positions == human_trial.positions).all()


def test_the_end_is_a_setting():
    reached, lasting = (
        next(iter(run_batch(Batch(config=SharedControlConfig(driver="human", end=end)))))
        for end in ("reached", "duration")
    )
    assert lasting["completion_time"] == reached["completion_time"]
    assert lasting["path_length"] > reached["path_length"]


@pytest.mark.parametrize(
    ("batch", "said"),
    [
        ({"scenario": "four_obstacles"}, "four_obstacles must be a scenario file"),
        ({"model": "none.safetensors"}, r"none\.safetensors must be a file"),
        ({"recording": "none.parquet"}, r"none\.parquet must be a log"),
        ({"out": "/proc/logs"}, "/proc/logs must be a folder to write to"),
    ],
)
def test_bad_input_is_said_in_one_line(batch, said):
    with pytest.raises(InputError, match=said) as caught:
        list(run_batch(Batch(**{"config": SharedControlConfig(driver="human"), "count": 2} | batch)))
    assert "\n" not in str(caught.value)


def test_bad_input_found_by_a_worker_is_said_alike():
    with pytest.raises(InputError, match=r"^none\.parquet must be a log; there is no such file$"):
        list(
            run_batch(
                Batch(config=SharedControlConfig(driver="human"), count=2, recording="none.parquet"),
                workers=2,
            )
        )


def test_numbers_below_1_are_refused():
    with pytest.raises(InputError, match="trials must be at least 1, got 0"):
        Batch(count=0)
    with pytest.raises(InputError, match="workers must be at least 1, got 0"):
        list(run_batch(ALONE, workers=0))
