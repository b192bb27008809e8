"""Which demonstrations go the same way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

# Two demonstrations that are ever further apart than this go different ways: in units of the spread of all
# demonstrations, and of their extent. In tasks looked at, ways differed by 3 to 6 spreads, drives of one way
# by up to 1.5.
_PARTED, _PARTED_EXTENT = 2.0, 0.05


def find_ways(positions: NDArray[np.float64], *, spread: float, extent: float) -> list[NDArray[np.intp]]:
    """Groups demonstrations by the way that they go.

    Args:
        positions: Shape (m, N, 2), in [m].
        spread, extent: Of all demonstrations, in [m]; see `drake_shared.learners.dataset.Dataset`.

    Returns:
        Indices of each group's demonstrations, ascending; the groups are ordered by their first.
    """
    if len(positions) == 1:
        return [np.array([0])]
    farthest = np.stack([np.square(positions - path).sum(axis=-1).max(axis=-1) for path in positions])
    tree = linkage(squareform(np.sqrt(farthest), checks=False), "average")
    labels = fcluster(tree, max(_PARTED * spread, _PARTED_EXTENT * extent), "distance")
    groups = [np.flatnonzero(labels == label) for label in np.unique(labels)]
    return sorted(groups, key=lambda group: int(group[0]))
