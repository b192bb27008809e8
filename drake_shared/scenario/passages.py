"""How wide the widest way from start to goal is."""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from drake_shared.scenario.planar_distance import PlanarDistance
from drake_shared.scenario.scenario import Goal, Scenario

_CELLS = 200_000
_HALVINGS = 12


def widest_passage(scenario: Scenario, goal: Goal) -> float:
    """Width of the widest way from the start to ``goal`` between the static obstacles, in [m].

    It is the diameter of the largest circle whose centre can be moved there inside the workspace, on a grid
    of at most 200,000 cells; infinite without obstacles.
    """
    space = scenario.workspace
    width, height = space.x_max - space.x_min, space.y_max - space.y_min
    cell = max(math.sqrt(width * height / _CELLS), 0.05 * scenario.diff_drive.footprint_radius)
    axes = [
        np.linspace(low, low + size, max(2, 1 + math.ceil(size / cell)))
        for low, size in ((space.x_min, width), (space.y_min, height))
    ]
    distance = PlanarDistance(scenario.static_obstacles).least(*np.meshgrid(*axes, indexing="ij"))
    ends = [
        tuple(int(np.abs(axis - x).argmin()) for axis, x in zip(axes, (place.x, place.y), strict=True))
        for place in (scenario.start, goal)
    ]
    narrow, wide = 0.0, min(float(distance[end]) for end in ends)
    if math.isinf(wide):
        return wide
    for _ in range(_HALVINGS):
        radius = 0.5 * (narrow + wide)
        areas, _ = ndimage.label(distance >= radius, structure=np.ones((3, 3)))
        if areas[ends[0]] and areas[ends[0]] == areas[ends[1]]:
            narrow = radius
        else:
            wide = radius
    return 2.0 * narrow
