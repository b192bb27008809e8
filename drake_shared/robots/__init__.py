"""A robot as data and arithmetic: sizes, limits, kinematics, and the geometry that shows it."""

from drake_shared.robots.diff_drive import DiffDrive
from drake_shared.robots.robot import Robot, scaled_length

__all__ = ["DiffDrive", "Robot", "scaled_length"]
