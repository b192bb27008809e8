"""Toy demonstrations, and learners trained on them once."""

import numpy as np
import pytest

from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners import train

ITERATIONS = 250


def bows(heights, *, scale: float = 1.0, scores=None, duration: float = 4.0) -> Demonstrations:
    """Paths from (0, 0) to (4, 0) that bow to one side or the other, one for each height, in [m]."""
    times = np.linspace(0.0, duration, 41)
    share = times / duration
    items = []
    for index, height in enumerate(heights):
        positions = scale * np.stack([4.0 * share, height * np.sin(np.pi * share)], axis=-1)
        score = None if scores is None else scores[index]
        items.append(Demonstration(times=times, positions=positions, score=score))
    return Demonstrations(items=tuple(items), metadata={"scenario": "bows"})


@pytest.fixture(scope="session")
def make_bows():
    return bows


@pytest.fixture(scope="session")
def two_ways() -> Demonstrations:
    """One route to each side."""
    return bows([1.0, -1.0])


@pytest.fixture(scope="session")
def learner(two_ways):
    """The default learner of two routes."""
    return train(two_ways, iterations=ITERATIONS)


@pytest.fixture(scope="session")
def paper_learner(two_ways):
    """The paper's learner of two routes, trained briefly."""
    return train(two_ways, preset="paper", iterations=50)
