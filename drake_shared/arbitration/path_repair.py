"""Keeps predicted paths clear of the obstacles that a scenario holds."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drake_shared.arbitration.path_geometry import (
    arc_lengths,
    displacements,
    gap_between,
    interpolated,
    joined,
    obstacle_distance,
)
from drake_shared.common.elementwise import ARRAYS
from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive, Robot, scaled_length
from drake_shared.scenario import Scenario
from drake_shared.scenario.obstacles import Obstacle

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

# Lengths in [m] for the Pioneer P3-DX: kept beside the body where there is room, and at least; and the
# length of the path on which it moves aside before an obstacle, as a multiple of how far it moves.
_MARGIN, _LEAST = 0.1, 0.01
_RAMP = 1.5
# Points between the robot and the first prediction, and points checked on each piece of a path.
_LEAD, _CHECKED = 8, 4
_LEAD_SHARES = np.linspace(0.0, 1.0, _LEAD, endpoint=False)
_CHECKED_SHARES = np.arange(_CHECKED) / _CHECKED
# Kept by the arc to the point that is followed, in [m]; and how far that point is held back, at most.
_ARC_CLEARANCE = 0.04
# Where the robot is looked at on that arc, in [s]: it drives it so slowly that no wheel is too fast.
_ARC_TIMES = np.linspace(0.0, 1000.0, 7)
_SHARES = (1.0, 0.75, 0.55, 0.4, 0.25, 0.12, 0.0)
_ROUNDS, _MARCHES, _CONVERGED = 4, 12, 1e-4


class PathRepair:
    """Moves predicted paths aside, past each obstacle on the side on which they pass its centre.

    A path that still meets an obstacle, because there is no room beside it, ends before it: the robot is
    expected to wait there. Obstacles that move are where their paths have them at the time of each point.

    A path that is clear is returned as it is. Any other begins at the robot, is no faster than the robot, so
    that it has no jumps, and advances no further within the look-ahead than the robot can follow it on an arc
    that is clear.

    Args:
        scenario: Its obstacles, static and moving, its workspace and its robot are known.
        look_ahead: Of the controller that follows the path, in [s].
    """

    def __init__(self, scenario: Scenario, *, look_ahead: float) -> None:
        robot = scenario.robot
        if not isinstance(robot, DiffDrive):
            raise InputError(f"scenario {scenario.name}", "robot", "must be a differential drive")
        self._look_ahead = look_ahead
        self._arc_clearance = scaled_length(robot, _ARC_CLEARANCE)
        self._obstacles = scenario.obstacles
        self._any_moves = any(item.path for item in self._obstacles)
        self._radius = robot.footprint_radius
        self._least = scaled_length(robot, _LEAST)
        self._robot = robot
        space = scenario.workspace
        self._corners = np.array([[space.x_min, space.y_min], [space.x_max, space.y_max]])
        self._margins = [self._margin_of(item, scaled_length(robot, _MARGIN)) for item in self._obstacles]

    def __call__(self, poses: Floats, paths: Floats, times: Floats, now: Floats) -> tuple[Floats, Floats]:
        """Repairs predicted paths.

        Args:
            poses: Shape (n, 3), of the robot now: x, y, yaw, in [m, m, rad].
            paths: Shape (n, Q, 2), predicted positions, in [m]; rows with NaN are returned as they are.
            times: Shape (n, Q), of the predictions, in [s] from the start of the trial.
            now: Shape (n,), in [s].

        Returns:
            The repaired paths (n, Q, 2), and how far each point was moved (n, Q), in [m].
        """
        moved, robot = np.zeros(paths.shape[:2]), poses[:, :2]
        rows = self._rows_near(robot, paths, times, now)
        if not len(rows):
            return paths, moved
        start, path, since = robot[rows, None], joined(robot[rows], paths[rows]), now[rows, None]
        whole = np.concatenate([start + _LEAD_SHARES[:, None] * (path[:, :1] - start), path], axis=1)
        at = np.concatenate([since + _LEAD_SHARES * (times[rows, :1] - since), times[rows]], axis=1)
        shifts = [displacements(item, at) for item in self._obstacles]
        aside = self._moved_aside(whole, shifts)
        arcs, ahead = arc_lengths(aside), times[rows] - since
        ends = self._ends(aside, arcs, whole, shifts)
        possible = self._robot.max_speed * np.maximum(ahead, 0.0)
        wanted = np.minimum(arcs[:, _LEAD:], arcs[np.arange(len(rows)), ends][:, None])
        wanted = possible + np.minimum(np.minimum.accumulate(wanted - possible, axis=1), 0.0)
        reached = self._followed(poses[rows], aside, arcs, wanted, ahead, times[rows, :1])
        repaired = paths.copy()
        for row, points, arc, lengths in zip(rows, aside, arcs, reached, strict=True):
            repaired[row] = np.stack([np.interp(lengths, arc, axis) for axis in points.T], axis=-1)
        moved[rows] = np.hypot(*(repaired[rows] - paths[rows]).transpose(2, 0, 1))
        return repaired, moved

    def _margin_of(self, obstacle: Obstacle, wanted: float) -> float:
        """What is kept beside the body, in [m]: less beside a gap that is hardly wider than the robot."""
        gaps = (gap_between(obstacle, item) for item in self._obstacles if item is not obstacle)
        rooms = (0.4 * (gap - 2.0 * self._radius) for gap in gaps)
        return min([wanted, *(room for room in rooms if room > self._least)])

    def _rows_near(self, robot: Floats, paths: Floats, times: Floats, now: Floats) -> NDArray[np.intp]:
        """Indices of the paths that come nearer to an obstacle than wanted."""
        whole = np.concatenate([0.5 * (robot + paths[:, 0])[:, None], paths], axis=1)
        if self._any_moves:
            times = np.concatenate([0.5 * (now + times[:, 0])[:, None], times], axis=1)
        near = np.zeros(len(paths), bool)
        for item, margin in zip(self._obstacles, self._margins, strict=True):
            relative = whole - displacements(item, times) if item.path else whole
            near |= obstacle_distance(item, relative).min(axis=1) < self._radius + margin
        return np.flatnonzero(near)

    def _moved_aside(self, whole: Floats, shifts: list[Floats]) -> Floats:
        """Paths (n, m, 2), which begin at the robot, with each stretch near an obstacle moved aside."""
        whole = whole.copy()
        unmoved = 0  # Obstacles in a row that moved no path: after all of them, none will.
        for _ in range(_ROUNDS):
            for item, margin, shift in zip(self._obstacles, self._margins, shifts, strict=True):
                unmoved = 0 if self._pass(whole, item, margin, shift) else unmoved + 1
                if unmoved == len(self._obstacles):
                    return whole
        return whole

    def _pass(self, whole: Floats, item: Obstacle, margin: float, shift: Floats) -> bool:
        """Moves the first stretch of each path that is near one obstacle aside; whether there was one."""
        relative = whole - shift if item.path else whole
        distance = obstacle_distance(item, relative)
        if distance.min() >= self._radius + margin:
            return False
        # Where the robot or the end of its path already is nearer, no more can be kept than it has there.
        kept = np.minimum(self._radius + margin, np.minimum(distance[:, 0], distance[:, -1]) - 1e-6)
        kept = np.maximum(kept, self._radius + self._least)
        inside = distance < kept[:, None] - 1e-9
        inside[:, 0] = False
        # A path that ends inside the obstacle is cut off later.
        rows = np.flatnonzero(inside.any(axis=1) & (distance[:, -1] >= kept))
        if not len(rows):
            return False
        kept, inside, relative, path = kept[rows], inside[rows], relative[rows], whole[rows]
        each, index = np.arange(len(rows)), np.arange(inside.shape[1])
        first = inside.argmax(axis=1)
        after = (~inside & (index > first[:, None])).argmax(axis=1)
        # Nothing is computed for points that are on no row's stretch.
        part = slice(int(first.min()), int(after.max()))
        stretch = (index[part] >= first[:, None]) & (index[part] < after[:, None])
        x, y = (relative[each, after] - relative[each, first - 1]).T
        length = np.hypot(x, y)
        left = np.stack([-y, x], axis=-1) / np.maximum(length, 1e-9)[:, None]
        to_center = relative[:, part] - (item.x, item.y)
        nearest = np.where(stretch, np.hypot(*to_center.transpose(2, 0, 1)), math.inf).argmin(axis=1)
        side = to_center[each, nearest] * left
        aside = np.where(side[:, :1] + side[:, 1:] >= 0.0, left, -left)
        # From the far side towards the obstacle, in steps that cannot lead into it.
        reach, marches = 2.0 * item.bounding_radius() + 2.0 * kept, np.full(len(rows), True)
        for _ in range(_MARCHES):
            distance = obstacle_distance(item, relative[:, part] + (reach[:, None] * aside)[:, None])
            beyond = np.where(stretch, distance, math.inf).min(axis=1) - kept
            reach = np.where(marches, reach - beyond, reach)
            marches &= beyond >= _CONVERGED
            if not marches.any():
                break
        offset = reach[:, None] + 1e-3
        outside = stretch & self._is_outside(path[:, part] + (offset * aside)[:, None])
        passes = (length >= 1e-9) & ~outside.any(axis=1)
        arc = arc_lengths(path)
        begin, end = arc[each, first][:, None], arc[each, after][:, None]
        share = _ramped(arc, begin, end, np.maximum(_RAMP * offset, 1e-6))
        sideways = (offset * share)[..., None] * aside[:, None]
        whole[rows[passes]] += sideways[passes]
        return True

    def _is_outside(self, points: Floats) -> Flags:
        """Whether points (..., 2) lie outside the workspace."""
        outside: Flags = ((points < self._corners[0]) | (points > self._corners[1])).any(axis=-1)
        return outside

    def _followed(
        self, poses: Floats, points: Floats, arc: Floats, wanted: Floats, ahead: Floats, soon: Floats
    ) -> Floats:
        """Arc lengths ``wanted`` (n, Q) along paths, held back where the robot could not follow them.

        Obstacles that move are looked at where they are at the first prediction, at ``soon`` (n, 1).

        Pure pursuit drives an arc to the point a look-ahead from now: the nearer that point, the more slowly,
        and the more it turns on the spot.
        """
        (reach,) = interpolated(np.full(len(poses), self._look_ahead), ahead, wanted[..., None]).T
        held, rows = np.zeros(len(poses)), np.arange(len(poses))
        for share in _SHARES:
            target = interpolated(share * reach[rows], arc[rows], points[rows])
            pose = poses[rows].T
            left, right = self._robot.command_toward(pose, target.T, _ARC_TIMES[-1], ARRAYS)
            command = left[:, None], right[:, None]
            arcs = self._robot.rollout(pose[..., None], command, _ARC_TIMES, ARRAYS)
            along, clear = np.stack(arcs, axis=-1), np.full(len(rows), True)
            for item in self._obstacles:
                gap = obstacle_distance(item, along - displacements(item, soon[rows]) if item.path else along)
                least = np.minimum(self._radius + self._arc_clearance, gap[:, :1])
                clear &= (gap >= least - 1e-9).all(axis=1)
            held[rows[clear]] = share * reach[rows[clear]]
            rows = rows[~clear]
            if not len(rows):
                break
        later = self._robot.max_speed * np.maximum(ahead - self._look_ahead, 0.0)
        followed: Floats = np.minimum(wanted, held[:, None] + later)
        return followed

    def _ends(self, aside: Floats, arcs: Floats, whole: Floats, shifts: list[Floats]) -> NDArray[np.int64]:
        """Index (n,) of the last point of each path before it meets an obstacle or leaves the workspace."""
        ends = np.full(len(aside), aside.shape[1] - 1)
        risky, longest = self._is_outside(aside).any(axis=1), np.diff(arcs).max(axis=1)
        for item, shift in zip(self._obstacles, shifts, strict=True):
            relative, step = aside, longest
            if item.path:
                relative = aside - shift
                step = np.diff(arc_lengths(relative)).max(axis=1)
            distance = obstacle_distance(item, relative)
            # A place between two points is nearer than both by at most half the length between them.
            risky |= distance.min(axis=1) - 0.5 * step < self._least_distance(distance[:, 0])
        rows = np.flatnonzero(risky)
        if len(rows):
            own = [shift[rows] if len(shift) > 1 else shift for shift in shifts]
            ends[rows] = self._checked_ends(aside[rows], whole[rows], own)
        return ends

    def _checked_ends(self, aside: Floats, whole: Floats, shifts: list[Floats]) -> NDArray[np.int64]:
        """The same, checked between the points too."""

        def refined(values: Floats) -> Floats:
            steps = values[:, 1:] - values[:, :-1]
            between = values[:, :-1, None] + _CHECKED_SHARES[:, None] * steps[:, :, None]
            return np.concatenate([between.reshape(len(values), -1, 2), values[:, -1:]], axis=1)

        points = refined(aside)
        blocked = np.zeros(points.shape[:2], bool)
        for item, shift in zip(self._obstacles, shifts, strict=True):
            distance = obstacle_distance(item, points - (refined(shift) if item.path else shift))
            blocked |= distance < self._least_distance(distance[:, :1])
        outside = self._is_outside(points)
        if outside.any():
            blocked |= outside & (np.abs(points - refined(whole)).max(axis=2) > 1e-9)
        first = np.where(blocked.any(axis=1), blocked.argmax(axis=1), points.shape[1])
        ends: NDArray[np.int64] = np.minimum(np.maximum(first - 1, 0) // _CHECKED, aside.shape[1] - 1)
        return ends

    def _least_distance(self, at_robot: Floats) -> Floats:
        """That the middle of the robot must keep from an obstacle, from where it is now, in [m]."""
        return np.minimum(self._radius + 0.5 * self._least, at_robot - 1e-9)


def _ramped(arc: Floats, begin: Floats, end: Floats, ramp: Floats) -> Floats:
    """Share (n, m) of a move aside at arc lengths (n, m), in [m]: 1 from begin to end, 0 beyond a ramp.

    The others have shape (n, 1). A ramp that would begin behind the robot begins at it.
    """
    # numpy.clip takes several times as long.
    up = np.minimum(np.maximum((arc - (begin - ramp)) / ramp, 0.0), 1.0)
    down = np.maximum((end + ramp - arc) / ramp, 0.0)
    behind = 0.5 - 0.5 * np.cos(math.pi * up[:, :1])
    share = 0.5 - 0.5 * np.cos(math.pi * np.minimum(up, down))
    share = np.where(up < 1.0, (share - behind) / np.maximum(1.0 - behind, 1e-9), share)
    share[:, 0] = 0.0
    return np.maximum(share, 0.0)


def make_path_repair(scenario: Scenario, robot: Robot, *, look_ahead: float) -> PathRepair | None:
    """The repair for the agent of a scenario; None for robots that are not differential drives."""
    if not isinstance(robot, DiffDrive):
        return None
    return PathRepair(scenario.as_mapped(), look_ahead=look_ahead)
