"""Files of learners: the same bits back, and one line for whatever is broken."""

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
def test_a_learner_read_back_says_the_same_bits(request, tmp_path, preset):
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


def test_writing_what_was_read_gives_the_same_file(learner, tmp_path):
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
    with pytest.raises(InputError, match="this is no learner of drake_shared"):
        load_learner(tmp_path / "other.safetensors")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 2}, "version must be at most 1, the newest known here, got 2"),
        ({"version": None}, "version must be at most 1"),
        ({"learner": "oracle"}, "learner must be one of .*cnmp.*got 'oracle'"),
        ({"format": "something"}, "this is no learner"),
        ({"confidence_gain": -1.0}, "confidence_gain must be a finite number above 0, got -1.0"),
        ({"scale": float("nan")}, "scale must be a finite number above 0, got nan"),
        ({"sigma_floor": None}, "sigma_floor must be a finite number above 0"),
        ({"architecture": None}, "architecture must give"),
        ({"architecture": {"harmonics": 6}}, "architecture must give"),
    ],
)
def test_descriptions_that_do_not_fit_are_refused(parts, tmp_path, change, message):
    tensors, description = parts
    path = write(tmp_path / "bad.safetensors", tensors, {**description, **change})
    with pytest.raises(InputError, match=message) as error:
        load_learner(path)
    assert str(error.value).startswith(path)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("encoder", [64, 64, 128], "encoder must have 3 layers"),
        ("encoder", [32, 128], r"encoder.0.weight must have shape \(15, 32\)"),
        ("harmonics", 3, r"encoder.0.weight must have shape \(9, 64\)"),
        ("decoder", [128, 5], "architecture must give"),
        ("aggregation", "sum", "architecture must give"),
    ],
)
def test_another_architecture_is_refused(parts, tmp_path, field, value, message):
    tensors, description = parts
    description["architecture"][field] = value
    with pytest.raises(InputError, match=message):
        load_learner(write(tmp_path / "bad.safetensors", tensors, description))


@pytest.mark.parametrize(
    ("name", "spoil", "message"),
    [
        ("decoder.0.weight", lambda w: np.full_like(w, np.nan), "decoder.0.weight must hold finite numbers"),
        ("encoder.1.bias", lambda w: w[:-1].copy(), r"encoder.1.bias must have shape \(128\)"),
        ("grid", lambda w: w[::-1].copy(), "grid must increase from 0"),
        ("demonstrations", lambda w: w[:0].copy(), "demonstrations must hold at least one"),
        ("reference", lambda w: None, "reference must be among the tensors"),
        ("weights", lambda w: w.astype(np.int64), "weights must hold finite numbers"),
    ],
)
def test_tensors_that_do_not_fit_are_refused(parts, tmp_path, name, spoil, message):
    tensors, description = parts
    tensors[name] = spoil(tensors[name])
    if tensors[name] is None:
        del tensors[name]
    with pytest.raises(InputError, match=message):
        load_learner(write(tmp_path / "bad.safetensors", tensors, description))


def test_a_learner_without_a_file_is_not_written(tmp_path):
    with pytest.raises(InputError, match="must be of a kind that has a file"):
        save_learner(object(), tmp_path / "none.safetensors")
    assert not list(tmp_path.iterdir())
