"""Demonstrations: files, invalid input, sampling weights and scores."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from drake_shared.common.errors import InputError
from drake_shared.common.files import sha256_of
from drake_shared.demonstrations import (
    Demonstration,
    Demonstrations,
    check_units,
    demonstration_weights,
    load_scorer,
    read_demonstrations,
    sampling_weights,
    score_demonstrations,
    write_demonstrations,
)


def straight(count: int = 4, **options) -> Demonstration:
    times = np.linspace(0.0, 1.5, count)
    return Demonstration(times=times, positions=np.stack([times, 0.1 * times], axis=-1), **options)


def columns(count: int = 4) -> dict[str, np.ndarray]:
    times = np.linspace(0.0, 1.5, count)
    return {"demonstration": np.zeros(count, np.int64), "t": times, "x": times.copy(), "y": 0.1 * times}


def write(path, data, **metadata) -> str:
    table = pa.table(data)
    if metadata:
        table = table.replace_schema_metadata({b"drake_shared": json.dumps(metadata).encode()})
    pq.write_table(table, path)
    return str(path)


def write_log(path, *, status: str = "reached", contact: bool = False, **metadata) -> str:
    data = columns()
    del data["demonstration"]
    data["yaw"] = np.zeros(4)
    data["contact"] = np.array([False, False, contact, False])
    described = {"format": "drake_shared.log", "version": 1, "status": status, **metadata}
    return write(path, data, **described)


def test_write_then_read_returns_the_demonstrations(tmp_path):
    items = (
        straight(score=0.2, yaws=np.zeros(4), provenance={"seed": 3}),
        straight(7, score=-1.0, yaws=np.ones(7)),
    )
    written = Demonstrations(items=items, metadata={"scenario": "two_obstacles"})
    write_demonstrations(tmp_path / "demos.parquet", written)
    read = read_demonstrations(tmp_path / "demos.parquet")
    assert read.scenario == "two_obstacles"
    np.testing.assert_array_equal(read.scores, [0.2, -1.0])
    held = {"kind": "demonstrations", "file": str(tmp_path / "demos.parquet")}
    assert read[0].provenance == {"seed": 3, **held, "sha256": sha256_of(tmp_path / "demos.parquet")}
    for before, after in zip(written, read, strict=True):
        np.testing.assert_array_equal(before.times, after.times)
        np.testing.assert_array_equal(before.positions, after.positions)
        np.testing.assert_array_equal(before.yaws, after.yaws)


def test_metadata_are_optional(tmp_path):
    read = read_demonstrations(write(tmp_path / "bare.parquet", columns()))
    assert len(read) == 1
    assert read.scores is None
    assert read.scenario is None
    assert read[0].yaws is None


def test_demonstrations_of_one_file_may_be_interleaved_and_of_any_id(tmp_path):
    data = {
        "demonstration": np.array([7, 3, 7, 3]),
        "t": np.array([0.0, 0.0, 1.0, 2.0]),
        "x": np.array([1.0, 5.0, 2.0, 6.0]),
        "y": np.zeros(4),
    }
    read = read_demonstrations(write(tmp_path / "mixed.parquet", data))
    np.testing.assert_array_equal([item.positions[:, 0] for item in read], [[5.0, 6.0], [1.0, 2.0]])


def test_files_follow_one_another_and_logs_are_demonstrations(tmp_path):
    paths = [
        write(tmp_path / "a.parquet", columns()),
        write_log(tmp_path / "log.parquet", scenario={"name": "two_obstacles"}, seed=4),
    ]
    read = read_demonstrations(paths)
    assert len(read) == 2
    assert read.scenario == "two_obstacles"
    assert read[1].provenance["seed"] == 4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"status": "timeout"}, r'status must be "reached".*got \'timeout\''),
        ({"contact": True}, "contact must be false throughout.*got contact at 1 s"),
        ({"version": 3}, "version must be at most 2.*got 3"),
    ],
)
def test_logs_qualify_if_the_goal_was_reached_without_contact(tmp_path, options, message):
    with pytest.raises(InputError, match=message):
        read_demonstrations(write_log(tmp_path / "log.parquet", **options))


def test_a_log_of_one_row_is_refused(tmp_path):
    row = {"t": [0.0], "x": [0.0], "y": [0.0], "yaw": [0.0], "contact": [False], "human_weight": [1.0]}
    path = write(tmp_path / "log.parquet", row, format="drake_shared.log", version=1, status="reached")
    with pytest.raises(InputError) as caught:
        read_demonstrations(path)
    assert (caught.value.source, caught.value.field) == (path, "t")


def test_logs_of_failed_trials_can_be_left_out(tmp_path):
    for index, options in enumerate(({"status": "timeout"}, {}, {"contact": True})):
        write_log(tmp_path / f"{index}.parquet", **options)
    failed = []
    read = read_demonstrations(tmp_path, failed=failed)
    assert [item.provenance["file"] for item in read] == [str(tmp_path / "1.parquet")]
    assert [error.field for error in failed] == ["status", "contact"]
    with pytest.raises(InputError) as caught:
        read_demonstrations(tmp_path / "0.parquet", failed=[])
    assert caught.value.field == "status"


def test_a_folder_stands_for_the_parquet_files_in_it(tmp_path):
    for name in ("b", "a"):
        write(tmp_path / f"{name}.parquet", columns())
    (tmp_path / "notes.txt").write_text("none")
    read = read_demonstrations(tmp_path)
    assert [item.provenance["file"] for item in read] == [str(tmp_path / f"{name}.parquet") for name in "ab"]
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError) as caught:
        read_demonstrations(tmp_path / "empty")
    assert caught.value.source == str(tmp_path / "empty")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"y": None}, "y must be among the columns"),
        ({"demonstration": None}, "demonstration must be among the columns"),
        ({"x": np.array([0.0, np.nan, 1.0, 2.0])}, "x must be finite, got nan at point 1"),
        ({"y": np.array([0.0, np.inf, 1.0, 2.0])}, "y must be finite, got inf"),
        ({"t": np.array([0.0, 1.0, 1.0, 2.0])}, "t must increase, got 1 then 1 at point 2"),
        ({"t": np.array([0.0, np.nan, 1.0, 2.0])}, "t must be finite"),
        ({"x": np.array(["a", "b", "c", "d"])}, "x must hold numbers, got"),
        ({"x": np.array([True, False, True, True])}, "x must hold numbers, got"),
        ({"demonstration": np.array([0.0, 0.0, 0.5, 0.5])}, "demonstration must be a whole number"),
        ({"demonstration": np.array([0, 1, 1, 1])}, "demonstration 0: t must hold at least 2 points"),
    ],
)
def test_invalid_columns_are_refused_by_file_and_field(tmp_path, change, message):
    data = {name: value for name, value in {**columns(), **change}.items() if value is not None}
    path = write(tmp_path / "bad.parquet", data)
    with pytest.raises(InputError, match=message) as error:
        read_demonstrations(path)
    assert str(error.value).startswith(path)
    assert "\n" not in str(error.value)


def test_missing_empty_and_foreign_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="must be a file that exists"):
        read_demonstrations(tmp_path / "none.parquet")
    (tmp_path / "text.parquet").write_text("t,x,y\n")
    with pytest.raises(InputError, match="must be a whole Parquet file"):
        read_demonstrations(tmp_path / "text.parquet")
    whole = write(tmp_path / "whole.parquet", columns())
    with open(whole, "rb") as file:
        (tmp_path / "cut.parquet").write_bytes(file.read()[:-40])
    with pytest.raises(InputError, match="must be a whole Parquet file"):
        read_demonstrations(tmp_path / "cut.parquet")
    empty = write(tmp_path / "empty.parquet", {name: values[:0] for name, values in columns().items()})
    with pytest.raises(InputError, match="must hold at least one demonstration"):
        read_demonstrations(empty)
    with pytest.raises(InputError, match="needs at least one file"):
        read_demonstrations([])


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        ({"format": "drake_shared.demonstrations", "version": 2}, "version must be at most 1"),
        ({"format": "drake_shared.demonstrations", "version": "1"}, "version must be at most 1"),
        (
            {"format": "something"},
            "format must be drake_shared.demonstrations or drake_shared.log",
        ),
        ({"format": "drake_shared.demonstrations", "version": 1, "scores": [1, 2]}, "scores must have one"),
        ({"format": "drake_shared.demonstrations", "version": 1, "scores": ["a"]}, "scores must be"),
        ({"format": "drake_shared.demonstrations", "version": 1, "scores": [10**350]}, "scores must be"),
        ({"format": "drake_shared.demonstrations", "version": 1, "scores": [float("inf")]}, "scores must be"),
    ],
)
def test_metadata_must_fit(tmp_path, metadata, message):
    with pytest.raises(InputError, match=message):
        read_demonstrations(write(tmp_path / "bad.parquet", columns(), **metadata))


def test_metadata_that_are_not_json_are_refused(tmp_path):
    table = pa.table(columns()).replace_schema_metadata({b"drake_shared": b"{"})
    pq.write_table(table, tmp_path / "bad.parquet")
    with pytest.raises(InputError, match="metadata must be a JSON object"):
        read_demonstrations(tmp_path / "bad.parquet")


def test_another_scenario_is_refused(tmp_path):
    for name in ("doorway", "two_obstacles"):
        demonstrations = Demonstrations(items=(straight(),), metadata={"scenario": name})
        write_demonstrations(tmp_path / f"{name}.parquet", demonstrations)
    read_demonstrations(tmp_path / "doorway.parquet", scenario="doorway")
    with pytest.raises(InputError, match="scenario must be 'two_obstacles', got 'doorway'"):
        read_demonstrations(tmp_path / "doorway.parquet", scenario="two_obstacles")
    with pytest.raises(InputError, match="scenario must be 'doorway', got 'two_obstacles'"):
        read_demonstrations([tmp_path / "doorway.parquet", tmp_path / "two_obstacles.parquet"])


def test_a_column_of_scores_is_constant_within_a_demonstration(tmp_path):
    data = {**columns(), "quality": np.full(4, 0.3)}
    read = read_demonstrations(write(tmp_path / "a.parquet", data), score_column="quality")
    np.testing.assert_array_equal(read.scores, [0.3])
    data["quality"][2] = 0.4
    with pytest.raises(InputError, match="quality must be one finite number throughout demonstration 0"):
        read_demonstrations(write(tmp_path / "b.parquet", data), score_column="quality")
    with pytest.raises(InputError, match="other must be among the columns"):
        read_demonstrations(write(tmp_path / "c.parquet", data), score_column="other")


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "demos.parquet"
    write_demonstrations(path, Demonstrations(items=(straight(),)))
    unwritable = Demonstrations(items=(straight(),), metadata={"what": object()})
    with pytest.raises(TypeError):
        write_demonstrations(path, unwritable)
    assert len(read_demonstrations(path)) == 1
    assert [file.name for file in tmp_path.iterdir()] == ["demos.parquet"]


def test_demonstrations_cannot_be_changed_from_outside():
    times = np.array([0.0, 1.0])
    demonstration = Demonstration(times=times, positions=np.zeros((2, 2)))
    times[0] = 5.0
    assert demonstration.times[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        demonstration.positions[0] = 1.0


def test_weights_are_a_normal_density_centred_on_the_best_score():
    weights = sampling_weights([0.1, 0.3, 0.2], width=0.1)
    density = [np.exp(-0.5 * ((score - 0.3) / 0.1) ** 2) for score in (0.1, 0.3, 0.2)]
    np.testing.assert_allclose(weights, np.array(density) / sum(density))


def test_the_default_width_is_twice_the_standard_deviation_and_at_least_five_centimetres():
    scores = np.array([-3.0, 0.0, 1.0])
    expected = np.exp(-0.5 * ((scores - 1.0) / (2.0 * np.sqrt(np.mean((scores + 2 / 3) ** 2)))) ** 2)
    np.testing.assert_allclose(sampling_weights(scores), expected / expected.sum())
    np.testing.assert_allclose(sampling_weights([0.10, 0.11]), sampling_weights([0.10, 0.11], width=0.05))


def test_equal_scores_give_equal_weights():
    np.testing.assert_allclose(sampling_weights([-1e6] * 4), 0.25)
    np.testing.assert_allclose(sampling_weights([7.0]), 1.0)


@pytest.mark.parametrize("scores", [[0.1, np.nan], [np.inf, 0.0], [], [[0.1]]])
def test_invalid_scores_are_refused(scores):
    with pytest.raises(InputError, match="must be"):
        sampling_weights(scores)


@pytest.mark.parametrize("width", [0.0, -1.0, np.nan, np.inf])
def test_invalid_widths_are_refused(width):
    with pytest.raises(InputError, match="width must be positive"):
        sampling_weights([0.1, 0.2], width=width)


def test_a_scorer_gives_each_demonstration_its_score():
    demonstrations = Demonstrations(items=(straight(3), straight(5)))
    assert demonstrations.scores is None
    np.testing.assert_array_equal(score_demonstrations(demonstrations, len).scores, [3.0, 5.0])
    with pytest.raises(InputError, match="score of demonstration 0 must be finite, got nan"):
        score_demonstrations(demonstrations, lambda positions: np.nan)
    with pytest.raises(InputError, match="score of demonstration 0 must be finite"):
        score_demonstrations(demonstrations, lambda positions: None)


def test_a_scorer_is_found_by_module_and_function():
    assert load_scorer("numpy:sum") is np.sum
    for name in ("numpy", "numpy:", "no_such_module:f", "numpy:no_such_function"):
        with pytest.raises(InputError, match=r'must be "module:function"|can be imported'):
            load_scorer(name)
    with pytest.raises(InputError, match="must be callable"):
        load_scorer("numpy:pi")


def task(scale: float, size: int = 2) -> Demonstrations:
    """Two demonstrations 5 m long, scored by a clearance in [m], times ``scale``."""
    times = np.linspace(0.0, 1.0, 5)
    line = scale * 5.0 * times[:, None] * np.ones(size)
    items = [Demonstration(times=times, positions=line, score=scale * score) for score in (0.30, 0.31)]
    return Demonstrations(items=tuple(items))


@pytest.mark.parametrize("scale", [0.1, 0.3, 2.0, 10.0])
def test_a_task_of_another_size_has_the_same_weights(scale):
    np.testing.assert_allclose(demonstration_weights(task(scale)), demonstration_weights(task(1.0)))
    np.testing.assert_allclose(demonstration_weights(task(1.0)), sampling_weights([0.30, 0.31]))
    np.testing.assert_allclose(demonstration_weights(task(1.0), weighted=False), 0.5)


@pytest.mark.parametrize("size", [1, 2, 3, 4, 7])
def test_positions_of_any_size_are_read_back_under_their_names(tmp_path, size):
    written = task(1.0, size)
    write_demonstrations(tmp_path / "demos.parquet", written)
    read = read_demonstrations(tmp_path / "demos.parquet")
    assert read.position_names == written.position_names
    assert read.position_names[:2] == (("x", "y")[:size] if size <= 3 else ("p0", "p1"))
    np.testing.assert_array_equal(read[1].positions, written[1].positions)


def test_names_of_coordinates_are_columns(tmp_path):
    item = Demonstration(
        times=[0.0, 1.0], positions=[[1.0, 2.0], [3.0, 4.0]], position_names=("lift", "reach")
    )
    write_demonstrations(tmp_path / "arm.parquet", Demonstrations(items=(item,)))
    assert {"lift", "reach"} < set(pq.read_table(tmp_path / "arm.parquet").column_names)
    assert read_demonstrations(tmp_path / "arm.parquet").position_names == ("lift", "reach")
    with pytest.raises(InputError, match="position_names"):
        Demonstration(times=[0.0, 1.0], positions=np.zeros((2, 2)), position_names=("x", "x"))


def test_a_log_has_the_coordinates_of_its_robot(tmp_path):
    path = write_log(tmp_path / "log.parquet", robot={"position_names": ["y", "t"]})
    (item,) = read_demonstrations(path)
    assert item.position_names == ("y", "t")
    np.testing.assert_array_equal(item.positions[:, 1], item.times)


def test_a_file_without_metadata_may_have_a_z(tmp_path):
    read = read_demonstrations(write(tmp_path / "bare.parquet", {**columns(), "z": np.arange(4.0)}))
    assert read.position_names == ("x", "y", "z")
    np.testing.assert_array_equal(read[0].positions[:, 2], np.arange(4.0))


def test_demonstrations_of_different_coordinates_are_refused(tmp_path):
    with pytest.raises(InputError, match="coordinates"):
        Demonstrations(items=(task(1.0, 2)[0], task(1.0, 3)[0]))


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
@pytest.mark.parametrize("pace", [0.5, 3.0])
def test_times_in_another_unit_than_seconds_are_refused(unit, factor, pace):
    times = pace * np.linspace(0.0, 9.0, 5)
    positions = np.linspace([0.0, 0.0], [4.0, 1.0], 5)
    item = Demonstration(times=times, positions=positions)
    check_units(Demonstrations(items=(item,)), duration=9.0, extent=5.0)
    wrong = Demonstration(times=factor * times, positions=positions)
    with pytest.raises(InputError, match=rf"in {unit}\b") as caught:
        check_units(Demonstrations(items=(item, wrong)), duration=9.0, extent=5.0)
    assert caught.value.field == "t"


@pytest.mark.parametrize(("unit", "factor"), [("cm", 1e2), ("mm", 1e3)])
def test_positions_in_another_unit_than_metres_are_refused(unit, factor):
    times = np.linspace(0.0, 9.0, 5)
    positions = factor * np.linspace([0.0, 0.0], [4.0, 1.0], 5)
    wrong = Demonstrations(items=(Demonstration(times=times, positions=positions),))
    with pytest.raises(InputError, match=rf"in {unit}\b") as caught:
        check_units(wrong, duration=9.0, extent=5.0)
    assert caught.value.field == "x, y"
