"""TipOperator, one step at a time: what it commands, when, and how it switches planes."""

import dataclasses

import numpy as np
import pytest

from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import load_scenario
from drake_shared.scenario.space_path import SpacePath
from drake_shared.systems.tip_operator import TipOperator

CUPS = load_scenario("table_three_cups")
PERIOD = CUPS.control_period
ROUTE = CUPS.routes[0]
PATH = SpacePath(ROUTE.waypoints)
PACE = PATH.length / CUPS.travel_time
CALM = Behaviour(noise=0.0, delay=0.0)
FASTEST = CUPS.robot.max_speed


class Bench:
    """An operator, and the tip where the test holds it."""

    def __init__(self, **changes):
        self.dut = TipOperator(scenario=CUPS)
        self.context = self.dut.CreateDefaultContext()
        behaviour = dataclasses.replace(CALM, **changes)
        self.dut.SetBehaviour(self.context, route=ROUTE, behaviour=behaviour)
        self.count = 0

    def step(self, tip, *, noise=(0.0, 0.0, 0.0), chance=(0.5,) * 5, **inputs) -> np.ndarray:
        """The command after a step in which the tip is at ``tip``."""
        inputs |= {"pose": np.concatenate([tip, CUPS.robot.home]), "noise": noise, "chance": chance}
        for name, value in inputs.items():
            self.dut.GetInputPort(name).FixValue(self.context, value)
        self.context.SetTime(self.count * PERIOD)
        update = self.dut.EvalUniquePeriodicDiscreteUpdate(self.context)
        self.context.get_mutable_discrete_state().SetFrom(update)
        self.count += 1
        return self.command

    @property
    def command(self) -> np.ndarray:
        return self.dut.GetOutputPort("human_command").Eval(self.context).copy()

    @property
    def planes(self) -> list[float]:
        return self.dut.GetOutputPort("planes").Eval(self.context).tolist()


def test_at_the_start_it_rests_and_then_follows_the_route_at_its_pace():
    bench = Bench(speed_factor=1.5)
    assert not bench.command.any()
    assert bench.planes == [0.0, 0.0]
    command = bench.step(PATH.position(0.0))
    along = PATH.position(0.05) - PATH.position(0.0)
    np.testing.assert_allclose(command, 1.5 * PACE * along / np.linalg.norm(along))
    assert bench.planes == [0.0, 0.0]


def test_it_leads_the_tip_back_to_the_route():
    offset = np.array([0.0, 0.02, 0.0])
    back = Bench(skill=0.7).step(PATH.position(0.0) + offset) - Bench().step(PATH.position(0.0))
    np.testing.assert_allclose(back, -0.7 * offset / 0.7, atol=1e-9)


@pytest.mark.parametrize("delay", [0.05, 0.15])
def test_it_answers_what_it_saw_a_delay_ago(delay):
    bench = Bench(delay=delay)
    start = PATH.position(0.0)
    aside = start + np.array([0.0, 0.02, 0.0])
    commands = [bench.step(tip) for tip in (aside, start, start, start, start)]
    answers = [command[1] != commands[-1][1] for command in commands]
    # Before, it remembers the start. The command itself takes effect a period later.
    expected = [False] * 5
    expected[round(delay / PERIOD) - 1] = True
    assert answers == expected


def test_it_starts_late_and_pauses():
    bench = Bench(late_start=0.1, pause_time=0.1, pause=0.15)
    rests = [not bench.step(PATH.position(0.0)).any() for _ in range(9)]
    assert rests == [True] * 2 + [False] * 2 + [True] * 3 + [False] * 2


def test_its_noise_is_of_first_order():
    bench = Bench(noise=0.01, noise_time=0.2)
    keep = np.exp(-PERIOD / 0.2)
    kick = 0.01 * np.sqrt(1.0 - keep**2)
    calm = Bench().step(PATH.position(0.0))
    first = bench.step(PATH.position(0.0), noise=[1.0, -2.0, 3.0]) - calm
    second = bench.step(PATH.position(0.0), noise=[0.0, 0.0, 1.0]) - calm
    np.testing.assert_allclose(first, kick * np.array([1.0, -2.0, 3.0]), atol=1e-12)
    np.testing.assert_allclose(second, keep * first + kick * np.array([0.0, 0.0, 1.0]), atol=1e-12)


def test_chance_repeats_the_last_command_or_draws_a_random_one():
    bench = Bench(lag=0.4, random_share=0.3)
    start = PATH.position(0.0)
    meant = bench.step(start, chance=[0.4, 0.3, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(meant, Bench().step(start))
    drawn = bench.step(start, chance=[0.4, 0.2, 0.0, 0.5, 1.0])
    np.testing.assert_allclose(drawn, [-FASTEST, 0.0, FASTEST])
    np.testing.assert_array_equal(bench.step(start, chance=[0.3, 0.2, 0.5, 0.5, 0.5]), drawn)


def test_it_yields_to_assistance_or_resists_it():
    start = PATH.position(0.0)
    meant = Bench().step(start)
    assert not Bench(yielding=1.0).step(start, human_weight=[0.0]).any()
    np.testing.assert_allclose(Bench(yielding=0.5).step(start, human_weight=[0.6]), 0.8 * meant)
    np.testing.assert_array_equal(Bench(yielding=1.0).step(start), meant)
    bench = Bench(stubbornness=0.5)
    made = [0.01, 0.02, -0.01]
    bench.step(start, shared_command=[0.0, 0.0, 0.0])
    np.testing.assert_allclose(bench.step(start, shared_command=made), meant + 0.5 * (meant - made))


def test_one_plane_at_a_time_it_switches_to_the_third_axis_and_back():
    bench = Bench(plane_switch_time=0.15, aim_ahead=0.08)
    # From the start the route leads down, which the plane x-y cannot do.
    switching = [bench.step(PATH.position(0.0)) for _ in range(4)]
    assert [bool(command.any()) for command in switching] == [False, False, False, True]
    assert bench.planes == [1.0, 1.0]
    assert switching[-1][2] < switching[-1][0] == 0.0
    # Now only x is wrong.
    aside = PATH.position(0.16) - [0.05, 0.0, 0.0]
    switching = [bench.step(aside) for _ in range(4)]
    assert [bool(command.any()) for command in switching] == [False, False, False, True]
    assert bench.planes == [0.0, 2.0]
    assert switching[-1][0] > switching[-1][2] == 0.0


def test_it_aims_at_a_point_ahead_by_all_axes_at_once():
    bench = Bench(aim_ahead=0.1)
    command = bench.step(PATH.position(0.0))
    error = PATH.position(0.1) - PATH.position(0.0)
    np.testing.assert_allclose(np.cross(command, error), 0.0, atol=1e-12)
    assert command @ error > 0.0
    assert bench.planes == [0.0, 0.0]


def test_no_command_is_faster_than_the_tip():
    command = Bench(speed_factor=50.0).step(PATH.position(0.0))
    assert np.linalg.norm(command) == pytest.approx(FASTEST)


def test_another_robot_is_refused(scenario):
    with pytest.raises(InputError) as caught:
        TipOperator(scenario=scenario)
    assert caught.value.field == "robot"
