"""A plane with round obstacles and one wall, measured without a SceneGraph."""

from collections.abc import Callable, Sequence
from types import SimpleNamespace

import numpy as np
import pytest


def distance_query(circles: Sequence[tuple[complex, float]] = (), wall: float | None = None) -> Callable:
    """Distances to circles (center, radius), named 0, 1, ..., and to a wall at x >= ``wall``, named -1."""

    def query(x: float, y: float, distance: float) -> list[SimpleNamespace]:
        offsets = [(complex(x, y) - center, radius) for center, radius in circles]
        measured = [(abs(away) - radius, away / abs(away)) for away, radius in offsets]
        named = list(enumerate(measured))
        if wall is not None:
            named.append((-1, (wall - x, -1.0 + 0.0j)))
        # Attributes as Drake names them.
        return [
            SimpleNamespace(id_G=name, distance=gap, grad_W=np.array([normal.real, normal.imag, 0.0]))
            for name, (gap, normal) in named
            if gap <= distance
        ]

    return query


@pytest.fixture(scope="session")
def make_query() -> Callable:
    return distance_query
