"""The contract of a plant: the ports by which a shared-control loop drives a robot.

A plant is a LeafSystem with these ports; M is the size of the robot's command (see
`drake_shared.robots.Robot`):

==================  ======================================  ==============================================
input ``command``   (M)                                     Command, in the robot's units. A differential
                                                            drive may call it ``wheel_command``.
input               abstract, optional                      QueryObject of the SceneGraph with the
``geometry_query``                                          obstacles.
output ``pose``     (size of ``configuration_names``)       Configuration. State.
output ``speed``    (size of ``speed_names``)               The robot's own speeds, for the log. State. A
                                                            differential drive may call it ``wheel_speed``.
output ``contact``  (1), optional                           1 if the body touched an obstacle in the step
                                                            that led here, else 0.
output              (1), optional                           Distance of the body to the nearest obstacle,
``clearance``                                               in [m]; infinite without obstacles.
==================  ======================================  ==============================================

No output may have direct feedthrough from the command, which would close an algebraic loop.
"""

from __future__ import annotations

import dataclasses

from pydrake.systems.framework import InputPort, LeafSystem, OutputPort

from drake_shared.common.errors import InputError
from drake_shared.robots import Robot
from drake_shared.systems.ports import check_ports


@dataclasses.dataclass(frozen=True, kw_only=True)
class PlantPorts:
    """The ports of a plant; the optional ones are None where the plant does not have them."""

    command: InputPort
    geometry_query: InputPort | None
    pose: OutputPort
    speed: OutputPort
    contact: OutputPort | None
    clearance: OutputPort | None


def plant_ports(plant: LeafSystem, robot: Robot) -> PlantPorts:
    """Checks that ``plant`` fulfils the contract for ``robot``, and finds its ports.

    Raises:
        InputError: A port is missing, has another size, or has direct feedthrough from the command.
    """
    check_ports(plant, "plant")
    command = "wheel_command" if plant.HasInputPort("wheel_command") else "command"
    speed = "wheel_speed" if plant.HasOutputPort("wheel_speed") else "speed"
    optional = [name for name in ("contact", "clearance") if plant.HasOutputPort(name)]
    outputs = {"pose": len(robot.configuration_names), speed: len(robot.speed_names)}
    check_ports(
        plant,
        "plant",
        inputs={command: len(robot.command_names)},
        outputs={**outputs, **dict.fromkeys(optional, 1)},
    )
    ports = PlantPorts(
        command=plant.GetInputPort(command),
        geometry_query=plant.GetInputPort("geometry_query") if plant.HasInputPort("geometry_query") else None,
        pose=plant.GetOutputPort("pose"),
        speed=plant.GetOutputPort(speed),
        contact=plant.GetOutputPort("contact") if "contact" in optional else None,
        clearance=plant.GetOutputPort("clearance") if "clearance" in optional else None,
    )
    for port in (ports.pose, ports.speed, ports.contact, ports.clearance):
        if port is not None and plant.HasDirectFeedthrough(ports.command.get_index(), port.get_index()):
            source = f"plant {type(plant).__name__}"
            raise InputError(source, port.get_name(), f"must not have direct feedthrough from {command}")
    return ports
