"""A task that is larger, smaller, mirrored or turned is learnt as well."""

import numpy as np

from drake_shared.demonstrations import Demonstration, Demonstrations
from drake_shared.learners import train

TIMES = np.linspace(0.0, 10.0, 101)
NOISE = 0.03
"""Of the observation, in [m], for a task of 5 m."""


def turn(degrees: float) -> np.ndarray:
    angle = np.radians(degrees)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


SCALE = 0.2
ROOM = SCALE * turn(37.0) @ np.diag([1.0, -1.0])
"""Of 1 m, mirrored and turned."""


def drives(count: int, seed: int) -> np.ndarray:
    """Paths of three routes around two obstacles, shape (count, 101, 2), in [m]; routes take turns."""
    rng = np.random.default_rng(seed)
    share = TIMES / TIMES[-1]
    bump = np.sin(2.0 * np.pi * share) ** 2
    first = share < 0.5
    sides = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
    paths = []
    for index in range(count):
        before, after = sides[index % 3]
        height = np.where(first, before, after) * bump * (0.8 + 0.08 * rng.standard_normal())
        wander = 0.03 * rng.standard_normal(3) @ [np.sin(k * np.pi * share) for k in (1, 2, 3)]
        paths.append(np.stack([5.0 * share, height + wander], axis=-1))
    return np.stack(paths)


def taught(paths: np.ndarray) -> Demonstrations:
    return Demonstrations(items=tuple(Demonstration(times=TIMES, positions=path) for path in paths))


def score(learner, room: np.ndarray, scale: float) -> dict[str, float]:
    """Errors on new paths from one observation where routes are apart, in units of the task of 5 m."""
    rng = np.random.default_rng(1)
    errors, z = [], []
    for path in drives(12, seed=5):
        for step in (20, 25, 75, 80):
            shown = (path[step] + NOISE * rng.standard_normal(2)) @ room.T
            mean, variance = learner.predict(TIMES[step : step + 1], shown[None], TIMES[step + 1 :])
            off = path[step + 1 :] @ room.T - mean
            late = step > 50  # After the second fork the route is known.
            errors += [np.square(off / scale).sum(axis=1).mean()] if late else []
            z.append(off / np.sqrt(variance))
    z = np.abs(np.concatenate(z))
    return {"rmse": float(np.sqrt(np.mean(errors))), "coverage": float((z < 1.645).mean())}


def test_one_noisy_observation_determines_the_route_whatever_size_and_orientation_of_the_task():
    plain, other = (
        score(train(taught(drives(12, seed=0) @ room.T), iterations=400), room, scale)
        for room, scale in ((np.eye(2), 1.0), (ROOM, SCALE))
    )
    assert plain["rmse"] < 0.06
    assert other["rmse"] < 1.15 * plain["rmse"]
    for found in (plain, other):
        assert 0.85 < found["coverage"] < 0.97
