"""MouseInput with a fake source and a fake clock, one update at a time."""

import dataclasses
import math

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.systems.mouse_input import MouseInput, MouseSample, StickSettings

PERIOD = 0.005


class FakeDriver:
    """A source and a clock; the test sets the newest sample and the time."""

    def __init__(self, **sample):
        self.now = 100.0
        self.sample = MouseSample(arrival=self.now, **sample)

    def latest(self) -> MouseSample:
        return self.sample

    def clock(self) -> float:
        return self.now

    def set(self, **changes) -> None:
        self.sample = dataclasses.replace(self.sample, arrival=self.now, **changes)


class Bench:
    """A MouseInput and its Context."""

    def __init__(self, driver: FakeDriver, **options):
        self.driver = driver
        self.robot = DiffDrive()
        self.dut = MouseInput(robot=self.robot, source=driver, clock=driver.clock, **options)
        self.context = self.dut.CreateDefaultContext()

    def step(self, count: int = 1, **changes) -> "Bench":
        if changes:
            self.driver.set(**changes)
        for _ in range(count):
            update = self.dut.EvalUniquePeriodicDiscreteUpdate(self.context)
            self.context.get_mutable_discrete_state().SetFrom(update)
        return self

    @property
    def command(self) -> np.ndarray:
        return self.dut.GetOutputPort("human_command").Eval(self.context).copy()

    @property
    def twist(self) -> tuple[float, float]:
        return self.robot.twist(*self.command)

    @property
    def mouse(self) -> dict[str, float]:
        names = ("x", "y", "age", "forward", "left", "engaged")
        return dict(zip(names, self.dut.GetOutputPort("mouse").Eval(self.context), strict=True))


@pytest.fixture
def bench() -> Bench:
    no_dead_zone = StickSettings(gain=0.01, dead_zone=0.0)
    return Bench(FakeDriver(engaged=True, engagement=1, stick=no_dead_zone), max_speed=0.8, max_yaw_rate=1.5)


def test_a_push_away_drives_forward_and_a_push_to_the_right_turns_right(bench):
    bench.step(y=-50)
    assert bench.twist == pytest.approx((0.4, 0.0))
    bench.step(x=20)
    assert bench.twist == pytest.approx((0.4, -0.3))


def test_a_pull_towards_the_driver_drives_backward(bench):
    bench.step(y=100)
    assert bench.twist == pytest.approx((-0.8, 0.0))


def test_the_command_is_state_without_direct_feedthrough(bench):
    assert not bench.dut.HasAnyDirectFeedthrough()
    bench.driver.set(y=-50)
    np.testing.assert_array_equal(bench.command, [0, 0])
    bench.step()
    assert np.all(bench.command > 0)


def test_updates_every_period():
    dut = Bench(FakeDriver(), period=PERIOD).dut
    timing = dut.GetUniquePeriodicDiscreteUpdateAttribute()
    assert (timing.period_sec(), timing.offset_sec()) == (PERIOD, 0.0)


def test_the_stick_keeps_its_deflection_while_engaged(bench):
    bench.step(y=-50)
    held = bench.command
    for _ in range(40):
        bench.step(y=-50)
    np.testing.assert_array_equal(bench.command, held)


def test_merged_mouse_moves_lose_no_displacement(bench):
    one_by_one, merged = bench, Bench(FakeDriver(engaged=True, engagement=1, stick=bench.driver.sample.stick))
    for count in range(1, 31):
        one_by_one.step(y=-count, x=2 * count)
    merged.step(y=-30, x=60)
    np.testing.assert_allclose(one_by_one.command, merged.command, atol=1e-12)
    assert one_by_one.mouse == pytest.approx(merged.mouse)


def test_the_stick_is_clipped_so_that_a_move_back_takes_effect_immediately(bench):
    bench.step(y=-250)
    assert bench.mouse["forward"] == 1.0
    bench.step(y=-200)
    assert bench.mouse["forward"] == pytest.approx(0.5)


def test_the_displacement_of_one_sample_is_limited():
    stick = StickSettings(gain=0.001, dead_zone=0.0)
    bench = Bench(FakeDriver(engaged=True, engagement=1, stick=stick), max_displacement=100.0)
    bench.step(x=5000, y=-90)
    assert bench.mouse["left"] == pytest.approx(-0.1)
    assert bench.mouse["forward"] == pytest.approx(0.09)
    assert bench.mouse["x"] == 5000


