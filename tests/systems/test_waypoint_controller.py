"""WaypointController: where its commands lead."""

import math

import numpy as np
import pytest
from pydrake.common.value import Value

from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.robots.motion import motion
from drake_shared.systems.intention import Intention, empty_intention
from drake_shared.systems.waypoint_controller import WaypointController

ROBOT = DiffDrive()


def going_to(x: float, y: float, *, time: float = 0.0) -> Intention:
    """Someone who is expected to stand at (x, y) from now on."""
    times = np.arange(0.0, 15.05, 0.1)
    first = min(int(np.searchsorted(times, time + 1e-9, side="right")), len(times) - 1)
    mean = np.full((len(times), 2), math.nan)
    mean[first:] = x, y
    return Intention(time=time, times=times, mean=mean, variance=np.ones_like(mean), first=first)


def command(pose, intention, **options) -> tuple[float, float]:
    dut = WaypointController(robot=ROBOT, **options)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("pose").FixValue(context, pose)
    dut.GetInputPort("intention").FixValue(context, Value(intention))
    return tuple(dut.GetOutputPort("autonomous_command").Eval(context).tolist())


def test_straight_ahead_both_wheels_turn_alike_and_are_there_in_time():
    left, right = command([0, 0, 0], going_to(0.3, 0.0), look_ahead=0.6)
    assert left == pytest.approx(right)
    assert ROBOT.twist(left, right) == pytest.approx((0.5, 0.0))


@pytest.mark.parametrize("look_ahead", [0.5, 0.6, 1.2])
@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (1.0, -2.0, 2.5), (0.0, 0.0, -9.0)])
@pytest.mark.parametrize("bearing", [-1.2, -0.3, -1e-8, 1e-5, 0.1, 0.7, 1.0])
def test_the_arc_of_the_command_lands_on_the_waypoint(pose, bearing, look_ahead):
    x = pose[0] + 0.1 * math.cos(pose[2] + bearing)
    y = pose[1] + 0.1 * math.sin(pose[2] + bearing)
    wheels = command(pose, going_to(x, y), look_ahead=look_ahead)
    *_, end = motion(ROBOT, pose, wheels, wheels, look_ahead)
    assert end[:2] == pytest.approx((x, y), abs=1e-12)


def test_a_waypoint_to_the_left_is_a_turn_to_the_left():
    left, right = command([0, 0, 0], going_to(0.2, 0.1))
    assert right > left
    assert command([0, 0, 0], going_to(0.2, -0.1)) == pytest.approx((right, left))


@pytest.mark.parametrize(("y", "turn"), [(0.1, 1), (-0.1, -1)])
def test_to_a_waypoint_behind_it_turns_on_the_spot_the_short_way(y, turn):
    left, right = command([0, 0, 0], going_to(-0.3, y))
    assert left == pytest.approx(-right)
    assert turn * right > 0


def test_turning_world_and_robot_together_changes_nothing():
    rng = np.random.default_rng(1)
    for _ in range(20):
        target, angle = rng.uniform(-1, 1, 2), rng.uniform(-7, 7)
        turned = [
            math.cos(angle) * target[0] - math.sin(angle) * target[1],
            math.sin(angle) * target[0] + math.cos(angle) * target[1],
        ]
        plain = command([0, 0, 0], going_to(*target))
        assert command([0, 0, angle], going_to(*turned)) == pytest.approx(plain, abs=1e-9)


@pytest.mark.parametrize("target", [(30.0, 0.0), (30.0, 20.0), (0.1, 9.0), (-5.0, 0.01), (-3.0, -3.0)])
def test_never_more_than_the_wheels_can_do(target):
    wheels = command([0, 0, 0], going_to(*target))
    assert max(map(abs, wheels)) <= ROBOT.max_wheel_speed * (1 + 1e-12)


def test_a_waypoint_too_far_for_the_time_keeps_its_arc():
    near = ROBOT.twist(*command([0, 0, 0], going_to(0.2, 0.1)))
    far = ROBOT.twist(*command([0, 0, 0], going_to(20.0, 10.0)))
    assert far[1] / far[0] == pytest.approx(near[1] / near[0] / 100)


def test_at_the_waypoint_it_stands_still():
    assert command([1.0, 1.0, 0.3], going_to(1.005, 1.0)) == (0.0, 0.0)


@pytest.mark.parametrize(
    "intention",
    [empty_intention(2), going_to(math.nan, 0.0), going_to(0.0, math.nan), going_to(math.inf, 0.0)],
)
def test_an_intention_of_nan_gives_a_command_of_nan(intention):
    assert all(map(math.isnan, command([0, 0, 0], intention)))


def test_takes_the_position_a_look_ahead_after_now():
    times = np.arange(0.0, 15.05, 0.1)
    mean = np.stack([0.5 * times, np.zeros_like(times)], axis=-1)
    mean[times <= 3.0] = math.nan
    now = Intention(time=3.0, times=times, mean=mean, variance=mean, first=31)
    for look_ahead in (0.1, 0.25, 0.6):
        speed, _ = ROBOT.twist(*command([1.5, 0, 0], now, look_ahead=look_ahead))
        assert speed == pytest.approx(0.5)


def test_positions_are_interpolated_between_the_times_of_the_grid_and_held_at_its_ends():
    intention = Intention(
        time=1.0,
        times=np.arange(5.0),
        mean=np.array([[math.nan] * 2, [math.nan] * 2, [2.0, 0.0], [4.0, 1.0], [5.0, 5.0]]),
        variance=np.ones((5, 2)),
        first=2,
    )
    assert intention.position_at(2.5) == pytest.approx((3.0, 0.5))
    assert intention.position_at(3.0) == (4.0, 1.0)
    assert intention.position_at(1.2) == (2.0, 0.0)
    assert intention.position_at(99.0) == (5.0, 5.0)
    with pytest.warns(DeprecationWarning, match="position_at") as caught:
        assert intention.position(2.5) == intention.position_at(2.5)
    assert caught[0].filename == __file__  # It tells where the former name is used.


def test_feeds_through_without_state():
    dut = WaypointController(robot=ROBOT)
    assert dut.HasAnyDirectFeedthrough()
    assert dut.CreateDefaultContext().num_total_states() == 0


@pytest.mark.parametrize("look_ahead", [0.0, -0.6, math.nan, math.inf])
def test_a_look_ahead_out_of_range_is_refused(look_ahead):
    with pytest.raises(InputError) as caught:
        WaypointController(robot=ROBOT, look_ahead=look_ahead)
    assert caught.value.field == "look_ahead"


def test_something_other_than_a_robot_is_refused():
    with pytest.raises(InputError) as caught:
        WaypointController(robot=None)
    assert caught.value.source == "robot"
