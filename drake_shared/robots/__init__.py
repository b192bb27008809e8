"""A robot as data and arithmetic: sizes, limits, kinematics, and the geometry that shows it."""

from drake_shared.robots.diff_drive import DiffDrive

__all__ = ["DiffDrive"]
