"""The same robot among the same obstacles in IR-SIM, without a screen."""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from drake_shared.scenario import Scenario
from drake_shared.scenario.obstacles import Box

# Of the robot along its way, in [m/s].
_SPEED = 0.3


class IrSim:
    """IR-SIM (``ir-sim`` on PyPI) driving a robot a free way, checking for collisions; no learner.

    The way is a straight one below all obstacles. Either the robot is given the same command at every step,
    or IR-SIM's own behaviour "dash" drives it towards a goal that it does not reach.

    Args:
        scenario: Gives robot, obstacles, start and control period.
        dash: Whether its own behaviour drives.
    """

    def __init__(self, scenario: Scenario, *, dash: bool = False) -> None:
        # When imported it tries every screen there is, and tells of it on standard output.
        with contextlib.redirect_stdout(io.StringIO()):
            import irsim
        self._steps = scenario.steps
        self._action = None if dash else [_SPEED, 0.0]
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "world.yaml"
            # JSON is YAML.
            file.write_text(json.dumps(describe_world(scenario, dash=dash)), encoding="utf-8")
            self._environment: Any = irsim.make(str(file), headless=True, log_level="ERROR")

    def run(self) -> None:
        """A trial from the start, of as many steps as the scenario has."""
        self._environment.reset()
        for _ in range(self._steps):
            self._environment.step(self._action)

    @property
    def position(self) -> np.ndarray:
        """Where the robot is now, shape (2,), in [m]."""
        return np.array(self._environment.robot.state, dtype=float).ravel()[:2]

    @property
    def collided(self) -> bool:
        """Whether the robot touches an obstacle now."""
        return bool(self._environment.robot.collision)


def describe_world(scenario: Scenario, *, dash: bool) -> dict[str, Any]:
    """The scenario as IR-SIM reads it, the robot moved aside to where its way is free."""
    space, robot = scenario.workspace, scenario.robot
    y = min((item.y - item.bounding_radius() for item in scenario.obstacles), default=0.0)
    y -= 2.0 * robot.footprint_radius
    turn = 2.0 * robot.max_speed / robot.track
    described: dict[str, Any] = {
        "kinematics": {"name": "diff"},
        "shape": {"name": "circle", "radius": robot.footprint_radius},
        "state": [scenario.start.x, y, 0.0],
        "vel_max": [robot.max_speed, turn],
        "vel_min": [-robot.max_speed, -turn],
    }
    if dash:
        far = scenario.start.x + 2.0 * robot.max_speed * scenario.duration
        described |= {"goal": [far, y, 0.0], "behavior": {"name": "dash"}}
    return {
        "world": {
            "width": space.x_max - space.x_min,
            "height": space.y_max - space.y_min,
            "offset": [space.x_min, space.y_min],
            "step_time": scenario.control_period,
            "collision_mode": "stop",
        },
        "robot": [described],
        "obstacle": [
            {
                "shape": (
                    {"name": "rectangle", "length": item.length, "width": item.width}
                    if isinstance(item, Box)
                    else {"name": "circle", "radius": item.radius}
                ),
                "state": [item.x, item.y, item.yaw_angle()],
            }
            for item in scenario.obstacles
        ],
    }
