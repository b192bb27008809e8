"""The hand of a simulated participant on the stick of the page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_shared.operators.behaviour import Behaviour
from drake_shared.operators.steering import SteeringLaw
from drake_shared.scenario import Scenario

_PUSH = (0.3, 0.0)
"""Deflection by which the hand starts a trial."""


class SimulatedHand:
    """Steers by what the server of a trial tells the page: scene, route and pose.

    It follows the instructed route by the steering law of the simulated operator, with the delay, skill and
    speed of a behaviour and without its noise. It does not react to the agent.

    Args:
        scenario: Of the study; its robot is a differential drive.
        behaviour: Of the participant.
    """

    def __init__(self, scenario: Scenario, behaviour: Behaviour) -> None:
        self._behaviour = behaviour
        self._law = SteeringLaw(scenario)
        self._paths = {route.name: scenario.path_of(route) for route in scenario.routes}
        self._path = next(iter(self._paths.values()))
        self._speeds = (1.0, 1.0)
        self.driving = False
        """Whether a trial runs; it starts when the stick moves."""
        self.longest = scenario.duration
        """Longest time of a trial, in [s]."""
        self._begin()

    def _begin(self) -> None:
        self._seen = self._law.initial_memory
        self._reached = 0.0

    def see(self, message: Mapping[str, Any]) -> tuple[float, float] | None:
        """Takes a message from the server; see docs/websocket_protocol.md.

        Returns:
            Deflection of the stick forward and to the left, from -1 to 1, for "now"; None for others.
        """
        match message["type"]:
            case "scene":
                self._speeds = message["max_speed"], message["max_yaw_rate"]
            case "setup" if message["route"] in self._paths:
                self._path = self._paths[message["route"]]
            case "trial":
                self.driving = message["phase"] == "driving"
                if message["phase"] == "armed":
                    self._begin()
            case "now":
                return _PUSH if not self.driving else self._steer(float(message["t"]), message["pose"])
        return None

    def _steer(self, time: float, pose: list[float]) -> tuple[float, float]:
        behaviour = self._behaviour
        self._seen = np.concatenate((pose, self._seen[:-3]))
        seen = self._law.recall(self._seen, behaviour.delay)
        self._reached = float(self._law.progress(self._path, seen, self._reached))
        speed, turn, correction = self._law.steer(
            self._path,
            seen,
            self._reached,
            time=time,
            delay=behaviour.delay,
            speed_factor=behaviour.speed_factor,
        )
        turn += behaviour.skill * correction
        forward, left = np.clip((speed / self._speeds[0], turn / self._speeds[1]), -1.0, 1.0)
        return float(forward), float(left)
