"""Obstacles on given paths, met by the kinematic and by the dynamic robot."""

import dataclasses

import numpy as np
import pytest

from drake_shared.analysis.replay import write_replay
from drake_shared.common.errors import InputError
from drake_shared.scenario import check_scenario, scenario_from_dict
from drake_shared.scenario.obstacles import Circle, position_at
from drake_shared.simulation.config import config_for
from drake_shared.simulation.trial import Simulation, TrialSettings, read_log, write_log
from drake_shared.systems.recorded_input import RecordedInput

# Comes straight at a robot that stands at the origin: they meet after (2 - 0.2 - 0.267) / 0.5 s.
PATH = [[0.0, 2.0, 0.0], [6.0, -1.0, 0.0]]
MEETING = (2.0 - 0.2 - 0.267) / 0.5


def cart(path) -> Circle:
    return Circle(name="cart", x=path[0][1], y=path[0][2], radius=0.2, path=path)


def stand(scenario, plant: str, path):
    """A trial of 6 s in which nothing is commanded."""
    scenario.plant, scenario.duration, scenario.obstacles = plant, 6.0, [cart(path)]
    check_scenario(scenario)
    return Simulation(scenario, operator=RecordedInput(), config=config_for(None, end="duration")).run(
        TrialSettings()
    )


def test_is_on_its_path_and_rests_at_the_ends():
    path = [[1.0, 2.0, 0.0], [3.0, 4.0, 1.0]]
    assert position_at(cart(path), 0.0) == (2.0, 0.0)
    assert position_at(cart(path), 2.0) == (3.0, 0.5)
    assert position_at(cart(path), 9.0) == (4.0, 1.0)


@pytest.mark.parametrize("plant", ["kinematic", "dynamic"])
def test_hits_a_robot_that_stands_in_its_way(open_floor, plant):
    trial = stand(open_floor, plant, PATH)
    first = trial["t"][np.argmax(trial["contact"])]
    assert trial["contact"].any()
    assert MEETING - 1e-3 <= first <= MEETING + 0.051
    before = trial["t"] < MEETING - 0.051
    gap = 2.0 - 0.5 * trial["t"][before] - 0.467
    np.testing.assert_allclose(trial["clearance"][before], gap, rtol=0, atol=1e-3)
    # The kinematic robot lets it through, the dynamic one is pushed.
    assert (trial["x"][-1] < -0.5) == (plant == "dynamic")


@pytest.mark.parametrize("plant", ["kinematic", "dynamic"])
def test_passes_a_robot_beside_its_way(open_floor, plant):
    trial = stand(open_floor, plant, [[t, x, 0.8] for t, x, _ in PATH])
    assert not trial["contact"].any()
    assert trial["clearance"].min() == pytest.approx(0.8 - 0.467, abs=2e-3)


def test_lasts_in_a_log_and_shows_in_a_replay(open_floor, tmp_path):
    trial = stand(open_floor, "kinematic", PATH)
    write_log(trial, tmp_path / "log.parquet")
    back = read_log(tmp_path / "log.parquet")
    assert scenario_from_dict(back.metadata["scenario"]) == open_floor
    write_replay(back, tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size > 1e5


def test_x_and_y_may_be_left_to_the_path(open_floor):
    data = dataclasses.asdict(open_floor)
    data["obstacles"] = [{"name": "cart", "radius": 0.2, "path": PATH}]
    assert scenario_from_dict(data).obstacles == [cart(PATH)]


@pytest.mark.parametrize(
    "path",
    [
        [[0.0, 0.3, 0.0], [5.0, 3.0, 0.0]],  # Starts on the robot.
        [[0.0, 2.0, 0.0], [0.0, 3.0, 0.0]],  # Its times do not increase.
        [[0.0, 2.0, 0.0], [5.0, 3.0]],
        [[-1.0, 2.0, 0.0], [1.0, 3.0, 0.0]],  # Is elsewhere than x and y at time 0.
    ],
)
def test_an_impossible_path_is_refused(open_floor, path):
    open_floor.obstacles = [cart(path)]
    with pytest.raises(InputError) as caught:
        check_scenario(open_floor)
    assert caught.value.field == "obstacles: cart: path"