def test_by_default_a_third_of_the_full_stick_is_100_counts_less_the_dead_zone():
    bench = Bench(FakeDriver(engaged=True, engagement=1)).step(x=-100, y=-100)
    assert bench.mouse["forward"] == bench.mouse["left"] == pytest.approx(0.3)
    assert bench.twist == pytest.approx((0.8 * 0.25 / 0.95, 1.5 * 0.25 / 0.95))
    # The stick keeps its place; a jump of the mouse counts as at most 300.
    assert bench.step(40, x=5000).mouse["left"] == pytest.approx(-0.6)
    assert bench.mouse["forward"] == pytest.approx(0.3)


def test_the_deflection_is_zero_in_the_dead_zone_and_reaches_one_outside_it():
    stick = StickSettings(gain=0.01, dead_zone=0.2)
    bench = Bench(FakeDriver(engaged=True, engagement=1, stick=stick), max_speed=1.0)
    assert bench.step(y=-20).twist[0] == 0.0
    assert bench.step(y=-60).twist[0] == pytest.approx(0.5)
    assert bench.step(y=-100).twist[0] == pytest.approx(1.0)
    assert bench.step(y=60).twist[0] == pytest.approx(-0.5)


def test_the_stick_returns_from_full_deflection_to_the_centre_in_the_return_time(bench):
    bench.step(y=-100, stick=StickSettings(gain=0.01, dead_zone=0.0, return_time=0.4))
    assert bench.mouse["forward"] == 1.0
    bench.step(count=40)
    assert bench.mouse["forward"] == pytest.approx(0.5)
    bench.step(count=41)
    assert bench.twist == (0.0, 0.0)


def test_settings_take_effect_while_driving(bench):
    bench.step(y=-10)
    bench.step(stick=StickSettings(gain=0.02, dead_zone=0.0), y=-20)
    assert bench.mouse["forward"] == pytest.approx(0.1 + 0.2)


def test_keys_and_gamepad_are_added_to_the_stick(bench):
    assert bench.step(forward=0.5, turn=1.0).twist == pytest.approx((0.4, 1.5))
    assert bench.step(y=-25).mouse["forward"] == pytest.approx(0.75)
    assert bench.step(y=-100).mouse["forward"] == 1.0
    bench.step(forward=0.0, turn=0.0)
    assert bench.twist == pytest.approx((0.8, 0.0))


def test_the_wheels_limit_scales_speed_and_yaw_rate_by_the_same_factor():
    driver = FakeDriver(engaged=True, engagement=1, forward=1.0, turn=1.0)
    bench = Bench(driver, max_speed=2.0, max_yaw_rate=3.0).step()
    speed, yaw_rate = bench.twist
    assert max(abs(bench.command)) == pytest.approx(bench.robot.max_wheel_speed)
    assert speed / yaw_rate == pytest.approx(2.0 / 3.0)


def test_the_command_is_zero_while_nobody_is_engaged():
    bench = Bench(FakeDriver(engaged=False, y=-500, forward=1.0)).step(count=5)
    np.testing.assert_array_equal(bench.command, [0, 0])
    assert bench.mouse["engaged"] == 0


def test_before_the_first_sample_the_log_shows_a_minute_of_rest():
    driver = FakeDriver()
    driver.sample = MouseSample()
    bench = Bench(driver)
    rest = {"x": 0.0, "y": 0.0, "age": 60.0, "forward": 0.0, "left": 0.0, "engaged": 0.0}
    assert bench.mouse == rest
    assert bench.step().mouse == rest
    np.testing.assert_array_equal(bench.command, [0, 0])


def test_release_zeroes_the_command_at_the_next_sample_and_centres_the_stick(bench):
    bench.step(y=-80)
    bench.step(engaged=False)
    np.testing.assert_array_equal(bench.command, [0, 0])
    bench.step(engaged=True)
    np.testing.assert_array_equal(bench.command, [0, 0])


def test_the_command_of_a_sample_older_than_150_ms_is_zero(bench):
    bench.step(y=-80)
    bench.driver.now += 0.149
    assert np.all(bench.step().command > 0)
    bench.driver.now += 0.002
    np.testing.assert_array_equal(bench.step().command, [0, 0])
    assert bench.mouse["age"] == pytest.approx(0.151)


def test_a_sample_that_arrives_after_the_clock_was_read_has_no_age(bench):
    bench.driver.sample = dataclasses.replace(bench.driver.sample, y=-80, arrival=bench.driver.now + 0.01)
    assert np.all(bench.step().command > 0)
    assert bench.mouse["age"] == 0.0


