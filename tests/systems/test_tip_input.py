"""A person's input for the tip of an arm: three axes, two planes."""

import dataclasses
import math

import numpy as np
import pytest

from drake_shared.robots import Arm, DiffDrive
from drake_shared.systems.mouse_input import MouseInput, MouseSample, StickSettings
from drake_shared.systems.operators import check_operator
from drake_shared.systems.tip_input import TipInput, make_mouse_input

ARM = Arm()
FULL = ARM.max_speed


class FakeDriver:
    def __init__(self):
        self.sample = MouseSample(
            engaged=True, engagement=1, arrival=100.0, stick=StickSettings(gain=0.01, dead_zone=0.0)
        )

    def latest(self) -> MouseSample:
        return self.sample


@pytest.fixture
def bench():
    driver = FakeDriver()
    dut = TipInput(robot=ARM, source=driver, clock=lambda: 100.0)
    context = dut.CreateDefaultContext()

    def step(**changes) -> tuple[np.ndarray, np.ndarray]:
        driver.sample = dataclasses.replace(driver.sample, **changes)
        update = dut.EvalUniquePeriodicDiscreteUpdate(context)
        context.get_mutable_discrete_state().SetFrom(update)
        command, planes = (dut.GetOutputPort(name).Eval(context) for name in ("human_command", "planes"))
        return command.copy(), planes.copy()

    return step


def test_it_fulfils_the_contract_of_operators():
    check_operator(TipInput(robot=ARM, source=FakeDriver()), ARM)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"forward": 1.0}, [FULL, 0, 0]),
        ({"turn": 1.0}, [0, FULL, 0]),
        ({"up": -1.0}, [0, 0, -FULL]),
        ({"forward": 1.0, "vertical": True}, [0, 0, FULL]),
        ({"turn": -1.0, "vertical": True}, [0, -FULL, 0]),
        ({"up": 1.0, "braking": True}, [0, 0, 0]),
        ({"up": 1.0, "engaged": False}, [0, 0, 0]),
        ({"up": math.nan}, [0, 0, 0]),
        ({"up": 1.0, "arrival": 0.0}, [0, 0, 0]),
    ],
)
def test_each_axis_moves_the_tip(bench, changes, expected):
    np.testing.assert_allclose(bench(**changes)[0], expected, atol=1e-12)


def test_the_mouse_moves_the_stick_in_the_plane(bench):
    bench(x=0.0, y=0.0)
    command, _ = bench(x=-30.0, y=-20.0)
    np.testing.assert_allclose(command, [0.2 * FULL, 0.3 * FULL, 0.0])


def test_all_axes_together_are_within_the_speed_of_the_tip(bench):
    command, _ = bench(forward=1.0, turn=1.0, up=1.0)
    assert np.linalg.norm(command) == pytest.approx(FULL)
    assert command == pytest.approx(np.full(3, FULL / math.sqrt(3)))


def test_switches_of_the_plane_are_counted(bench):
    planes = [bench(vertical=vertical)[1].tolist() for vertical in (False, True, True, False, True)]
    assert planes == [[0, 0], [1, 1], [1, 1], [0, 2], [1, 3]]


def test_each_robot_gets_its_own_input():
    assert type(make_mouse_input(ARM, FakeDriver())) is TipInput
    assert type(make_mouse_input(DiffDrive(), FakeDriver())) is MouseInput
