"""A step of every arbiter of the package is measured."""

import functools

from drake_shared.experiments.benchmark import arbiters
from drake_shared.learners.consistency import training
from drake_shared.systems.arbiters import arbiter_names


def test_every_arbiter_takes_part(setup, monkeypatch):
    # How well a model was trained does not matter to the time of its step.
    monkeypatch.setattr(
        training, "train_consistency", functools.partial(training.train_consistency, iterations=5)
    )
    result = arbiters.run(setup)
    assert set(result.seconds) == set(arbiter_names()) - {"human", "agent"}
    assert all(measured.median > 0.0 for measured in result.seconds.values())
