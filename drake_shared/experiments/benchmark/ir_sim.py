"""The same robot among the same obstacles in IR-SIM, without a display."""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.scenario import Scenario
from drake_shared.scenario.obstacles import Box

# Forward speed of the robot, in [m/s].
_SPEED = 0.3


class IrSim:
    """IR-SIM (``ir-sim`` on PyPI) moving a robot along a free straight path, with collision checking.

    Args:
        scenario: Gives robot, obstacles, start and control period.
    """

    def __init__(self, scenario: Scenario) -> None:
        # Importing it probes the graphics backends and prints about them.
        with contextlib.redirect_stdout(io.StringIO()):
            import irsim
        self._steps = scenario.steps
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "world.yaml"
            # JSON is valid YAML.
            file.write_text(json.dumps(describe_world(scenario)), encoding="utf-8")
            self._environment: Any = irsim.make(str(file), headless=True, log_level="ERROR")

    def run(self) -> None:
        """Runs a trial from the start, with as many steps as the scenario has."""
        self._environment.reset()
        for _ in range(self._steps):
            self._environment.step([_SPEED, 0.0])

    @property
    def position(self) -> NDArray[np.float64]:
        """Position of the robot, shape (2,), in [m]."""
        return np.array(self._environment.robot.state, dtype=float).ravel()[:2]


def describe_world(scenario: Scenario) -> dict[str, Any]:
    """The scenario in IR-SIM's format, with the robot moved below all obstacles, where its path is free."""
    space, robot = scenario.workspace, scenario.diff_drive
    lowest = min((item.y - item.bounding_radius() for item in scenario.obstacles), default=0.0)
    turn = 2.0 * robot.max_speed / robot.track
    return {
        "world": {
            "width": space.x_max - space.x_min,
            "height": space.y_max - space.y_min,
            "offset": [space.x_min, space.y_min],
            "step_time": scenario.control_period,
            "collision_mode": "stop",
        },
        "robot": [
            {
                "kinematics": {"name": "diff"},
                "shape": {"name": "circle", "radius": robot.footprint_radius},
                "state": [scenario.start.x, lowest - 2.0 * robot.footprint_radius, 0.0],
                "vel_max": [robot.max_speed, turn],
                "vel_min": [-robot.max_speed, -turn],
            }
        ],
        "obstacle": [
            {
                "shape": {"name": "rectangle", "length": item.length, "width": item.width}
                if isinstance(item, Box)
                else {"name": "circle", "radius": item.radius},
                "state": [item.x, item.y, item.yaw_angle()],
            }
            for item in scenario.obstacles
        ],
    }
