"""The contract of plants."""

import numpy as np
import pytest
from pydrake.systems.framework import LeafSystem

from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.simulation import MakeSharedControlDiagram
from drake_shared.systems.diff_drive_plant import DiffDrivePlant
from drake_shared.systems.plant import plant_ports

ROBOT = DiffDrive()


class Plant(LeafSystem):
    """A plant that does not move, with ports to be varied."""

    def __init__(self, *, command: str = "command", speed: str = "speed", sizes=(2, 3, 2), instant=False):
        super().__init__()
        self.DeclareVectorInputPort(command, sizes[0])
        self.DeclareStateOutputPort("pose", self.DeclareDiscreteState(np.zeros(sizes[1])))
        if instant:
            self.DeclareVectorOutputPort(speed, sizes[2], lambda context, output: None)
        else:
            self.DeclareStateOutputPort(speed, self.DeclareDiscreteState(np.zeros(sizes[2])))


def test_optional_ports_may_be_missing():
    ports = plant_ports(Plant(), ROBOT)
    assert ports.geometry_query is ports.contact is ports.clearance is None


def test_the_differential_drive_has_every_port():
    plant = DiffDrivePlant(robot=ROBOT)
    ports = plant_ports(plant, ROBOT)
    assert ports.command.get_name() == "wheel_command"
    assert ports.speed.get_name() == "wheel_speed"
    assert None not in (ports.geometry_query, ports.contact, ports.clearance)


@pytest.mark.parametrize(
    ("plant", "field"),
    [
        (Plant(command="torque"), "command"),
        (Plant(speed="rate"), "speed"),
        (Plant(sizes=(3, 3, 2)), "command"),
        (Plant(sizes=(2, 2, 2)), "pose"),
        (Plant(sizes=(2, 3, 1)), "speed"),
        (Plant(instant=True), "speed"),
    ],
)
def test_a_plant_that_breaks_the_contract_is_refused(plant, field):
    with pytest.raises(InputError) as caught:
        plant_ports(plant, ROBOT)
    assert caught.value.source == "plant Plant"
    assert caught.value.field == field


class Sailing(Plant):
    """Has an input that no diagram connects."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorInputPort("wind", 1)


@pytest.mark.parametrize(("plant", "field"), [(Sailing(), "wind"), (3, "")])
def test_a_plant_that_does_not_fit_is_refused_when_it_is_wired(scenario, plant, field):
    with pytest.raises(InputError) as caught:
        MakeSharedControlDiagram(scenario, plant=plant)
    assert caught.value.source == f"plant {type(plant).__name__}"
    assert caught.value.field == field
