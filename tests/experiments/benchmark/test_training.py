"""Time to tell routes apart: the routes, the plain CNMP, the baselines and the clock."""

import dataclasses
import sys

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.demonstrations import Demonstration, Demonstrations, write_demonstrations
from drake_shared.experiments.benchmark import training
from drake_shared.experiments.benchmark.published_cnmp import PublishedCnmp
from drake_shared.experiments.benchmark.routes import drive_routes, make_routes
from drake_shared.experiments.benchmark.training import QUICK, attempt

TIMES = np.linspace(0.0, 5.0, 51)


def two_ways(count: int, height: float = 0.4) -> Demonstrations:
    """Ways of 1 m that bow to the left or right, no two quite alike."""
    items = []
    for index in range(count):
        bow = (height + 0.01 * index) * (-1) ** index * np.sin(np.pi * TIMES / 5.0)
        items.append(Demonstration(times=TIMES, positions=np.stack([TIMES / 5.0, bow], axis=-1)))
    return Demonstrations(items=tuple(items), source="two ways")


@pytest.fixture(scope="module")
def routes():
    return make_routes(two_ways(12), two_ways(4), steps=51)


def test_cases_are_where_the_routes_are_apart(routes):
    apart = np.abs(routes.truth[0, routes.steps, 1] - routes.truth[-1, routes.steps, 1])
    assert np.all(apart > 0.15)
    assert len(routes.steps) == len(routes.truth) == 4 * len(np.unique(routes.steps))


def test_error_is_the_distance_from_the_truth(routes):
    assert routes.error(routes.truth) == 0.0
    assert routes.error(routes.truth + np.array([0.03, 0.04])) == pytest.approx(0.05)


def test_routes_that_are_nowhere_apart_are_refused():
    with pytest.raises(InputError, match="apart"):
        make_routes(two_ways(2), two_ways(2, height=0.0))


def test_simulated_routes_reach_the_goal_at_an_extent_of_one_metre(setting):
    driven = drive_routes(setting.scenario, count=3)
    positions = np.stack([item.positions for item in driven])
    assert np.ptp(positions.reshape(-1, 2), axis=0).max() == pytest.approx(1.0)
    ends = positions[:, -1]
    assert np.linalg.norm(ends - ends[0], axis=1).max() < 0.1


def test_plain_network_is_the_published_one_and_learns(routes):
    plain = PublishedCnmp(routes.paths, learning_rate=3e-3, seed=0)
    shapes = [tuple(layer.weight.shape[::-1]) for layer in plain.encoder[::2]]
    assert shapes == [(3, 128), (128, 128), (128, 128)]
    shapes = [tuple(layer.weight.shape[::-1]) for layer in plain.decoder[::2]]
    assert shapes == [(129, 128), (128, 128), (128, 4)]
    mean, variance = plain.predict(routes.steps, routes.observed)
    assert mean.shape == variance.shape == routes.truth.shape
    assert np.all(variance > 0.0)
    before = routes.error(mean)
    while plain.iterations < 300:
        plain.train(0.01)
    assert routes.error(plain.predict(routes.steps, routes.observed)[0]) < 0.8 * before


def test_attempts_end_at_the_target():
    seconds, trace = attempt("it", iter([(1.0, 0.5), (2.0, 0.09), (3.0, 0.01)]), QUICK)
    assert seconds == 2.0
    assert trace.errors == [0.5, 0.09]


def test_attempts_end_at_the_limit():
    seconds, trace = attempt("it", iter([(1.0, 0.5), (QUICK.limit + 1.0, 0.01)]), QUICK)
    assert seconds is None
    assert len(trace.seconds) == 2


def test_who_does_not_get_there_bounds_the_ratio():
    (found,) = training._compare({"drake_shared": [1.0, 2.0], "ProMP": [None, 4.0]}, limit=10.0)
    assert found.bound == "at most"
    assert found.spread.low < found.spread.high < 1.0
    assert training._compare({"drake_shared": [None], "ProMP": [1.0]}, limit=10.0) == []


def test_quick_run_on_given_files(setting, tmp_path, monkeypatch, check_result):
    train_file, test_file = tmp_path / "train.parquet", tmp_path / "test.parquet"
    write_demonstrations(train_file, two_ways(12))
    write_demonstrations(test_file, two_ways(4))
    given = dataclasses.replace(setting, demonstrations=train_file, test_demonstrations=test_file)
    monkeypatch.setattr(training, "QUICK", dataclasses.replace(QUICK, target=0.2, limit=20.0))
    result = training.run(given)
    check_result(result)
    assert {item.name for item in result.traces} >= {"drake_shared", *training.PLAIN}
    assert result.details["training_demonstrations"] == 12
    assert result.details["target"] == 0.2


def test_baselines_that_are_not_installed_are_reported(setting, routes, monkeypatch):
    monkeypatch.setattr(training, "_routes", lambda *arguments: routes)
    monkeypatch.setattr(training, "train_ours", lambda *arguments: iter([(1.0, 0.01)]))
    monkeypatch.setattr(training, "PLAIN", {})
    for name in ("movement_primitives.promp", "sklearn.gaussian_process", "sklearn.exceptions"):
        monkeypatch.setitem(sys.modules, name, None)
    result = training.run(setting)
    assert all("not installed" in result.absent[name] for name in (training.PROMP, training.PROCESS))


def test_baselines_tell_the_routes_apart(routes):
    pytest.importorskip("movement_primitives")
    pytest.importorskip("sklearn")
    ((_, error),) = training.fit_promps(routes, 0)
    assert error < 0.1
    *_, (_, error) = training.fit_processes(routes, 0)
    assert error < 0.1
