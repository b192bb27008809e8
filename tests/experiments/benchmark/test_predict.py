"""The contenders of a prediction compute the same, and are timed."""

import numpy as np
import pytest

from drake_shared.experiments.benchmark import predict
from drake_shared.experiments.benchmark.common import with_grid
from drake_shared.experiments.benchmark.networks import (
    Predictor,
    make_onnx,
    make_published,
    make_torch,
    matrix_shapes,
)

COUNT = 301


@pytest.fixture(scope="module")
def learner(setup):
    return with_grid(setup.cnmp, COUNT)


@pytest.mark.parametrize("make", [make_torch, make_published, make_onnx])
@pytest.mark.parametrize("first", [0, 151])
def test_contender_predicts_what_the_learner_does(learner, make, first):
    if make is make_onnx:
        pytest.importorskip("onnx")
        pytest.importorskip("onnxruntime")
        pytest.importorskip("onnxscript")
    contender = Predictor(learner, first, make)
    for demonstration in learner.demonstrations:
        # On a demonstration no variance for unfamiliar positions is added.
        time, position = learner.grid[first], demonstration[first]
        mean, variance = learner.predict([time], position[None], learner.grid[first:])
        other_mean, other_variance = contender.predict(time, position)
        np.testing.assert_allclose(other_mean, mean, atol=1e-4)
        np.testing.assert_allclose(np.sqrt(other_variance), np.sqrt(variance), atol=1e-4)


def test_precomputing_the_time_part_leaves_one_row_in_the_first_product_of_the_decoder(learner):
    model = learner
    kept, published = (matrix_shapes(model, 0, precompute=precompute) for precompute in (True, False))
    encoder = [(1, *weights.shape) for weights, _ in model.encoder]
    decoder = [(COUNT, *weights.shape) for weights, _ in model.decoder]
    assert published == [*encoder, *decoder]
    assert kept == [*encoder, (1, encoder[-1][2], decoder[0][2]), *decoder[1:]]


def test_a_finer_grid_keeps_the_predictions_on_the_coarse_one(setup):
    coarse = setup.cnmp
    fine = with_grid(coarse, 2 * len(coarse.grid) - 1)
    arguments = [coarse.grid[40]], coarse.demonstrations[0, 40][None]
    mean, variance = coarse.predict(*arguments, coarse.grid)
    fine_mean, fine_variance = fine.predict(*arguments, fine.grid)
    np.testing.assert_allclose(fine_mean[::2], mean, atol=1e-5)
    np.testing.assert_allclose(fine_variance[::2], variance, atol=1e-6)


def test_quick_run(setup, check_result):
    result = predict.run(setup)
    check_result(result)
    names = " ".join(item.name for item in result.ratios)
    for expected in ("bare products, 301", "torch eager / drake_shared, 150", "torch eager, time part kept"):
        assert expected in names
    assert "torch.compile" in result.absent


def test_a_missing_package_is_reported(learner, monkeypatch):
    def missing(*arguments):
        raise ModuleNotFoundError("No module named 'onnxruntime'")

    monkeypatch.setattr(predict, "make_onnx", missing)
    contenders, absent = predict.make_contenders(learner, 151, compiled=False)
    assert not any("onnx" in name for name in contenders)
    assert "onnxruntime" in absent
