"""A step of every arbiter of the package is measured."""

from drake_shared.experiments.benchmark import arbiters
from drake_shared.systems.arbiters import arbiter_names


def test_every_arbiter_takes_part(setup):
    result = arbiters.run(setup)
    assert set(result.seconds) == set(arbiter_names()) - {"human", "agent"}
    assert all(measured.median > 0.0 for measured in result.seconds.values())
