"""The safe command nearest to a given one, compared with a search over all commands within reach."""

import math

import numpy as np
import pytest
from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions

from drake_shared.arbitration.safety.barrier import nearest_feasible, safe_command
from drake_shared.arbitration.safety.braking_paths import BrakingPaths
from drake_shared.robots import DiffDrive

ROBOT = DiffDrive()
RADIUS = ROBOT.footprint_radius
FASTEST = ROBOT.max_wheel_speed
PERIOD = 0.05
CHANGE = ROBOT.max_wheel_acceleration * PERIOD
CLEARANCE = 0.05
LOW, HIGH = (-1.0, -2.0), (3.0, 2.0)


def reference_program(wish, low, high, normals, bounds) -> np.ndarray | None:
    """The same quadratic program by Drake and Clarabel."""
    program = MathematicalProgram()
    c = program.NewContinuousVariables(2)
    program.AddQuadraticErrorCost(np.eye(2), np.array(wish), c)
    program.AddBoundingBoxConstraint(np.array(low), np.array(high), c)
    program.AddLinearConstraint(np.array(normals), np.array(bounds), np.full(len(bounds), np.inf), c)
    options = SolverOptions()
    for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        options.SetOption(ClarabelSolver.id(), name, 1e-13)
    result = ClarabelSolver().Solve(program, None, options)
    return result.GetSolution(c) if result.is_success() else None


def test_quadratic_programs_agree_with_clarabel():
    rng = np.random.default_rng(5)
    infeasible = 0
    for _ in range(300):
        low = rng.uniform(-12, 11, 2)
        high = low + rng.uniform(0.1, 2.0, 2)
        normals = rng.normal(size=(12, 2))
        bounds = (normals * rng.uniform(low, high, (12, 2))).sum(axis=1) - rng.exponential(1.0, 12)
        program = rng.uniform(-12, 12, 2).tolist(), low, high, normals.tolist(), bounds.tolist()
        reference, found = reference_program(*program), nearest_feasible(*program)
        infeasible += reference is None
        assert (reference is None) == (found is None)
        if reference is not None:
            np.testing.assert_allclose(found, reference, atol=1e-6)
    assert 0 < infeasible < 150


@pytest.mark.parametrize(
    ("target", "normals", "bounds", "expected"),
    [
        ((0.5, 0.5), [], [], (0.5, 0.5)),
        ((9.0, -9.0), [], [], (3.0, -2.0)),
        ((-9.0, 9.0), [], [], (-1.0, 2.0)),
        # Onto a line, by its normal of any length; onto a corner; onto the end of a line within the box.
        ((0.0, 0.0), [(2.0, 2.0)], [4.0], (1.0, 1.0)),
        ((0.0, 0.0), [(1.0, 0.0), (0.0, 1.0)], [0.5, 0.25], (0.5, 0.25)),
        ((0.0, 0.0), [(1.0, 1.0)], [5.0], (3.0, 2.0)),
        ((3.0, -2.0), [(-1.0, 3.0)], [6.5], (-0.5, 2.0)),
        # Parallel lines: the farther one counts; contradicting ones leave nothing.
        ((0.0, 0.0), [(1.0, 0.0), (2.0, 0.0)], [0.5, 2.0], (1.0, 0.0)),
        ((0.0, 0.0), [(1.0, 0.0), (-1.0, 0.0)], [0.5, -0.4], None),
        ((0.0, 0.0), [(1.0, 0.0), (-1.0, 0.0)], [0.5, -0.5], (0.5, 0.0)),
        ((0.0, 0.0), [(1.0, 0.0)], [3.5], None),
        # A constraint whose normal is zero holds at every command or at none.
        ((0.5, 0.5), [(0.0, 0.0)], [-1.0], (0.5, 0.5)),
        ((0.5, 0.5), [(0.0, 0.0)], [1.0], None),
    ],
)
def test_quadratic_programs_by_hand(target, normals, bounds, expected):
    found = nearest_feasible(target, LOW, HIGH, normals, bounds)
    assert found == (None if expected is None else pytest.approx(expected, abs=1e-12))


