"""The messages about the predicted routes and the path driven; see docs/websocket_protocol.md."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from drake_shared.analysis.scene_data import describe_routes
from drake_shared.simulation.trial import RunningTrial, Simulation
from drake_shared.systems.route_ribbons import route_ribbons

# Control steps between two messages about the routes: 10 a second at the usual period.
_STEPS = 2
# Rows between two messages about the whole path, which pages need that connect during a trial.
_ROWS = 40


class SceneState:
    """Follows the trials of a simulation, and describes what a page draws of them."""

    def __init__(self, simulation: Simulation) -> None:
        self._estimator = simulation.parts.estimator
        self._robot = simulation.robot
        self._steps = 0
        self._rows: list[list[float | None]] = []

    def begin(self) -> dict[str, Any]:
        """Forgets the last trial. Returns the ``trail`` message of the next one."""
        self._steps = 0
        self._rows = []
        return {"rows": []}

    def routes(self, running: RunningTrial) -> dict[str, Any] | None:
        """Returns the ``routes`` message, or None if none is due at this control step.

        It costs a prediction for each route, so it is not made in every step.
        """
        self._steps += 1
        if (self._steps - 1) % _STEPS:
            return None
        context = self._estimator.GetMyContextFromRoot(running.root)
        intention = self._estimator.get_intention_output_port().Eval(context)
        modes = self._estimator.GetOutputPort("modes").Eval(context)
        position = self._robot.position(self._estimator.get_pose_input_port().Eval(context).tolist())
        ribbons = route_ribbons(intention, modes, position=position, robot=self._robot)
        return {"routes": describe_routes(ribbons)}

    def trail(self, values: Mapping[str, float], time: float) -> dict[str, Any] | None:
        """Adds the values of a log's columns to the path driven; returns the ``trail`` message if due."""
        row = [time, *(values.get(name, math.nan) for name in ("x", "y", "human_weight", "clearance"))]
        shown = [round(value, 4) if math.isfinite(value) else None for value in row]
        self._rows.append([*shown, float(values.get("contact", 0.0) > 0.5)])
        return self.whole_trail() if len(self._rows) % _ROWS == 0 else None

    def whole_trail(self) -> dict[str, Any]:
        """Returns the ``trail`` message: ``rows`` of [t, x, y, human_weight, clearance, contact]."""
        return {"rows": self._rows}
