"""Groups demonstrations by route."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from drake_shared.learners.dataset import scale_of

# Two demonstrations whose largest distance exceeds this are of different routes: in units of the spread of
# all demonstrations, and of their extent. In tasks looked at, routes differed by 3 to 6 spreads,
# demonstrations of one route by up to 1.5.
_MAX_DISTANCE, _MAX_DISTANCE_EXTENT = 2.0, 0.05


_FROM, _LIKE = 10, 3
"""From so many demonstrations on, and so many on each route, one that is alone is unlike all others."""


def unlike_all_others(positions: NDArray[np.float64]) -> list[int]:
    """Indices of demonstrations that are alone on their route, where the others are many on each of theirs.

    They may be another route, or a mistake. Few demonstrations do not show which.

    Args:
        positions: Shape (m, N, D), in [m].
    """
    groups = group_by_route(positions)
    alone = [int(group[0]) for group in groups if len(group) == 1]
    others = len(groups) - len(alone)
    few = len(positions) < _FROM or len(positions) - len(alone) < _LIKE * max(others, 1)
    return [] if few or len(alone) > others else sorted(alone)


def group_by_route(positions: NDArray[np.float64]) -> list[NDArray[np.intp]]:
    """Groups demonstrations by route, by average linkage of their largest distances.

    Args:
        positions: Shape (m, N, D), in [m].

    Returns:
        Ascending indices of each group's demonstrations; the groups are ordered by their first.
    """
    if len(positions) == 1:
        return [np.array([0])]
    spread, extent = scale_of(positions)
    farthest = np.stack([np.square(positions - path).sum(axis=-1).max(axis=-1) for path in positions])
    tree = linkage(squareform(np.sqrt(farthest), checks=False), "average")
    labels = fcluster(tree, max(_MAX_DISTANCE * spread, _MAX_DISTANCE_EXTENT * extent), "distance")
    groups = [np.flatnonzero(labels == label) for label in np.unique(labels)]
    return sorted(groups, key=lambda group: int(group[0]))
