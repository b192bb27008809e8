"""The contenders of a prediction compute the same, and are timed."""

import numpy as np
import pytest

from drake_shared.experiments.benchmark import predict
from drake_shared.experiments.benchmark.predictors import (
    BareProducts,
    Predictor,
    make_onnx,
    make_plain_torch,
    make_torch,
)
from drake_shared.experiments.benchmark.test_tasks import with_grid

COUNT = 301


@pytest.fixture(scope="module")
def learner(setting):
    return with_grid(setting.cnmp, COUNT)


@pytest.mark.parametrize("make", [BareProducts, make_torch, make_plain_torch, make_onnx])
@pytest.mark.parametrize("first", [0, 151])
def test_contender_predicts_what_the_learner_does(learner, make, first):
    if make is make_onnx:
        pytest.importorskip("onnx")
        pytest.importorskip("onnxruntime")
    contender = Predictor(learner.model, first, make)
    for demonstration in learner.demonstrations:
        # On a demonstration nothing is added for being away from all of them.
        time, position = learner.grid[first], demonstration[first]
        mean, variance = learner.predict([time], position[None], learner.grid[first:])
        other_mean, other_variance = contender.predict(time, position)
        np.testing.assert_allclose(other_mean, mean, atol=1e-4)
        np.testing.assert_allclose(np.sqrt(other_variance), np.sqrt(variance), atol=1e-4)


def test_bare_products_are_those_of_one_observation_and_every_query(learner):
    products = BareProducts(learner.model, 0)
    widths = [weights.shape for weights, _ in learner.model.encoder]
    outer = [weights.shape for weights, _ in learner.model.decoder[1:]]
    code = (widths[-1][1], learner.model.decoder[0][0].shape[1])
    assert [weights.shape for _, weights, _ in products._products] == [*widths, code, *outer]
    assert [len(rows) for rows, _, _ in products._products] == [1] * (len(widths) + 1) + [COUNT] * len(outer)
    products.multiply()


def test_a_finer_grid_changes_no_prediction_on_the_old_one(setting):
    coarse = setting.cnmp
    fine = with_grid(coarse, 2 * len(coarse.grid) - 1)
    arguments = [coarse.grid[40]], coarse.demonstrations[0, 40][None]
    mean, variance = coarse.predict(*arguments, coarse.grid)
    fine_mean, fine_variance = fine.predict(*arguments, fine.grid)
    np.testing.assert_allclose(fine_mean[::2], mean, atol=1e-5)
    np.testing.assert_allclose(fine_variance[::2], variance, atol=1e-6)


def test_quick_run(setting, check_result):
    result = predict.run(setting)
    check_result(result)
    names = " ".join(item.name for item in result.ratios)
    for expected in ("bare products, 301", "torch eager / drake_shared, 150", "torch eager, time part kept"):
        assert expected in names
    assert "torch.compile" in result.absent


def test_what_is_not_installed_is_reported(learner, monkeypatch):
    def missing(*arguments):
        raise ModuleNotFoundError("No module named 'onnxruntime'")

    monkeypatch.setattr(predict, "make_onnx", missing)
    contenders, absent = predict.make_contenders(learner, 151, compiled=False)
    assert not any("onnx" in name for name in contenders)
    assert absent["onnxruntime"] == "ModuleNotFoundError: No module named 'onnxruntime'"