def least_gaps(circles, pose, wheels, commands) -> np.ndarray:
    """Least gaps (m,) of the braking paths after each command, at their nodes."""
    points = BrakingPaths(ROBOT, pose, wheels, commands, PERIOD).points
    return np.min([abs(points - center) - radius for center, radius in circles], axis=(0, 2)) - RADIUS


def states(count: int, *, seed: int):
    """Circles, pose, wheels and a command that is not safe, while braking is."""
    rng = np.random.default_rng(seed)
    while count:
        wheels = tuple(rng.uniform(2.0, FASTEST, 2).tolist())
        pose = *rng.uniform(-0.5, 0.5, 2), rng.uniform(-math.pi, math.pi)
        circles = [(complex(*rng.uniform(-2.0, 2.0, 2)), rng.uniform(0.1, 0.5)) for _ in range(4)]
        command = tuple(np.clip(wheels + rng.uniform(-0.2, 1.5, 2), -FASTEST, FASTEST).tolist())
        limits = np.minimum(np.maximum(command, np.subtract(wheels, CHANGE)), np.add(wheels, CHANGE))
        brake = tuple(np.clip((0.0, 0.0), np.subtract(wheels, CHANGE), np.add(wheels, CHANGE)).tolist())
        kept, wanted = least_gaps(circles, pose, wheels, [brake, tuple(limits.tolist())])
        if kept > CLEARANCE + 1e-3 and wanted < CLEARANCE - 1e-3:
            count -= 1
            yield circles, pose, wheels, command


def filtered(query, pose, wheels, command, **options):
    return safe_command(
        ROBOT, pose, wheels, command, clearance=CLEARANCE, query=query, period=PERIOD, **options
    )


def test_no_safe_command_within_reach_is_much_nearer(make_query):
    excess = []
    for circles, pose, wheels, command in states(40, seed=1):
        safe = filtered(make_query(circles), pose, wheels, command)
        assert least_gaps(circles, pose, wheels, [safe])[0] > CLEARANCE - 1e-5
        assert np.abs(np.subtract(safe, wheels)).max() <= CHANGE + 1e-12
        axes = [np.linspace(max(w - CHANGE, -FASTEST), min(w + CHANGE, FASTEST), 11) for w in wheels]
        reachable = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        is_safe = least_gaps(circles, pose, wheels, reachable.tolist()) > CLEARANCE + 1e-3
        nearest = np.linalg.norm(reachable[is_safe] - command, axis=1).min(initial=math.inf)
        excess.append(math.dist(safe, command) - nearest)
    # Gaps are not linear in the command, which costs a little in a few states; braking would cost 1 rad/s.
    assert np.mean(np.array(excess) < 0.03) > 0.9
    assert max(excess) < 0.25


def test_where_gaps_are_far_from_linear_a_command_on_the_way_to_braking_is_found(make_query):
    circles = [(-1.006 + 1.016j, 0.267), (0.716 - 0.135j, 0.128), (-0.47 + 0.371j, 0.463)]
    pose, wheels, command = (0.36, 0.477, 3.052), (2.479, 4.424), (2.436, 5.652)
    safe = filtered(make_query(circles), pose, wheels, command)
    assert least_gaps(circles, pose, wheels, [safe])[0] > CLEARANCE
    assert (np.array(safe) > np.array(wheels) - CHANGE + 0.1).all()


def test_a_command_beyond_the_limits_of_the_wheels_counts_as_the_limit(make_query):
    for circles, pose, wheels, command in states(10, seed=4):
        query = make_query(circles)
        for beyond, limit in (
            ((99.0, command[1]), (FASTEST, command[1])),
            ((command[0], 50.0), (command[0], FASTEST)),
        ):
            assert filtered(query, pose, wheels, beyond) == filtered(query, pose, wheels, limit)


