"""The filters that split a command into what is meant and noise, against Gaussian process regression."""

import math

import numpy as np
import pytest

from drake_shared.arbitration.command_filter import CommandFilters

PERIOD = 0.05
KINDS = [(0.45, 3.0), (1.3, 2.5)]
NOISES, TIMES = np.array([0.1, 0.7, 1.2]), np.array([0.5, 0.1, 1.0])
GIVES = np.ones(1, bool)


def filtered(filters: CommandFilters, values: np.ndarray):
    """The state, and what the last value was scored with, after the differences ``values`` (t,)."""
    state = filters.initial_state(1)
    for value in values:
        before = state
        state, log, _, _ = filters.step(before, np.full((len(KINDS), 1), value), GIVES)
    return state, log


def covariances(kind: int, noise: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Of what is meant, and of the noise, at ``count`` steps."""
    deviation, rate = KINDS[kind]
    apart = PERIOD * abs(np.arange(count)[:, None] - np.arange(count))
    meant = deviation**2 * (1.0 + rate * apart) * np.exp(-rate * apart)
    return meant, NOISES[noise] ** 2 * np.exp(-apart / TIMES[noise])


@pytest.fixture(scope="module")
def values():
    return np.random.default_rng(4).normal(0.0, 1.0, 240).cumsum() * 0.1


@pytest.mark.parametrize("kind", [0, 1])
@pytest.mark.parametrize("noise", [0, 1, 2])
def test_what_is_meant_and_the_likelihood_are_those_of_gaussian_process_regression(values, kind, noise):
    filters = CommandFilters(KINDS, NOISES, TIMES, period=PERIOD)
    state, log = filtered(filters, values)
    meant, noisy = covariances(kind, noise, len(values))
    both = meant + noisy
    expected = meant[-1] @ np.linalg.solve(both, values)
    assert state[0, kind, noise, 0] == pytest.approx(expected, abs=1e-6)
    assert state[[0, 2], kind, noise, 0].sum() == pytest.approx(values[-1])
    weights = np.linalg.solve(both[:-1, :-1], both[:-1, -1])
    variance = both[-1, -1] - weights @ both[:-1, -1]
    innovation = values[-1] - weights @ values[:-1]
    assert filters.innovation[kind, noise] == pytest.approx(variance, rel=1e-6)
    assert log[kind, noise, 0] == pytest.approx(
        -0.5 * (innovation**2 / variance + math.log(variance)), abs=1e-5
    )


def test_a_first_difference_is_split_by_the_variances_of_what_is_meant_and_of_the_noise():
    filters = CommandFilters(KINDS, NOISES, TIMES, period=PERIOD)
    state, log, fresh, _ = filters.step(filters.initial_state(1), np.full((len(KINDS), 1), 1.5), GIVES)
    meant = np.square([[deviation] for deviation, _ in KINDS])
    variance = meant + NOISES**2
    expected = 1.5 * np.stack([meant / variance, 0.0 * variance, NOISES**2 / variance])
    np.testing.assert_allclose(state[..., 0], expected)
    np.testing.assert_allclose(fresh, state)
    assert not log.any()
    _, _, _, fresh_log = filters.step(state, np.full((len(KINDS), 1), 0.5), GIVES)
    np.testing.assert_allclose(fresh_log[..., 0], -0.5 * (0.25 / variance + np.log(variance)))


def test_the_share_is_what_is_found_meant_of_a_lasting_difference():
    filters = CommandFilters(KINDS, NOISES, TIMES, period=PERIOD)
    state, _ = filtered(filters, np.ones(800))
    np.testing.assert_allclose(state[0, ..., 0], filters.share, rtol=1e-9)
    assert (filters.share[0] < filters.share[1]).all()


def test_jerks_say_less_with_heavy_tails():
    last = {}
    for tail in (4.0, math.inf):
        filters = CommandFilters(KINDS, NOISES, TIMES, period=PERIOD, tail=tail)
        state, _ = filtered(filters, np.zeros(5))
        _, log, _, _ = filters.step(state, np.full((len(KINDS), 1), 5.0), GIVES)
        last[tail] = log[0, 0, 0]
    assert last[math.inf] < 10.0 * last[4.0] < 0.0


def test_drivers_who_give_no_command_begin_anew():
    filters = CommandFilters(KINDS, NOISES, TIMES, period=PERIOD)
    state = filters.initial_state(2)
    for gives in ([True, True], [True, False], [True, True]):
        state, log, _, fresh_log = filters.step(state, np.ones((len(KINDS), 2)), np.array(gives))
    np.testing.assert_allclose(log[..., 1], fresh_log[..., 1])
    assert (log[..., 0] != fresh_log[..., 0]).all()
