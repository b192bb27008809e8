"""The agent alone among obstacles through which its learner's prediction leads."""

import dataclasses

import pytest

from drake_shared.scenario import Circle
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.trial import Simulation, TrialSettings

STANDING = Circle(name="new", x=2.0, y=0.05, radius=0.2)
# On the straight way at 6 s, when the robot is there.
CROSSING = Circle(name="new", x=2.2, y=1.4, radius=0.2, path=[[0.0, 2.2, 1.4], [12.0, 2.2, -1.4]])


@pytest.fixture
def drive(open_floor, route_learner):
    """The agent's trial over four metres straight ahead, past an obstacle that the learner never met."""

    def trial(obstacle, **config):
        learner = route_learner(open_floor)
        scenario = dataclasses.replace(open_floor, obstacles=[obstacle])
        config = SharedControlConfig(driver="agent", **config)
        return Simulation(scenario, learner=learner, config=config).run(TrialSettings())

    return trial


@pytest.mark.parametrize("obstacle", [STANDING, CROSSING], ids=["standing", "crossing"])
def test_the_agent_passes_an_obstacle_that_it_knows(drive, obstacle):
    assert drive(obstacle, path_repair=False)["contact"].any()
    trial = drive(obstacle)
    assert not trial["contact"].any()
    assert trial.status == "reached"


def test_the_agent_does_not_see_an_obstacle_that_is_not_mapped(drive):
    unmapped = dataclasses.replace(STANDING, mapped=False)
    assert drive(unmapped)["contact"].any()
    assert not drive(unmapped, safety_clearance=0.05)["contact"].any()


def test_control_goes_back_to_the_human_where_a_prediction_had_to_be_moved_far(drive):
    beside = dataclasses.replace(STANDING, y=1.5)
    before = slice(0, 20)
    assert (drive(STANDING)["confidence"][before] < drive(beside)["confidence"][before]).all()
