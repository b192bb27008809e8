"""The same robot among the same obstacles in IR-SIM, without a screen."""

from __future__ import annotations

import contextlib
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from drake_shared.obstacles import Circle
from drake_shared.scenario import Scenario

# Of the ways that IR-SIM's robot drives: by its own behaviour to a goal, and by commands given to it.
WAYS = ("dash", "commands")


class IrSim:
    """IR-SIM (``ir-sim`` on PyPI), driving a robot a free way and checking for collisions; no learner.

    The way is a straight one below all obstacles: along it its own behaviour "dash" drives the robot to a
    goal, or it is given the same command at every step. The goal is too far to be reached.

    Args:
        scenario: Gives robot, obstacles (circles), start and control period.
        way: "dash" or "commands".
    """

    def __init__(self, scenario: Scenario, way: str) -> None:
        # It tries every screen there is at import, and tells of it on standard output.
        with contextlib.redirect_stdout(sys.stderr):
            import irsim
        self.steps = scenario.steps
        self._way = way
        self._speed = 0.3
        self._turn = 0.0
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "world.yaml"
            file.write_text(yaml.safe_dump(describe_world(scenario, dash=way == "dash")), encoding="utf-8")
            self._environment: Any = irsim.make(str(file), headless=True, log_level="ERROR")

    def run(self) -> None:
        """A trial, from the start."""
        self._environment.reset()
        action = None if self._way == "dash" else [self._speed, self._turn]
        for _ in range(self.steps):
            self._environment.step(action)

    @property
    def pose(self) -> np.ndarray:
        """Where the robot is: x, y, yaw in [m, m, rad]."""
        return np.array(self._environment.robot.state, dtype=float).ravel()[:3]

    @property
    def collided(self) -> bool:
        """Whether the robot touches an obstacle."""
        return bool(self._environment.robot.collision)
