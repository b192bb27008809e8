"""Training time until routes are distinguished: data, plain CNMP, baseline and limits."""

import dataclasses
import sys

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations, write_demonstrations
from drake_shared.experiments.benchmark import training
from drake_shared.experiments.benchmark.plain_cnmp import PlainCnmp
from drake_shared.experiments.benchmark.routes import drive_routes, make_route_data
from drake_shared.experiments.benchmark.training import QUICK, attempt
from drake_shared.scenario import load_scenario

TIMES = np.linspace(0.0, 5.0, 51)


def two_routes(count: int, height: float = 0.4) -> Demonstrations:
    """Paths of 1 m that bend to the left or right, all different."""
    items = []
    for index in range(count):
        bow = (height + 0.01 * index) * (-1) ** index * np.sin(np.pi * TIMES / 5.0)
        items.append(Demonstration(times=TIMES, positions=np.stack([TIMES / 5.0, bow], axis=-1)))
    return Demonstrations(items=tuple(items), source="two routes")


@pytest.fixture(scope="module")
def routes():
    return make_route_data(two_routes(12), two_routes(4), steps=51)


def test_cases_are_where_the_routes_are_separate(routes):
    apart = np.abs(routes.truth[0, routes.steps, 1] - routes.truth[-1, routes.steps, 1])
    assert np.all(apart > 0.15)
    assert len(routes.steps) == len(routes.truth) == 4 * len(np.unique(routes.steps))


def test_error_is_the_distance_from_the_truth(routes):
    assert routes.error(routes.truth) == 0.0
    assert routes.error(routes.truth + np.array([0.03, 0.04])) == pytest.approx(0.05)


def test_routes_that_are_nowhere_separate_are_refused():
    with pytest.raises(InputError, match="two routes"):
        make_route_data(two_routes(2), two_routes(2, height=0.0))


def test_simulated_routes_reach_the_goal_at_an_extent_of_one_metre():
    driven = drive_routes(load_scenario(), count=3)
    positions = np.stack([item.positions for item in driven])
    assert np.ptp(positions.reshape(-1, 2), axis=0).max() == pytest.approx(1.0)
    ends = positions[:, -1]
    assert np.linalg.norm(ends - ends[0], axis=1).max() < 0.1


def test_plain_network_is_the_published_one_and_learns(routes):
    plain = PlainCnmp(routes.paths, learning_rate=3e-3, seed=0)
    shapes = [tuple(layer.weight.shape[::-1]) for layer in plain.encoder[::2]]
    assert shapes == [(3, 128), (128, 128), (128, 128)]
    shapes = [tuple(layer.weight.shape[::-1]) for layer in plain.decoder[::2]]
    assert shapes == [(129, 128), (128, 128), (128, 4)]
    mean = plain.predict(routes.steps, routes.observed)
    assert mean.shape == routes.truth.shape
    before = routes.error(mean)
    while plain.iterations < 300:
        plain.train(0.01)
    assert routes.error(plain.predict(routes.steps, routes.observed)) < 0.8 * before


def test_attempts_end_at_the_target():
    seconds, trace = attempt("it", iter([(1.0, 0.5), (2.0, 0.09), (3.0, 0.01)]), QUICK)
    assert seconds == 2.0
    assert trace.errors == [0.5, 0.09]


def test_attempts_end_at_the_limit():
    seconds, trace = attempt("it", iter([(1.0, 0.5), (QUICK.limit + 1.0, 0.01)]), QUICK)
    assert seconds is None
    assert len(trace.seconds) == 2


def test_a_contender_that_misses_the_target_bounds_the_ratio():
    (found,) = training.compare({"drake_shared": [1.0, 2.0], "ProMP": [None, 4.0]}, limit=10.0)
    assert found.bound == "at most"
    assert found.spread.low < found.spread.high < 1.0
    assert training.compare({"drake_shared": [None], "ProMP": [1.0]}, limit=10.0) == []


def test_quick_run_on_given_files(setup, tmp_path, monkeypatch, check_result):
    train_file, test_file = tmp_path / "train.parquet", tmp_path / "test.parquet"
    write_demonstrations(train_file, two_routes(12))
    write_demonstrations(test_file, two_routes(4))
    given = dataclasses.replace(setup, training_file=train_file, test_file=test_file)
    monkeypatch.setattr(training, "QUICK", dataclasses.replace(QUICK, target=0.2, limit=20.0))
    result = training.run(given)
    check_result(result)
    assert {item.name for item in result.traces} >= {"drake_shared", *training.PLAIN}
    assert result.details["training_demonstrations"] == 12
    assert result.details["target"] == 0.2


def test_a_baseline_that_is_not_installed_is_reported(setup, routes, monkeypatch):
    monkeypatch.setattr(training, "prepare_data", lambda *arguments: routes)
    monkeypatch.setattr(training, "train_ours", lambda *arguments: iter([(1.0, 0.01)]))
    monkeypatch.setattr(training, "PLAIN", {})
    monkeypatch.setitem(sys.modules, "movement_primitives.promp", None)
    assert set(training.run(setup).absent) == {training.PROMP}


def test_promp_distinguishes_the_routes(routes):
    pytest.importorskip("movement_primitives")
    ((_, error),) = training.train_promp(routes, 0)
    assert error < 0.1