def test_a_mirrored_state_has_the_mirrored_command(make_query):
    for circles, pose, wheels, command in states(20, seed=2):
        safe = filtered(make_query(circles), pose, wheels, command)
        mirrored = [(center.conjugate(), radius) for center, radius in circles]
        swapped = filtered(make_query(mirrored), (pose[0], -pose[1], -pose[2]), wheels[::-1], command[::-1])
        np.testing.assert_allclose(swapped, safe[::-1], atol=1e-6)


def test_driving_backward_is_driving_forward_with_the_robot_turned(make_query):
    for circles, (x, y, yaw), wheels, command in states(20, seed=3):
        safe = filtered(make_query(circles), (x, y, yaw), wheels, command)
        back = [tuple(-value for value in pair[::-1]) for pair in (wheels, command, safe)]
        found = filtered(make_query(circles), (x, y, yaw + math.pi), back[0], back[1])
        np.testing.assert_allclose(found, back[2], atol=1e-6)


def cart(speed: float, *, begun: float = 0.0) -> dict:
    """The first circle comes from 1.2 m ahead, at a speed, from a time on."""
    return {0: (np.array([begun, begun + 5.0]), np.array([1.2, 1.2 - 5.0 * speed], dtype=complex))}


@pytest.mark.parametrize("time", [0.0, 3.0])
def test_a_moving_obstacle_counts_where_it_will_be(make_query, time):
    query = make_query([(1.2 + 0.0j, 0.2)])
    forward = (6.0, 6.0)
    options = {"time": time, "pose": (0.0, 0.0, 0.0), "wheels": forward, "command": forward}
    slowed = [filtered(query, moving=cart(speed, begun=time), **options)[0] for speed in (-0.5, 0.0, 0.8)]
    assert slowed[:2] == [6.0, 6.0]
    assert slowed[2] == pytest.approx(6.0 - CHANGE)
    # Before it moves, and once it has arrived, it is a static one.
    for begun in (time + 50.0, time - 50.0):
        path = (np.array([begun, begun + 5.0]), np.array([1.2, 1.2 - 5.0 * 0.8], dtype=complex))
        if begun < time:
            path = (path[0], path[1][::-1])
        assert filtered(query, moving={0: path}, **options) == forward


@pytest.mark.parametrize(
    "wheels", [(0.0, 0.0), (6.0, 5.0), (-7.0, 2.0), (FASTEST, FASTEST), (-1.0, -FASTEST)]
)
@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_obstacles_are_sought_as_far_as_they_and_the_braking_robot_can_come(wheels, speed):
    asked = []

    def query(x, y, distance):
        asked.append((x, y, distance))
        return []

    filtered(query, (0.3, 0.2, 0.0), wheels, (FASTEST, FASTEST), moving=cart(speed) if speed else None)
    fastest = min(max(map(abs, wheels)) + CHANGE, FASTEST) * ROBOT.wheel_radius
    braking = fastest * PERIOD + fastest**2 / (2.0 * ROBOT.max_acceleration)
    moved = speed * (PERIOD + FASTEST / ROBOT.max_wheel_acceleration)
    assert asked == [(0.3, 0.2, pytest.approx(RADIUS + CLEARANCE + braking + moved))]


def test_out_of_reach_of_all_obstacles_any_command_passes(make_query):
    query = make_query([(30.0 + 0.0j, 0.2)])
    assert filtered(query, (0.0, 0.0, 0.0), (0.0, 0.0), (99.0, -99.0)) == (99.0, -99.0)


@pytest.mark.parametrize("gap", [0.01, 0.03])
def test_a_robot_that_begins_too_near_comes_no_nearer(make_query, gap):
    query, pose = make_query(wall=RADIUS + gap), (0.0, 0.0, 0.0)
    np.testing.assert_allclose(filtered(query, pose, (0.0, 0.0), (4.0, 4.0)), 0.0, atol=2e-2)
    left, right = filtered(query, pose, (0.0, 0.0), (-0.2, 0.6))
    # Of the command only the forward part is taken.
    assert left + right == pytest.approx(0.0, abs=2e-2)
    assert right - left == pytest.approx(0.8, abs=5e-2)
    assert filtered(query, pose, (0.0, 0.0), (-4.0, -4.0)) == (-4.0, -4.0)
