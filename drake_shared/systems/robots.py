"""Robots that other packages register, each with its plant.

A robot from outside is registered under its name in the entry point group ``drake_shared.robots``, as a
function ``make_robot(*, scenario, period) -> (robot, plant)``. The robot fulfils
`drake_shared.robots.Robot`; `drake_shared.systems.plant` says which ports its plant has.
"""

from __future__ import annotations

from pydrake.systems.framework import LeafSystem

from drake_shared.common.entry_points import make_registered, registered_names
from drake_shared.common.errors import InputError
from drake_shared.robots import Robot, check_robot
from drake_shared.scenario import Scenario
from drake_shared.systems.plant import plant_ports

GROUP = "drake_shared.robots"


def registered_robots() -> list[str]:
    """Names of the robots that are registered."""
    return registered_names(GROUP)


def make_robot(name: str, *, scenario: Scenario) -> tuple[Robot, LeafSystem]:
    """Makes a registered robot and its plant, for the task and the control period of ``scenario``.

    Raises:
        InputError: No robot has that name, it cannot be imported or made, or robot or plant lacks something.
    """
    made = make_registered(GROUP, name, "robot", scenario=scenario, period=scenario.control_period)
    if not isinstance(made, tuple) or len(made) != 2:
        raise InputError("robot", "", f"{name!r} must be made as robot and plant", type(made).__name__)
    robot, plant = made
    check_robot(robot)
    plant_ports(plant, robot)
    return robot, plant
