"""Files of learners: the same bits are read back, and what is invalid is named in one line."""

import json

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import save_file

from drake_shared.common.errors import InputError
from drake_shared.learners import load_learner, save_learner


@pytest.fixture
def parts(learner, tmp_path):
    """Tensors and description of a good file, to be spoilt."""
    save_learner(learner, tmp_path / "good.safetensors")
    with safe_open(tmp_path / "good.safetensors", framework="numpy") as file:
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        return tensors, json.loads(file.metadata()["drake_shared"])


def write(path, tensors, description) -> str:
    save_file(tensors, path, metadata={"drake_shared": json.dumps(description)})
    return str(path)


@pytest.mark.parametrize("preset", ["learner", "paper_learner"])
def test_a_learner_read_back_predicts_the_same_bits(request, tmp_path, preset):
    written = request.getfixturevalue(preset)
    save_learner(written, tmp_path / "learner.safetensors")
    read = load_learner(tmp_path / "learner.safetensors")
    for count in (0, 1, 3):
        times, positions = written.grid[5 : 5 + count], written.demonstrations[1, 5 : 5 + count]
        for before, after in zip(
            written.predict(times, positions, written.grid),
            read.predict(times, positions, read.grid),
            strict=True,
        ):
            np.testing.assert_array_equal(before, after)
    assert read.confidence_gain == written.confidence_gain
    assert (read.name, read.preset, read.duration) == (written.name, written.preset, written.duration)
    np.testing.assert_array_equal(read.demonstrations, written.demonstrations)
    for name in ("scenario", "clock", "evidence", "training"):
        assert read.metadata[name] == written.metadata[name]


def test_a_learner_read_back_writes_the_same_file(learner, tmp_path):
    save_learner(learner, tmp_path / "one.safetensors")
    save_learner(load_learner(tmp_path / "one.safetensors"), tmp_path / "two.safetensors")
    assert (tmp_path / "one.safetensors").read_bytes() == (tmp_path / "two.safetensors").read_bytes()


def test_missing_foreign_and_truncated_files_are_refused(learner, tmp_path):
    with pytest.raises(InputError, match="must be a file that exists"):
        load_learner(tmp_path / "none.safetensors")
    (tmp_path / "text.safetensors").write_text("no learner at all, but long enough to be one")
    with pytest.raises(InputError, match="must be a whole safetensors file"):
        load_learner(tmp_path / "text.safetensors")
    save_learner(learner, tmp_path / "whole.safetensors")
    whole = (tmp_path / "whole.safetensors").read_bytes()
    for size in (0, 7, 300, len(whole) // 2, len(whole) - 1):
        (tmp_path / "cut.safetensors").write_bytes(whole[:size])
        with pytest.raises(InputError, match="must be a whole safetensors file") as error:
            load_learner(tmp_path / "cut.safetensors")
        assert "\n" not in str(error.value)
    save_file({"weight": np.zeros(3)}, tmp_path / "other.safetensors")
    with pytest.raises(InputError, match="not a learner of drake_shared"):
        load_learner(tmp_path / "other.safetensors")


def assert_refused(path: str, field: str) -> None:
    with pytest.raises(InputError) as error:
        load_learner(path)
    assert (error.value.source, error.value.field) == (path, field)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("version", 2),
        ("version", 0),
        ("version", None),
        ("learner", "oracle"),
        ("format", "something"),
        ("confidence_gain", -1.0),
        ("scale", float("nan")),
        ("scale", 0.0),
        ("doubt_gain", -1.0),
        ("doubt_reach", 0.0),
        ("sigma_floor", None),
        ("architecture", None),
        ("architecture", {"harmonics": 6}),
    ],
)
def test_invalid_descriptions_are_refused(parts, tmp_path, field, value):
    tensors, description = parts
    path = write(tmp_path / "bad.safetensors", tensors, {**description, field: value})
    assert_refused(path, field)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("encoder", [64, 64, 128]),
        ("encoder", [32, 128]),
        ("harmonics", 3),
        ("decoder", [128, 5]),
        ("aggregation", "sum"),
    ],
)
def test_another_architecture_is_refused(parts, tmp_path, field, value):
    tensors, description = parts
    description["architecture"][field] = value
    assert_refused(write(tmp_path / "bad.safetensors", tensors, description), "architecture")


@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("decoder.0.weight", lambda w: np.full_like(w, np.nan)),
        ("encoder.1.bias", lambda w: w[:-1].copy()),
        ("grid", lambda w: w[::-1].copy()),
        ("grid", lambda w: w + 1.0),
        ("grid", lambda w: 0.0 * w),
        ("grid", lambda w: w**2),
        ("grid", lambda w: w[None]),
        ("demonstrations", lambda w: w[:0].copy()),
        ("reference", lambda w: None),
        ("weights", lambda w: w.astype(np.int64)),
    ],
)
def test_invalid_tensors_are_refused(parts, tmp_path, name, spoil):
    tensors, description = parts
    tensors[name] = spoil(tensors[name])
    if tensors[name] is None:
        del tensors[name]
    assert_refused(write(tmp_path / "bad.safetensors", tensors, description), name)


@pytest.mark.parametrize("name", ["two_obstacles", "two_obstacles_default", "two_obstacles_paper", "doorway"])
def test_shipped_learners_are_found_by_name_from_any_folder(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    learner = load_learner(name)
    assert learner.preset == ("paper" if name.endswith("_paper") else "default")
    assert learner.metadata["scenario"] in name


def test_a_file_takes_precedence_over_a_name(learner, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_learner(learner, "two_obstacles")
    assert load_learner("two_obstacles").metadata["scenario"] == "bows"


def test_an_unknown_name_lists_the_shipped_learners():
    with pytest.raises(InputError, match="doorway_default, doorway_paper"):
        load_learner("two_obstacle")


def test_a_learner_without_a_file_is_not_written(tmp_path):
    with pytest.raises(InputError, match="to_file"):
        save_learner(object(), tmp_path / "none.safetensors")
    assert not list(tmp_path.iterdir())


def test_a_learner_is_described_in_one_line():
    assert len(repr(load_learner("two_obstacles"))) < 100
