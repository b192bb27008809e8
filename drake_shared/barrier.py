"""The arithmetic of the safety filter: where a robot comes to rest, and the least change that keeps it clear.

Points of the plane are complex numbers here, x + iy in [m], world frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from pydrake.geometry import SignedDistanceToPoint

from drake_shared.motion import Pose, Wheels
from drake_shared.scenario import Robot

# Signed distances to the obstacles near (x, y), up to a distance.
Nearby = Callable[[float, float, float], list[SignedDistanceToPoint]]

# By how much a clearance that is kept may be missed, in [m]: rounding is no danger.
TOLERANCE = 1e-6
# A changed command aims this far beyond what is required, in [m]: the gap is only nearly linear in it.
_AIM = 1e-4
# For derivatives, in [rad/s].
_NUDGE = 1e-4
# Commands that are tried before the robot brakes, and looks at the obstacles from along a path.
_TRIES = 5
_LOOKS = 8


def _maps(pieces: int = 8) -> np.ndarray:
    """How speeds and angles at the nodes of a path, and durations between, follow from 21 numbers.

    A path has five segments of constant wheel acceleration, the last two cut into pieces; nodes are the ends
    and middles of pieces. The numbers are the speeds at the six ends of the segments, each segment's
    duration times the yaw rate at its begin (5) and at its end (5), and the durations (5).

    Returns:
        Shape (21, 2 nodes + pieces): columns for speeds, angles, durations.
    """
    cuts = [1, 1, 1, pieces, pieces]
    places = [(s, k / (2 * cut)) for s, cut in enumerate(cuts) for k in range(2 * cut)] + [(4, 1.0)]
    speeds, angles = np.zeros((21, len(places))), np.zeros((21, len(places)))
    for node, (segment, share) in enumerate(places):
        speeds[segment : segment + 2, node] = 1.0 - share, share
        angles[6 : 6 + segment, node] = angles[11 : 11 + segment, node] = 0.5
        angles[6 + segment, node] = share - 0.5 * share**2
        angles[11 + segment, node] = 0.5 * share**2
    durations = np.zeros((21, sum(cuts)))
    durations[16:] = np.repeat(np.diag(1.0 / np.array(cuts)), cuts, axis=1)
    return np.hstack([speeds, angles, durations])


_MAPS = _maps()
_PIECES = _MAPS.shape[1] // 5
_NODES = 2 * _PIECES + 1


class StoppingPaths:
    """Ways of the body under several commands: one step, then both wheels brake as hard as they can.

    Positions are exact but for Simpson's rule on pieces of at most an eighth of the braking (1e-6 m).

    Args:
        robot: Sizes and limits.
        pose: x, y in [m] and yaw in [rad] now.
        wheels: Speeds (left, right) now, in [rad/s].
        commands: Each (left, right), in [rad/s], within reach in one step.
        period: Of the step, in [s].

    Attributes:
        points: Shape (m, k + 1), complex, in [m]: the ends of the pieces.
        along: Shape (m, 3 k + 1, 2), in [m]: these, and for each piece its duration times the velocity at
            its begin, reversed, and at its end.
    """

    def __init__(
        self, robot: Robot, pose: Pose, wheels: Wheels, commands: Sequence[Wheels], period: float
    ) -> None:
        numbers = np.array([_numbers(robot, wheels, command, period) for command in commands])
        mapped = numbers @ _MAPS
        durations = mapped[:, 2 * _NODES :]
        velocity = mapped[:, :_NODES] * np.exp(1j * (pose[2] + mapped[:, _NODES : 2 * _NODES]))
        ends, middles = velocity[:, ::2], velocity[:, 1::2]
        both = np.empty((len(commands), 3 * _PIECES + 1), dtype=complex)
        both[:, 0] = complex(pose[0], pose[1])
        begin = np.multiply(durations, ends[:, :-1], out=both[:, _PIECES + 1 : 2 * _PIECES + 1])
        end = np.multiply(durations, ends[:, 1:], out=both[:, 2 * _PIECES + 1 :])
        both[:, 1 : _PIECES + 1] = (begin + end + 4.0 * durations * middles) / 6.0
        self.points = np.cumsum(both[:, : _PIECES + 1], axis=1, out=both[:, : _PIECES + 1])
        np.negative(begin, out=begin)
        self.along = both.view(float).reshape(len(commands), -1, 2)


def _numbers(robot: Robot, wheels: Wheels, command: Wheels, period: float) -> list[float]:
    """What :func:`_maps` maps, of one command."""
    limit = robot.max_wheel_acceleration
    (left, right), (to_left, to_right) = wheels, command
    left_there, right_there = abs(to_left - left) / limit, abs(to_right - right) / limit
    left_stop, right_stop = abs(to_left) / limit, abs(to_right) / limit
    first, last = sorted((left_there, right_there))
    soon, late = sorted((left_stop, right_stop))
    lefts, rights = [left], [right]
    if left_there <= right_there:
        lefts.append(to_left)
        rights.append(right + math.copysign(first * limit, to_right - right))
    else:
        lefts.append(left + math.copysign(first * limit, to_left - left))
        rights.append(to_right)
    lefts += [to_left, to_left, to_left - math.copysign(soon * limit, to_left), 0.0]
    rights += [to_right, to_right, to_right - math.copysign(soon * limit, to_right), 0.0]
    durations = [first, last - first, period - last, soon, late - soon]
    forward, turn = 0.5 * robot.wheel_radius, robot.wheel_radius / robot.track
    rates = [turn * (r - l) for l, r in zip(lefts, rights, strict=True)]  # noqa: E741
    return [
        *(forward * (l + r) for l, r in zip(lefts, rights, strict=True)),  # noqa: E741
        *(d * rate for d, rate in zip(durations, rates, strict=False)),
        *(d * rate for d, rate in zip(durations, rates[1:], strict=True)),
        *durations,
    ]


def least_change(
    wish: Wheels, low: Wheels, high: Wheels, normals: Sequence[Sequence[float]], bounds: Sequence[float]
) -> Wheels | None:
    """The point of a box that is nearest to ``wish`` and meets linear constraints: a quadratic program.

    Minimises |c - wish|^2 over low <= c <= high with normals[i] . c >= bounds[i]. The box is clipped by one
    half-plane after the other; the answer lies in the convex polygon that remains, or on its edge.

    Args:
        wish, low, high: Each two numbers.
        normals: Shape (n, 2).
        bounds: Shape (n,).

    Returns:
        The point; None if there is none.
    """
    corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    inside = low[0] <= wish[0] <= high[0] and low[1] <= wish[1] <= high[1]
    for (a, b), bound in zip(normals, bounds, strict=True):
        if a * (low[0] if a > 0 else high[0]) + b * (low[1] if b > 0 else high[1]) >= bound:
            continue  # The whole box meets it.
        inside = inside and a * wish[0] + b * wish[1] >= bound
        slack = [a * x + b * y - bound for x, y in corners]
        if min(slack) >= 0.0:
            continue
        kept = []
        for k, (x, y) in enumerate(corners):
            before, at = slack[k - 1], slack[k]
            if (before < 0.0) != (at < 0.0):
                share = before / (before - at)
                from_x, from_y = corners[k - 1]
                kept.append((from_x + share * (x - from_x), from_y + share * (y - from_y)))
            if at >= 0.0:
                kept.append((x, y))
        corners = kept
        if not corners:
            return None
    if inside:
        return wish
    return min(
        (_nearest_on(corners[k - 1], corners[k], wish) for k in range(len(corners))),
        key=lambda point: math.hypot(point[0] - wish[0], point[1] - wish[1]),
    )


def _nearest_on(begin: Wheels, end: Wheels, wish: Wheels) -> Wheels:
    """The point of a line between two points that is nearest to ``wish``."""
    along_x, along_y = end[0] - begin[0], end[1] - begin[1]
    length = along_x * along_x + along_y * along_y
    if length == 0.0:
        return begin
    share = ((wish[0] - begin[0]) * along_x + (wish[1] - begin[1]) * along_y) / length
    share = min(max(share, 0.0), 1.0)
    return begin[0] + share * along_x, begin[1] + share * along_y


class _Gaps:
    """Lower bounds of the gaps between the body and the obstacles along paths.

    A convex obstacle is no nearer than the half-plane that touches it where it is nearest to some point, so
    each look from a point bounds the gap at all others, and the highest bound counts.
    """

    def __init__(self, nearby: Nearby, body: float, start: Pose, reach: float) -> None:
        self._nearby = nearby
        self._body = body
        self._reach = reach
        self._found = nearby(start[0], start[1], reach + body)
        self.count = len(self._found)
        if self.count:
            normals = np.array([item.grad_W for item in self._found])[:, :2]
            distances = np.array([item.distance for item in self._found])
            self._normals = normals.T
            self._offsets = distances - body - normals @ start[:2]
            self._more: list[tuple[int, np.ndarray, float]] = []

    def at_start(self) -> float:
        """The least gap where the robot is, in [m]."""
        return min(item.distance for item in self._found) - self._body

    def along(self, paths: StoppingPaths) -> np.ndarray:
        """Lower bounds (m, k, n) of the gaps to the obstacles on each piece of each path, in [m]."""
        return _bounds(self._projected(paths))

    def _projected(self, paths: StoppingPaths) -> np.ndarray:
        """Gaps at the points of ``paths`` and how they change on the pieces: (m, 3 k + 1, n), in [m]."""
        projected = paths.along @ self._normals
        projected[:, : _PIECES + 1] += self._offsets
        for plane in self._more:
            _raise(projected, paths, *plane)
        return projected

    def look(self, point: complex, index: int) -> float:
        """The gap to obstacle ``index`` with the body at ``point``, in [m]; what is seen from there stays."""
        name = self._found[index].id_G
        for item in self._nearby(point.real, point.imag, 2 * self._reach + self._body):
            if item.id_G == name:
                normal, gap = item.grad_W[:2], item.distance - self._body
                offset = gap - normal[0] * point.real - normal[1] * point.imag
                self._more.append((index, normal, offset))
                return gap
        return math.inf

    def keep(self, paths: StoppingPaths, required: np.ndarray) -> np.ndarray | None:
        """Looks along the first of ``paths`` until it is known whether it keeps the gaps ``required`` (n,).

        Returns:
            None if it does, else the least gaps known of all the paths: shape (m, n), in [m].
        """
        projected = self._projected(paths)
        looked: tuple[int, int] | None = None
        ahead = 1
        for _ in range(_LOOKS):
            gaps = _bounds(projected)
            low = gaps[0] < required
            first, index = divmod(int(low.argmax()), self.count)
            if not low[first, index]:
                return None
            # From the end of the piece, and if that will not do from its begin.
            ahead = 1 if looked != (first, index) else ahead - 1
            looked = first, index
            if ahead < 0:
                break
            known = len(self._more)
            gap = self.look(complex(paths.points[0, first + ahead]), index)
            for plane in self._more[known:]:
                _raise(projected, paths, *plane)
            if gap < required[index]:
                break
        return _bounds(projected).min(axis=1)

    def kept_by(self, paths: StoppingPaths, clearance: float) -> np.ndarray:
        """The gap to each obstacle that the first of ``paths`` keeps, at most ``clearance``: (n,), in [m]."""
        kept = np.full(self.count, clearance)
        if self.keep(paths, kept - TOLERANCE) is None:
            return kept
        for index in np.flatnonzero(self.along(paths)[0].min(axis=0) < clearance).tolist():
            points = np.unique(paths.points[0]).tolist()
            kept[index] = min(clearance, *(self.look(point, index) for point in points))
        return kept


def _raise(
    projected: np.ndarray, paths: StoppingPaths, index: int, normal: np.ndarray, offset: float
) -> None:
    """Lets a further half-plane of an obstacle count where it is the higher bound."""
    other = paths.along @ normal
    other[:, : _PIECES + 1] += offset
    known = projected[..., index]
    higher = other[:, : _PIECES + 1] > known[:, : _PIECES + 1]
    np.copyto(known, other, where=np.concatenate([higher, higher[:, :-1], higher[:, 1:]], axis=1))


def _bounds(projected: np.ndarray) -> np.ndarray:
    gap = projected[:, : _PIECES + 1]
    nearing = projected[:, _PIECES + 1 : 2 * _PIECES + 1]
    leaving = projected[:, 2 * _PIECES + 1 :]
    # A piece that first nears an obstacle and then leaves it comes no nearer than both tangents.
    dip = np.maximum(np.minimum(nearing, leaving), 0.0)
    return np.minimum(gap[:, :-1], gap[:, 1:]) - dip


def safe_command(
    robot: Robot,
    pose: Pose,
    wheels: Wheels,
    command: Wheels,
    *,
    clearance: float,
    nearby: Nearby,
    period: float,
) -> Wheels:
    """The command nearest to ``command`` after one step of which the robot can still stop in the clear.

    A command is safe if the step and full braking after it keep ``clearance`` to every obstacle; one that is
    safe is returned as it came. Else it is the solution of a quadratic program: the nearest wheel speeds
    within reach in one step whose gaps to the obstacles, made linear in the command, are kept. What comes
    out is checked in turn, and if nothing passes the robot brakes. That is always possible: braking follows
    the rest of the way that was found safe in the step before.

    Where full braking itself comes nearer than ``clearance`` (the robot was put there), the gap required of
    an obstacle is the one that full braking keeps: it never pushes further in, and can always move out.
    Rotation on the spot is always safe. The norm of a change is that of the wheel speeds, in which forward
    speed weighs as much as half the track times the yaw rate: straight before a wall only the forward speed
    is taken away, and a robot that stands there turns as far as the command was a turn.

    Args:
        pose: x, y in [m] and yaw in [rad].
        wheels: Speeds (left, right), in [rad/s].
        command: Wanted, (left, right), in [rad/s], finite.
        clearance: To keep, in [m], to within 1e-6 m.
        nearby: Finds convex obstacles.
        period: Of the step, in [s].
    """
    limit, change = robot.max_wheel_speed, robot.max_wheel_acceleration * period
    low = max(wheels[0] - change, -limit), max(wheels[1] - change, -limit)
    high = min(wheels[0] + change, limit), min(wheels[1] + change, limit)
    fastest = max(map(abs, (*low, *high)))
    reach = robot.wheel_radius * fastest * (period + fastest / (2 * robot.max_wheel_acceleration))
    gaps = _Gaps(nearby, robot.footprint_radius, pose, reach + clearance)
    at, brake = _within(command, low, high), _within((0.0, 0.0), low, high)
    if not gaps.count or at == brake:
        return command

    required = np.full(gaps.count, clearance)
    if gaps.at_start() < clearance - TOLERANCE:
        required = gaps.kept_by(StoppingPaths(robot, pose, wheels, [brake], period), clearance)
    wish = _within(command, (-limit, -limit), (limit, limit))
    # Gaps are concave in the speeds: a secant across the box errs on the safe side, and passes at once.
    to_left = low[0] if 2 * at[0] > low[0] + high[0] else high[0]
    to_right = low[1] if 2 * at[1] > low[1] + high[1] else high[1]
    for trial in range(_TRIES):
        paths = StoppingPaths(robot, pose, wheels, (at, (to_left, at[1]), (at[0], to_right)), period)
        known = gaps.keep(paths, required - TOLERANCE)
        if known is None:
            return at if trial else command
        slopes = (known[1] - known[0]) / (to_left - at[0]), (known[2] - known[0]) / (to_right - at[1])
        bounds = required + _AIM - known[0] + slopes[0] * at[0] + slopes[1] * at[1]
        # Braking is always allowed, whatever the secants say of it.
        bounds = np.minimum(bounds, slopes[0] * brake[0] + slopes[1] * brake[1])
        found = least_change(wish, low, high, np.transpose(slopes).tolist(), bounds.tolist())
        if found is None:
            break
        # Braking passes the check: the nearer to it, the likelier the next trial does.
        share = 0.5 ** max(trial - 1, 0)
        at = brake[0] + share * (found[0] - brake[0]), brake[1] + share * (found[1] - brake[1])
        to_left = at[0] + math.copysign(_NUDGE, wheels[0] - at[0])
        to_right = at[1] + math.copysign(_NUDGE, wheels[1] - at[1])
    return brake


def _within(command: Wheels, low: Wheels, high: Wheels) -> Wheels:
    return min(max(command[0], low[0]), high[0]), min(max(command[1], low[1]), high[1])
