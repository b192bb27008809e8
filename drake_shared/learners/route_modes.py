"""The routes that are still possible, for learners whose prediction has one mode only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from drake_shared.learners.base import Learner
from drake_shared.learners.dataset import scale_of
from drake_shared.learners.modes import Modes
from drake_shared.learners.route_clustering import group_by_route

Array = NDArray[np.float64]

_MAX_ROUTES = 8
# Number of positions to come on which the prediction along a route is conditioned.
_POINTS = 4
# Weights, in the fit of the probabilities: of second moments, of the sum, and of the demonstrations' shares.
_SECOND, _SUM, _SHARE = 0.5, 10.0, 0.02
_NEGLIGIBLE = 0.02


class RouteModes:
    """Splits a prediction with one mode, such as a CNMP's, into the demonstrated routes that it covers.

    The mean of such a prediction lies between the routes, where nobody drove. A route's probability here is
    its weight in the mixture of the demonstrated routes whose mean and variance come nearest to those of the
    prediction, so that it says what the learner predicts and nothing that it does not know. A mode is the
    learner's own prediction for a driver who takes that route: it is conditioned on the position now and on
    the route's positions to come.

    Args:
        learner: Its demonstrations give the routes; they must be known.
    """

    def __init__(self, learner: Learner) -> None:
        taught = learner.demonstrations
        assert taught is not None
        groups = sorted(group_by_route(taught), key=len, reverse=True)[:_MAX_ROUTES]
        self._spread, _ = scale_of(taught)
        self._learner = learner
        self._grid = np.asarray(learner.grid)
        self._shares = np.array([len(group) for group in groups]) / sum(map(len, groups))
        self._routes = np.stack([taught[group].mean(axis=0) for group in groups])

    def __call__(
        self, time: float, position: tuple[float, ...], first: int, mean: Array, variance: Array
    ) -> Modes:
        """The modes of a prediction.

        Args:
            time: Time now on the learner's clock, in [s].
            position: Position now (D,), in [m].
            first: Index of the first entry of the learner's grid that is predicted.
            mean: Shape (Q, D), predicted from entry ``first`` on, in [m].
            variance: Shape (Q, D), in [m^2].
        """
        routes = self._routes[:, first:]
        probability = self._probabilities(routes, mean, variance)
        means, variances = np.full(routes.shape, np.nan), np.full(routes.shape, np.nan)
        likely = np.flatnonzero(probability > _NEGLIGIBLE)
        if len(likely) == 1:
            means[likely[0]], variances[likely[0]] = mean, variance
        else:
            steps = np.unique(np.linspace(0, len(mean) - 1, _POINTS + 2).round().astype(int)[1:])
            later = self._grid[first:]
            times = np.concatenate([[time], later[steps]])
            for route in likely:
                seen = np.concatenate([[position], routes[route, steps]])
                means[route], variances[route] = self._learner.predict(times, seen, later)
            # What is uncertain at all times, such as far from all demonstrations, is so on every route.
            np.maximum(variances, variance.min(axis=0), out=variances)
        return Modes(probability=probability, mean=means, variance=variances, aim=int(probability.argmax()))

    def _probabilities(self, routes: Array, mean: Array, variance: Array) -> Array:
        """The weights (C,) that fit the first two moments best, non-negative least squares."""
        count = len(routes)
        offsets = (routes - mean) / self._spread
        squares = np.square(offsets)
        # Variance beyond all routes is that of the positions on them, not of the choice between them.
        target = np.minimum(variance / self._spread**2, squares.max(axis=0))
        scale = 1.0 / np.sqrt(mean.size)
        matrix = np.concatenate(
            [
                scale * offsets.reshape(count, -1).T,
                _SECOND * scale * squares.reshape(count, -1).T,
                np.full((1, count), _SUM),
                _SHARE * np.eye(count),
            ]
        )
        right = np.concatenate(
            [np.zeros(mean.size), _SECOND * scale * target.ravel(), [_SUM], _SHARE * self._shares]
        )
        weights, _ = nnls(matrix, right)
        probability: Array = weights / weights.sum()
        return probability
