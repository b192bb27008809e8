"""Aligning demonstrations recovers known changes of their timing."""

import dataclasses

import numpy as np
import pytest

from drake_shared.demonstrations import Demonstration, Demonstrations, align, motion_time
from drake_shared.learners import train

DURATION = 8.0


def progress(times) -> np.ndarray:
    """From rest at 0 to rest at 1, reached after 6 s; then waits."""
    share = np.clip(np.asarray(times) / 6.0, 0.0, 1.0)
    return share - np.sin(2.0 * np.pi * share) / (2.0 * np.pi)


def drive(height: float, *, pause=(0.0, 0.0), pace: float = 1.0, noise: float = 0.0) -> Demonstration:
    """A bow 4 m long that waits for ``pause[1]`` seconds after ``pause[0]``, at ``pace`` times the speed."""
    times = np.arange(0.0, DURATION / pace + pause[1] + 1e-9, 0.05)
    own = np.where(times < pause[0], times, np.maximum(times - pause[1], pause[0]))
    s = progress(pace * own)
    positions = np.stack([4.0 * s, height * np.sin(np.pi * s)], axis=-1)
    positions += noise * np.random.default_rng(0).standard_normal(positions.shape)
    return Demonstration(times=times, positions=positions, yaws=np.zeros(len(times)))


def at(item: Demonstration, times) -> np.ndarray:
    return np.stack([np.interp(times, item.times, axis) for axis in item.positions.T], axis=-1)


def test_demonstrations_driven_alike_stay_as_they_are():
    alike = Demonstrations(items=(drive(1.0), drive(-1.0, pace=1.1)))
    assert align(alike) is alike


@pytest.mark.parametrize("pause", [(0.0, 2.0), (2.5, 1.0), (4.0, 20.0)])
@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_a_pause_anywhere_is_counted_out(pause, noise):
    waited, other = align(Demonstrations(items=(drive(1.0, pause=pause, noise=noise), drive(-1.0))))
    assert waited.provenance["pauses"] == pytest.approx(pause[1], abs=0.2)
    times = np.linspace(0.0, DURATION - 0.5, 60)
    # 0.2 s at 0.67 m/s.
    np.testing.assert_allclose(at(waited, times), at(drive(1.0), times), atol=0.15)
    np.testing.assert_array_equal(other.times, drive(-1.0).times)
    assert len(waited.yaws) == len(waited)


def test_a_twitch_within_a_pause_does_not_count_it_twice():
    waited = drive(1.0, pause=(2.5, 2.0))
    twitch = 0.05 * (np.abs(waited.times - 3.5) < 0.06)
    waited = dataclasses.replace(waited, positions=waited.positions + twitch[:, None])
    (aligned,) = align(Demonstrations(items=(waited,)))
    assert aligned.provenance["pauses"] == pytest.approx(2.0, abs=0.2)
    assert motion_time(waited) == pytest.approx(motion_time(drive(1.0)), abs=0.2)


@pytest.mark.parametrize("pace", [0.3, 0.6, 2.0])
def test_different_paces_become_one(pace):
    items = align(Demonstrations(items=(drive(1.0), drive(-1.0), drive(0.5, pace=pace))))
    times = np.linspace(0.0, 6.0, 40)
    np.testing.assert_allclose(at(items[2], times), at(drive(0.5), times), atol=0.15)
    to_learner = align(Demonstrations(items=(drive(0.5, pace=pace),)), pace=motion_time(drive(1.0)))
    np.testing.assert_allclose(at(to_learner[0], times), at(drive(0.5), times), atol=0.15)


def test_a_robot_that_stands_still_has_no_pace():
    still = Demonstration(times=np.arange(40) * 0.1, positions=np.full((40, 2), 2.0))
    alike = Demonstrations(items=(still, still))
    assert align(alike) is alike


def test_a_learner_is_not_confident_of_the_route_because_one_driver_waited():
    """At the start all routes are possible, and after the pause the time tells nothing."""
    plain = train(Demonstrations(items=(drive(1.0), drive(-1.0))), iterations=150)
    items = (drive(1.0, pause=(0.0, 2.0)), drive(-1.0))
    waited = train(Demonstrations(items=items), iterations=150)
    assert waited.duration == pytest.approx(plain.duration, abs=0.2)
    query = ([0.5], [[0.0, 0.0]], [3.0])
    expected = plain.predict(*query)[1][0, 1]
    assert waited.predict(*query)[1][0, 1] == pytest.approx(expected, rel=0.3)
    assert waited.metadata["training"]["sources"][0]["pauses"] == pytest.approx(2.0, abs=0.2)
    paper = train(Demonstrations(items=items), preset="paper", iterations=2)
    assert paper.duration == DURATION + 2.0
