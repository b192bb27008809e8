"""Prepares Meshcat for a scenario. The page and the replay draw the rest in Meshcat's scene."""

from __future__ import annotations

import ctypes
import logging

from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.math import RigidTransform

from drake_shared.scenario import Scenario


def start_quiet_meshcat(params: MeshcatParams) -> Meshcat:
    """Starts a Meshcat that does not log its own address, where that is not the one to open.

    It lives as long as the process: Drake aborts the program where another thread than the one that made a
    Meshcat frees it, and garbage is collected by any thread.
    """
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        meshcat = Meshcat(params)
    finally:
        logger.setLevel(level)
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(meshcat))
    return meshcat


def center_scene(meshcat: Meshcat, scenario: Scenario) -> None:
    """Lets Meshcat draw about the middle of the workspace.

    Graphics cards compute in single precision, whose steps are 3 cm wide at 500 km from the origin.
    """
    space = scenario.workspace
    x, y = (space.x_min + space.x_max) / 2, (space.y_min + space.y_max) / 2
    meshcat.SetTransform("/drake", RigidTransform([-x, -y, 0.0]))
