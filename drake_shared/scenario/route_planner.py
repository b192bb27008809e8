"""Plans a route for each way of passing the obstacles of a scenario.

Two paths belong to the same way (homotopy class) if one can be moved into the other without crossing an
obstacle. The search is that of Bhattacharya, Likhachev and Kumar 2012: a graph whose nodes are a cell of a
grid together with the rays, one from each obstacle, that a path to it has crossed an odd number of times.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from drake_shared.robots import scaled_length
from drake_shared.scenario.planar_distance import PlanarDistance
from drake_shared.scenario.scenario import Goal, Scenario

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Lengths in [m] for the Pioneer P3-DX: of a cell; that a body keeps from obstacles at least; by which the
# cost of a place falls with its clearance; and the clearance that smoothing aims at.
_CELL, _LEAST_CLEARANCE, _COMFORT, _WANTED = 0.1, 0.05, 0.15, 0.3
# Cost of a place that touches an obstacle, beside its length.
_NEARNESS = 3.0
# Larger graphs take seconds: cells become coarser instead, down to the radius of the robot.
_MOST_NODES = 400_000
_SMOOTHINGS = 200
_POINTS = 101


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class PlannedRoute:
    """A smooth path from start to a goal.

    Attributes:
        points: Shape (101, 2), in [m], world frame, at equal distances along the path.
        passes: Whether each of the obstacles between start and goal is passed on its left: name and bool.
        cost: Length in [m], longer where the path is near an obstacle.
        goal: At its end.
    """

    points: Floats
    passes: dict[str, bool]
    cost: float
    goal: Goal


def plan_routes(scenario: Scenario, *, most: int = 8, longest: float = 1.6) -> list[PlannedRoute]:
    """The cheapest route of each way of passing the static obstacles, by goal, the cheapest way first.

    Args:
        scenario: The task. Moving obstacles are left out.
        most: Largest number of routes to a goal.
        longest: Largest cost of a route, as a multiple of the least one to the same goal.

    Returns:
        The routes; none to a goal that cannot be reached. If the workspace is too large to be searched with
        cells smaller than the robot, the straight line alone, if that is clear of obstacles.
    """
    return [route for goal in scenario.all_goals for route in _routes_to(scenario, goal, most, longest)]


def _routes_to(scenario: Scenario, goal: Goal, most: int, longest: float) -> list[PlannedRoute]:
    search = _Search(scenario, goal)
    if search.is_too_large:
        return search.straight_line(goal)
    found: list[PlannedRoute] = []
    for cost, way, cells in search.cheapest_paths():
        if len(found) == most or (found and cost > longest * found[0].cost):
            break
        points = np.concatenate([[search.start], search.places[cells], [search.goal]])
        passes = {name: bool(way >> bit & 1) for bit, name in enumerate(search.names)}
        found.append(PlannedRoute(points=search.smoothed(points), passes=passes, cost=cost, goal=goal))
    return found


def equidistant(points: Floats, count: int = _POINTS) -> Floats:
    """``count`` points (count, 2) at equal distances along a path (n, 2)."""
    steps = np.hypot(*np.diff(points, axis=0).T)
    points = points[np.concatenate([[True], steps > 0.0])]
    arc = np.concatenate([[0.0], np.cumsum(steps[steps > 0.0])])
    wanted = np.linspace(0.0, arc[-1], count)
    return np.stack([np.interp(wanted, arc, points[:, axis]) for axis in (0, 1)], axis=-1)


class _Search:
    """The graph of cells and ways.

    Attributes:
        places: Shape (cells, 2), in [m].
        names: Of the obstacles between start and goal: bit k of a way is that of names[k].
    """

    def __init__(self, scenario: Scenario, goal: Goal) -> None:
        robot, space = scenario.diff_drive, scenario.workspace
        self._scale = scaled_length(robot, 1.0)
        self._radius = robot.footprint_radius
        self._distance = PlanarDistance(scenario.static_obstacles)
        self.start = np.array([scenario.start.x, scenario.start.y])
        self.goal = np.array([goal.x, goal.y])
        to_goal = self.goal - self.start
        self._length = float(np.hypot(*to_goal))
        self._along = to_goal / self._length
        self._across = np.array([-self._along[1], self._along[0]])
        between = [
            (name, *place)
            for name, place in (
                (item.name, self._project([[item.x, item.y]])) for item in scenario.static_obstacles
            )
            if 0.0 < place[0].item() < self._length
        ]
        self.names = [name for name, *_ in between]
        self._rays = [(along.item(), across.item()) for _, along, across in between]
        area = (space.x_max - space.x_min) * (space.y_max - space.y_min)
        self._cell = max(_CELL * self._scale, (area * 2 ** len(between) / _MOST_NODES) ** 0.5)
        self.is_too_large = self._cell > self._radius
        if self.is_too_large:
            return
        axes = [
            np.arange(low, high + 1e-9, self._cell)
            for low, high in ((space.x_min, space.x_max), (space.y_min, space.y_max))
        ]
        self._shape = (len(axes[0]), len(axes[1]))
        self.places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        self._clearance = self._distance.least(*self.places.T) - self._radius
        self._free = self._clearance > _LEAST_CLEARANCE * self._scale

    def straight_line(self, goal: Goal) -> list[PlannedRoute]:
        """The route straight to the goal, unless an obstacle is in its way."""
        points = np.linspace(self.start, self.goal, _POINTS)
        steps = np.linspace(self.start, self.goal, max(_POINTS, int(self._length / self._radius)))
        if self._distance.least(*steps.T).min() <= self._radius + _LEAST_CLEARANCE * self._scale:
            return []
        passes = {name: across < 0.0 for name, (_, across) in zip(self.names, self._rays, strict=True)}
        return [PlannedRoute(points=points, passes=passes, cost=self._length, goal=goal)]

    def cheapest_paths(self) -> list[tuple[float, int, Integers]]:
        """Cost, way and cells of the cheapest path of each way that leads to the goal."""
        if not self._free.any():
            return []
        cells, ways = len(self.places), 2 ** len(self.names)
        one, other, cost, crossed = self._steps()
        rows = [end + cells * way for way in range(ways) for end in (one, other)]
        columns = [end + cells * (way ^ crossed) for way in range(ways) for end in (other, one)]
        graph = csr_array(
            (np.tile(cost, 2 * ways), (np.concatenate(rows), np.concatenate(columns))),
            shape=(cells * ways, cells * ways),
        )
        first, last = self._nearest_cell(self.start), self._nearest_cell(self.goal)
        costs, before = dijkstra(graph, indices=first, return_predecessors=True)
        found = []
        for way in range(ways):
            node = last + cells * way
            if np.isfinite(costs[node]):
                nodes = [node]
                while before[nodes[-1]] >= 0:
                    nodes.append(int(before[nodes[-1]]))
                found.append((float(costs[node]), way, np.array(nodes[::-1]) % cells))
        return sorted(found, key=lambda path: path[:2])

    def smoothed(self, points: Floats) -> Floats:
        """The path as an elastic band (Quinlan and Khatib 1993): short, and pushed away from obstacles.

        Where a passage is so narrow that the band would touch an obstacle, the path stays as it was found.
        """
        found = equidistant(points)
        points = found.copy()
        wanted, gain = _WANTED * self._scale, 0.08
        for _ in range(_SMOOTHINGS):
            distance, away = self._distance.nearest(*points[1:-1].T)
            missing = np.maximum(wanted + self._radius - distance, 0.0)
            points[1:-1] += 0.5 * (points[:-2] + points[2:] - 2.0 * points[1:-1])
            points[1:-1] += gain * missing[:, None] * away
            points = equidistant(points)
        touches = self._distance.least(*points.T).min() <= self._radius
        return found if touches else points

    def _steps(self) -> tuple[Integers, Integers, Floats, Integers]:
        """Both cells, the cost and the rays crossed (as bits) of each step between two free cells."""
        index = np.arange(len(self.places)).reshape(self._shape)
        pairs = [
            (index[:-1], index[1:]),
            (index[:, :-1], index[:, 1:]),
            (index[:-1, :-1], index[1:, 1:]),
            (index[:-1, 1:], index[1:, :-1]),
        ]
        one, other = (np.concatenate([pair[end].ravel() for pair in pairs]) for end in (0, 1))
        kept = self._free[one] & self._free[other]
        one, other = one[kept], other[kept]
        clearance = np.minimum(self._clearance[one], self._clearance[other])
        length = np.hypot(*(self.places[one] - self.places[other]).T)
        cost = length * (1.0 + _NEARNESS * np.exp(-clearance / (_COMFORT * self._scale)))
        along, across = self._project(self.places)
        crossed = np.zeros(len(one), dtype=np.int64)
        for bit, (at, above) in enumerate(self._rays):
            crosses = (along[one] < at) != (along[other] < at)
            share = np.divide(
                at - along[one], along[other] - along[one], where=crosses, out=np.zeros(len(one))
            )
            left = across[one] + share * (across[other] - across[one]) > above
            crossed |= (crosses & left).astype(np.int64) << bit
        return one, other, cost, crossed

    def _project(self, points: Floats | Sequence[Sequence[float]]) -> tuple[Floats, Floats]:
        """Coordinates (n,) along the line from start to goal, and to its left, of points (n, 2)."""
        offsets = np.asarray(points) - self.start
        return offsets @ self._along, offsets @ self._across

    def _nearest_cell(self, point: Floats) -> int:
        away = np.where(self._free, np.hypot(*(self.places - point).T), np.inf)
        return int(away.argmin())
