"""Robots that other packages register: what they must be made as."""

from types import SimpleNamespace

import pytest

from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.systems.diff_drive_plant import DiffDrivePlant
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.robots import make_robot, registered_robots

ROBOT = DiffDrive()
PLANT = DiffDrivePlant(robot=ROBOT)


@pytest.fixture
def register(monkeypatch):
    """Registers a function that makes something, under the name "rover"."""

    def register(made):
        point = SimpleNamespace(name="rover", value="rovers:make", load=lambda: lambda **_: made)
        monkeypatch.setattr(
            "drake_shared.common.entry_points.entry_points",
            lambda *, group: [point] if group == "drake_shared.robots" else [],
        )

    return register


def test_a_robot_and_its_plant_are_found_by_name(register, scenario):
    register((ROBOT, PLANT))
    assert registered_robots() == ["rover"]
    assert make_robot("rover", scenario=scenario) == (ROBOT, PLANT)


@pytest.mark.parametrize(
    "made",
    [None, ROBOT, [ROBOT, PLANT], (ROBOT,), (ROBOT, PLANT, PLANT), (PLANT, ROBOT), (ROBOT, RecordedInput())],
)
def test_anything_else_is_refused(register, scenario, made):
    register(made)
    with pytest.raises(InputError):
        make_robot("rover", scenario=scenario)
