"""The random numbers of Drake's `RandomSource`, for many seeds at once, without a diagram.

A diagram's RandomGenerator, mt19937, gives each RandomSource its seed, in the order in which they were added.
A source draws from an mt19937 of its own, by the distributions of the C++ standard library. Those of
libstdc++ are reproduced here: `is_drakes` tests whether Drake uses them.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.common import RandomDistribution, RandomGenerator
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import RandomSource, VectorLogSink

Floats = NDArray[np.float64]

_KEPT = math.pi / 4.0
"""Share of the pairs that the polar method accepts."""


class Noise:
    """What the sources of a diagram show at the updates of a trial.

    Args:
        seeds: Of n trials.
        steps: Number of updates.
    """

    def __init__(self, seeds: Sequence[int], steps: int) -> None:
        self._seeds = seeds
        self._steps = steps

    def normal(self, source: int, size: int) -> Floats:
        """Samples of a standard normal distribution, shape (steps, size, n).

        Args:
            source: Number of the source in the diagram.
            size: Of a sample; even, so that no number of a pair is left for the next sample.
        """
        # The sample drawn when the Context is made random is replaced before the first update.
        pairs = (self._steps + 1) * size // 2
        drawn = int(pairs / _KEPT + 6.0 * math.sqrt(pairs)) + 8
        x, y = (2.0 * part - 1.0 for part in self._uniform(source, 2 * drawn).reshape(-1, drawn, 2).T)
        square = (x * x + y * y).T
        accepted = (square <= 1.0) & (square != 0.0)
        order = np.argsort(~accepted, axis=1, kind="stable")[:, :pairs]
        assert np.take_along_axis(accepted, order, 1).all()
        x, y, square = (np.take_along_axis(part, order, 1) for part in (x.T, y.T, square))
        factor = np.sqrt(-2.0 * np.log(square) / square)
        samples = np.stack([y * factor, x * factor], axis=-1).reshape(len(square), self._steps + 1, size)
        return np.ascontiguousarray(samples[:, 1:].transpose(1, 2, 0))

    def uniform(self, source: int, size: int) -> Floats:
        """Samples of a uniform distribution over [0, 1), shape (steps, size, n); see `normal`."""
        samples = self._uniform(source, (self._steps + 1) * size).reshape(-1, self._steps + 1, size)
        return np.ascontiguousarray(samples[:, 1:].transpose(1, 2, 0))

    def _uniform(self, source: int, count: int) -> Floats:
        """The first numbers from [0, 1) of a source, shape (n, count)."""
        generator = np.random.RandomState()
        words = np.empty((len(self._seeds), 2 * count), np.uint32)
        for row, seed in enumerate(self._seeds):
            generator.seed(seed)
            generator.seed(int(_words(generator, source + 1)[-1]))
            words[row] = _words(generator, 2 * count)
        return (words[:, 0::2] + words[:, 1::2] * 2.0**32) / 2.0**64


def _words(generator: np.random.RandomState, count: int) -> NDArray[np.uint32]:
    return generator.randint(0, 2**32, size=count, dtype=np.uint32)


@functools.cache
def is_drakes() -> bool:
    """Whether Drake's sources show the same numbers: they do with libstdc++."""
    seed, steps = 20, 40
    builder = DiagramBuilder()
    kinds = (RandomDistribution.kGaussian, RandomDistribution.kUniform)
    logs = []
    for kind, size in zip(kinds, (2, 3), strict=True):
        source = builder.AddSystem(RandomSource(kind, size, 1.0))
        log = builder.AddSystem(VectorLogSink(size, 1.0))
        builder.Connect(source.get_output_port(), log.get_input_port())
        logs.append(log)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    diagram.SetRandomContext(context, RandomGenerator(seed))
    simulator = Simulator(diagram, context)
    simulator.AdvanceTo(steps)
    # A log at time t shows what was drawn in the update at t - 1.
    normal, uniform = (log.FindLog(context).data()[:, 1 : steps + 1].T for log in logs)
    noise = Noise([seed], steps)
    return bool(
        np.allclose(noise.normal(0, 2)[..., 0], normal, rtol=0.0, atol=1e-13)
        and np.array_equal(noise.uniform(1, 3)[..., 0], uniform)
    )
