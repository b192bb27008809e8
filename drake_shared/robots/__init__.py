"""A robot as data and arithmetic: sizes, limits, kinematics, and the geometry that shows it.

`Robot` is the contract that every robot fulfils; `DiffDrive` and `Arm` are those that scenarios describe.
"""

from drake_shared.robots.arm import Arm
from drake_shared.robots.description import RobotDescription, describe_robot, described_robot
from drake_shared.robots.diff_drive import DiffDrive
from drake_shared.robots.robot import Robot, check_robot, scaled_length

__all__ = [
    "Arm",
    "DiffDrive",
    "Robot",
    "RobotDescription",
    "check_robot",
    "describe_robot",
    "described_robot",
    "scaled_length",
]