def test_after_a_gap_the_stick_follows_the_total_displacement(bench):
    bench.step(y=-80)
    bench.driver.now += 0.3
    np.testing.assert_array_equal(bench.step().command, [0, 0])
    bench.step(y=-30)
    assert bench.twist == pytest.approx((0.3 * 0.8, 0.0))


def test_a_new_engagement_starts_at_the_centre_with_its_own_origin(bench):
    bench.step(y=-80)
    bench.step(engagement=2, x=0, y=0)
    np.testing.assert_array_equal(bench.command, [0, 0])
    fresh = Bench(FakeDriver(engaged=True, engagement=7, stick=bench.driver.sample.stick))
    assert fresh.step(y=-3).mouse["forward"] == pytest.approx(0.03)


def test_centring_brings_both_axes_back_and_keeps_the_engagement(bench):
    bench.step(x=-40, y=-80)
    centred = bench.step(centrings=1).mouse
    assert (centred["forward"], centred["left"], centred["engaged"]) == (0.0, 0.0, 1.0)
    assert bench.step(y=-83).mouse["forward"] == pytest.approx(0.03)


@pytest.mark.parametrize("field", ["x", "y", "forward", "turn"])
def test_nan_in_a_sample_does_not_remain_in_the_state(bench, field):
    bench.step(**{field: math.nan})
    np.testing.assert_array_equal(bench.command, [0, 0])
    bench.step(**{field: 0.0})
    assert bench.step(y=-10).mouse["forward"] == pytest.approx(0.1)


def test_a_new_context_does_not_depend_on_the_last_trial(bench):
    bench.step(y=-80)
    bench.context = bench.dut.CreateDefaultContext()
    np.testing.assert_array_equal(bench.command, [0, 0])
    assert bench.mouse["forward"] == 0


@pytest.mark.parametrize("name", ["max_speed", "max_yaw_rate", "period", "stale_after", "max_displacement"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_parameters_out_of_range_are_refused(name, value):
    with pytest.raises(InputError) as caught:
        Bench(FakeDriver(), **{name: value})
    assert caught.value.field == name


def idle_time(bench: Bench) -> float:
    return bench.dut.GetOutputPort("idle_time").Eval(bench.context).item()


@pytest.mark.parametrize(
    "event", [{"x": 1.0}, {"y": -1.0}, {"forward": 0.2}, {"turn": -0.5}, {"engagement": 2}]
)
def test_idle_time_counts_from_the_last_event_and_not_from_the_last_sample(event):
    bench = Bench(FakeDriver(engaged=True, engagement=1)).step()
    for _ in range(10):
        bench.step(20)
        bench.driver.set()  # A new sample without an event.
    assert idle_time(bench) == pytest.approx(200 * PERIOD)
    assert idle_time(bench.step(**event)) == 0.0
    assert idle_time(bench.step(4)) == pytest.approx(4 * PERIOD)


def test_idle_time_is_infinite_before_the_first_event():
    bench = Bench(FakeDriver())
    assert idle_time(bench.step(4)) == math.inf
    bench.step(engaged=True, engagement=1)
    assert idle_time(bench) == 0.0
    assert idle_time(bench.step(3)) == pytest.approx(3 * PERIOD)


def test_an_engagement_at_the_start_is_an_event():
    bench = Bench(FakeDriver(engaged=True, engagement=3))
    assert idle_time(bench) == math.inf
    assert idle_time(bench.step()) == 0.0


def test_full_deflection_scales_with_the_robot():
    small = DiffDrive(footprint_radius=0.0267, wheel_radius=0.00975, track=0.033, max_speed=0.12)
    one, other = (MouseInput(robot=robot, source=FakeDriver()) for robot in (DiffDrive(), small))
    assert one.max_speed == pytest.approx(0.8)
    assert other.max_speed == pytest.approx(0.08)


def test_noise_of_a_gamepad_inside_the_dead_zone_is_not_an_event():
    bench = Bench(FakeDriver(engaged=True, engagement=1, stick=StickSettings(dead_zone=0.1)))
    bench.step(forward=1.0).step(forward=0.0)
    for index in range(1, 6):
        bench.step(forward=0.09 * (-1) ** index, turn=0.05 * (-1) ** index)
        assert idle_time(bench) == pytest.approx(index * PERIOD)
    assert idle_time(bench.step(turn=0.2)) == 0.0
