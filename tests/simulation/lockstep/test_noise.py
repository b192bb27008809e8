"""The random numbers of many seeds are those that Drake's sources show."""

import sys

import numpy as np
import pytest
from pydrake.common import RandomDistribution, RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import RandomSource, VectorLogSink

from drake_shared.simulation.lockstep.noise import Noise, is_drakes

libstdcxx = pytest.mark.skipif(sys.platform != "linux", reason="another C++ standard library")


@libstdcxx
def test_drake_draws_by_libstdcxx():
    assert is_drakes()


@libstdcxx
@pytest.mark.parametrize("kind", [RandomDistribution.kGaussian, RandomDistribution.kUniform])
def test_samples_of_the_third_source_are_drakes(kind):
    seeds, steps, size = [0, 1, 12345, 2**32 - 1], 300, 4
    builder = DiagramBuilder()
    sources = [builder.AddSystem(RandomSource(kind, size, 0.05)) for _ in range(3)]
    log = builder.AddSystem(VectorLogSink(size, 0.05))
    builder.Connect(sources[2].get_output_port(), log.get_input_port())
    diagram = builder.Build()
    noise = Noise(seeds, steps)
    ours = (noise.normal if kind == RandomDistribution.kGaussian else noise.uniform)(2, size)
    for row, seed in enumerate(seeds):
        context = diagram.CreateDefaultContext()
        diagram.SetRandomContext(context, RandomGenerator(seed))
        Simulator(diagram, context).AdvanceTo(0.05 * steps)
        drakes = log.FindLog(context).data()[:, 1:]
        np.testing.assert_allclose(ours[: drakes.shape[1], :, row].T, drakes, rtol=0.0, atol=1e-13)
