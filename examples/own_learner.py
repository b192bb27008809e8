"""A custom learner: a mixture of the demonstrations, weighted by their distance to the observations.

Usage: python examples/own_learner.py

`drake_shared.learners.Learner` is the contract. A package registers such a class in the entry point group
drake_shared.learners; Python code passes an object.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared import Simulation, TrialSettings, load_scenario, metrics, teach

Array = NDArray[np.float64]


class NearestDemonstrations:
    """Predicts the mean and the variance of the demonstrations that pass near the observed positions.

    Args:
        grid: Shape (N,), query times, in [s].
        demonstrations: Shape (m, N, D), positions on the grid, in [m].
        width: Distance at which a demonstration loses most of its weight, in [m].
    """

    name = "nearest_demonstrations"
    preset = "own"
    metadata: Mapping[str, Any] = {"clock": "progress", "evidence": "pose+command"}

    def __init__(self, grid: Array, demonstrations: Array, *, width: float = 0.15) -> None:
        self.grid = grid
        self.duration = float(grid[-1])
        self.demonstrations: Array | None = demonstrations
        self._paths = demonstrations
        self._width = width
        # c_f is 0.05 where all demonstrations are equally likely.
        self.confidence_gain = 1.0 / (0.05 * float(demonstrations.var(axis=0).max()))

    def predict(self, times: Array, positions: Array, query_times: Array) -> tuple[Array, Array]:
        """Mean and variance, both (Q, D), in [m] and [m^2], given observations (n,), (n, D)."""
        offsets = self._at(times) - positions  # Shape (m, n, D).
        distances = np.square(offsets).sum(axis=(1, 2)) / max(len(times), 1)
        weights = np.exp(-0.5 * (distances - distances.min()) / self._width**2)
        weights /= weights.sum()
        paths = self._at(query_times)
        mean = np.einsum("m,mqd->qd", weights, paths)
        variance = np.einsum("m,mqd->qd", weights, np.square(paths - mean))
        return mean, variance + (0.1 * self._width) ** 2

    def _at(self, times: Array) -> Array:
        """Positions (m, n, D) of all demonstrations at ``times`` (n,), in [s]."""
        return np.stack([at_times(path, self.grid, times) for path in self._paths])


def at_times(path: Array, grid: Array, times: Array) -> Array:
    """Positions (n, D) of a path (N, D), known on ``grid`` (N,), at ``times`` (n,); held at both ends."""
    return np.stack([np.interp(times, grid, axis) for axis in path.T], axis=-1)


def learn(times: Sequence[Array], positions: Sequence[Array], *, duration: float) -> NearestDemonstrations:
    """A learner from demonstrations: times (n,), in [s], and positions (n, D), in [m], of each."""
    grid = np.linspace(0.0, duration, round(duration / 0.1) + 1)
    paths = [at_times(path, known, grid) for known, path in zip(times, positions, strict=True)]
    return NearestDemonstrations(grid, np.stack(paths))


def main() -> dict[str, Any]:
    """Learns the shipped task from simulated demonstrations and drives one of its routes."""
    scenario = load_scenario("two_obstacles")
    demonstrations = list(teach(scenario))
    learner = learn(
        [item.times for item in demonstrations],
        [item.positions for item in demonstrations],
        duration=scenario.duration,
    )
    trial = Simulation(scenario, learner=learner).run(TrialSettings(route="left_right", seed=1))
    result = dict(metrics(trial))
    print(f"{trial.status}, mean human weight {result['mean_human_weight']:.2f}")
    return result


if __name__ == "__main__":
    main()
