"""Learners that break their contract are refused, and the error names what is wrong."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.learners import (
    Learner,
    Modes,
    MultimodalLearner,
    NoLearner,
    PrefixLearner,
    ScalableLearner,
    calibrate,
    check_learner,
    check_prediction,
    load_learner,
)

GRID = np.linspace(0.0, 2.0, 21)


class MeanLearner:
    """Predicts the mean and variance of its demonstrations, whatever it observes; correct."""

    name, preset, confidence_gain, duration = "mean", "none", 30.0, 2.0

    def __init__(self, size: int = 2) -> None:
        self.grid, self.metadata = GRID, {"clock": "progress"}
        path = GRID[:, None] * np.arange(1.0, size + 1.0)
        self.demonstrations = np.stack([path, path + 1.0])

    def predict(
        self, times: np.ndarray, positions: np.ndarray, query_times: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        at = np.searchsorted(GRID, query_times)
        return self.demonstrations.mean(axis=0)[at], self.demonstrations.var(axis=0)[at] + 0.01


class OneBuffer(MeanLearner):
    """Returns views of one work buffer."""

    buffer = np.ones((2, 21, 2))

    def predict(self, times, positions, query_times):
        self.buffer[:, : len(query_times)] = super().predict(times, positions, query_times)
        mean, variance = self.buffer[:, : len(query_times)]
        return mean, variance


class NegativeVariance(MeanLearner):
    def predict(self, times, positions, query_times):
        mean, variance = super().predict(times, positions, query_times)
        return mean, -variance


class VarianceOfTime(MeanLearner):
    def predict(self, times, positions, query_times):
        mean, variance = super().predict(times, positions, query_times)
        return mean, variance[:, 0].copy()


class NotFinite(MeanLearner):
    def predict(self, times, positions, query_times):
        mean, variance = super().predict(times, positions, query_times)
        return mean + np.nan, variance


class SinglePrecision(MeanLearner):
    def predict(self, times, positions, query_times):
        mean, variance = super().predict(times, positions, query_times)
        return mean.astype(np.float32), variance


class ItsOwnData(MeanLearner):
    def predict(self, times, positions, query_times):
        first = 21 - len(query_times)
        return self.demonstrations[0, first:], self.demonstrations[1, first:] + 1.0


class OneArrayForBoth(MeanLearner):
    def predict(self, times, positions, query_times):
        _, variance = super().predict(times, positions, query_times)
        return variance, variance


class ErasesWhatItReturned(MeanLearner):
    last = np.zeros(1)

    def predict(self, times, positions, query_times):
        self.last[...] = 0.0
        mean, variance = super().predict(times, positions, query_times)
        self.last = mean
        return mean, variance


class FailsFor(MeanLearner):
    """Predicts NaN from some number of observations, or for some number of queries."""

    def __init__(self, observations: int = -1, queries: int = -1) -> None:
        super().__init__()
        self.bad = observations, queries

    def predict(self, times, positions, query_times):
        mean, variance = super().predict(times, positions, query_times)
        is_bad = len(times) == self.bad[0] or len(query_times) == self.bad[1]
        return mean, variance * (np.nan if is_bad else 1.0)


class Raises(MeanLearner):
    def predict(self, times, positions, query_times):
        return self.demonstrations[99], self.demonstrations[99]


class OnlyTheMean(MeanLearner):
    def predict(self, times, positions, query_times):
        return super().predict(times, positions, query_times)[0]


class OtherPrefixes(MeanLearner):
    def predict_prefixes(self, times, positions, query_times):
        mean, variance = self.predict(times, positions, query_times)
        return [(mean, 2.0 * variance)] * len(times)


class TwoModes(MeanLearner):
    """Two equal modes, or what is given in place of a field."""

    def __init__(self, **fields) -> None:
        super().__init__()
        self.fields = fields

    def predict_modes(self, times, positions, query_times):
        mean, variance = self.predict(times, positions, query_times)
        fields = {
            "probability": np.array([0.5, 0.5]),
            "mean": np.stack([mean] * 2),
            "variance": np.stack([variance] * 2),
            "aim": 1,
        }
        shift = self.fields.get("shift", np.zeros(2))
        given = {name: value for name, value in self.fields.items() if name != "shift"}
        return mean + shift[0], variance + shift[1], Modes(**{**fields, **given})


def with_attributes(**attributes) -> MeanLearner:
    learner = MeanLearner()
    for name, value in attributes.items():
        setattr(learner, name, value)
    return learner


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_a_class_annotated_with_arrays_is_a_learner_for_any_position_size(size):
    learner: Learner = MeanLearner(size)
    check_learner(learner)


@pytest.mark.parametrize("gain", [1, 0.1, np.float64(1e5)])
def test_any_positive_number_is_a_gain(gain):
    check_learner(with_attributes(confidence_gain=gain))


@pytest.mark.parametrize(
    "kind",
    [
        OneBuffer,
        NegativeVariance,
        VarianceOfTime,
        NotFinite,
        SinglePrecision,
        ItsOwnData,
        OneArrayForBoth,
        ErasesWhatItReturned,
        Raises,
        OnlyTheMean,
    ],
)
def test_wrong_predictions_are_refused(kind):
    with pytest.raises(InputError) as error:
        check_learner(kind())
    assert error.value.field == "predict"
    assert "mean" in error.value.source


@pytest.mark.parametrize("case", [{"observations": 0}, {"observations": 2}, {"queries": 1}, {"queries": 20}])
def test_predictions_are_tried_without_with_one_and_with_two_observations_and_up_to_the_last_time(case):
    with pytest.raises(InputError) as error:
        check_learner(FailsFor(**case))
    assert error.value.field == "predict"


@pytest.mark.parametrize("change", [lambda all_: all_[:-1], lambda all_: [], lambda all_: all_ * 2])
def test_prefixes_are_as_many_as_the_observations(change):
    class Prefixes(MeanLearner):
        def predict_prefixes(self, times, positions, query_times):
            return change([self.predict(times, positions, query_times)] * len(times))

    with pytest.raises(InputError) as error:
        check_learner(Prefixes())
    assert error.value.field == "predict_prefixes"


def test_prefixes_must_end_with_what_predict_returns():
    with pytest.raises(InputError) as error:
        check_learner(OtherPrefixes())
    assert error.value.field == "predict_prefixes"


@pytest.mark.parametrize(
    "fields",
    [
        {"probability": np.array([0.5, 0.6])},
        {"probability": np.array([1.5, -0.5])},
        {"mean": np.zeros((2, 3, 2))},
        {"variance": np.zeros((1, 20, 2))},
        {"aim": 2},
        {"aim": -1},
        {"shift": np.array([1e-3, 0.0])},
        {"shift": np.array([0.0, 1e-3])},
    ],
)
def test_modes_that_contradict_the_prediction_or_themselves_are_refused(fields):
    check_learner(TwoModes())
    with pytest.raises(InputError) as error:
        check_learner(TwoModes(**fields))
    assert error.value.field == "predict_modes"


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("confidence_gain", 0.0),
        ("confidence_gain", -21360.0),
        ("confidence_gain", float("inf")),
        ("confidence_gain", None),
        ("grid", GRID[::-1]),
        ("grid", GRID + 1.0),
        ("grid", GRID[:1]),
        ("grid", GRID[:, None]),
        ("grid", np.where(GRID == 1.0, GRID[9], GRID)),
        ("grid", np.where(GRID == 2.0, np.inf, GRID)),
        ("demonstrations", np.zeros((1, 5, 2))),
        ("demonstrations", np.zeros((21, 2))),
        ("demonstrations", np.full((1, 21, 2), np.nan)),
        ("demonstrations", np.zeros((0, 21, 2))),
        ("demonstrations", np.full((1, 21, 2), "0")),
        ("demonstrations", [[0.0, 1.0]]),
        ("demonstrations", None),
        ("metadata", None),
    ],
)
def test_wrong_attributes_are_refused(field, value):
    with pytest.raises(InputError) as error:
        check_learner(with_attributes(**{field: value}))
    assert error.value.field == field


def test_the_grid_ends_at_the_duration():
    for duration in (1.9, 2.1):
        with pytest.raises(InputError) as error:
            check_learner(with_attributes(duration=duration))
        assert error.value.field == "grid"
    endless = np.where(GRID == 2.0, np.inf, GRID)
    with pytest.raises(InputError) as error:
        check_learner(with_attributes(grid=endless, duration=np.inf))
    assert error.value.field == "grid"


def test_by_the_clock_of_time_demonstrations_may_be_unknown():
    class Unknown(MeanLearner):
        def predict(self, times, positions, query_times):
            return np.zeros((len(query_times), 2)), np.ones((len(query_times), 2))

    learner = Unknown()
    learner.demonstrations, learner.metadata = None, {}
    check_learner(learner)


@pytest.mark.parametrize("metadata", [{"clock": "sun"}, {"evidence": "thoughts"}])
def test_reserved_metadata_have_known_values(metadata):
    with pytest.raises(InputError, match=min(metadata)):
        check_learner(with_attributes(metadata=metadata))


def test_an_object_without_the_attributes_is_refused():
    with pytest.raises(InputError, match="object"):
        check_learner(object())


def test_a_negative_variance_gives_no_gain(make_bows):
    with pytest.raises(InputError, match="variance"):
        calibrate(NegativeVariance(), make_bows([1.0, -1.0], duration=2.0))


@pytest.mark.parametrize(
    "name", ["two_obstacles_default", "two_obstacles_paper", "doorway", "three_obstacles"]
)
def test_shipped_learners_pass(name):
    learner = load_learner(name)
    check_learner(learner)
    assert isinstance(learner, PrefixLearner)
    assert isinstance(learner, ScalableLearner)
    assert not isinstance(learner, MultimodalLearner)


def test_no_learner_passes_for_any_position_size():
    check_learner(NoLearner(15.0))
    mean, variance = NoLearner(15.0).predict([], np.empty((0, 3)), [1.0, 2.0])
    assert np.isnan(mean).all()
    assert np.isinf(variance).all()
    assert mean.shape == variance.shape == (2, 3)


@pytest.mark.parametrize(
    ("mean", "variance"),
    [
        (np.zeros((3, 2)), np.ones(3)),
        (np.zeros((3, 3)), np.ones((3, 2))),
        (np.zeros((3, 2)), np.zeros((3, 2))),
        (np.zeros((3, 2)), np.array([[1.0, 1.0], [1.0, -1e-9], [1.0, 1.0]])),
    ],
)
def test_predictions_are_checked_at_run_time(mean, variance):
    with pytest.raises(InputError, match="mean"):
        check_prediction(mean, variance, (3, 2), source="learner 'mean'")
    check_prediction(np.zeros((3, 2)), np.full((3, 2), np.nan), (3, 2), source="learner 'mean'")


def test_a_checked_learner_is_left_as_it_was():
    learner = load_learner("two_obstacles")
    at = (np.array([1.0]), np.array([[0.4, 0.1]]), learner.grid)
    before = learner.predict(*at)
    check_learner(learner)
    np.testing.assert_array_equal(before, learner.predict(*at))
    assert dataclasses.is_dataclass(learner)
