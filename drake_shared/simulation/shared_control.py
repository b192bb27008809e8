"""The parts of a shared-control loop in a diagram."""

from __future__ import annotations

import dataclasses
from typing import Any

from pydrake.geometry import SceneGraph
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import VectorLogSink

from drake_shared.robots import Robot
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.systems.arbiter import Arbiter
from drake_shared.systems.intention_estimator import IntentionEstimator
from drake_shared.systems.ports import check_inputs
from drake_shared.systems.safety_filter import SafetyFilter


@dataclasses.dataclass(frozen=True, kw_only=True)
class SharedControl:
    """The parts of a shared-control loop in a diagram.

    Attributes:
        config: How control is shared.
        robot: Its names, sizes and limits.
        operator: The human input source.
        estimator: Predicts where the human is heading.
        controller: Moves toward the predicted position.
        arbiter: Divides the control.
        driver_switch: Where the driver is set: the arbiter, or the guard of one that is no `Arbiter`.
        arbitration: Name and configuration of the arbiter, as a log holds them.
        plant: The robot; a :class:`DynamicPlant` if the scenario's ``plant`` is dynamic.
        scene_graph: Holds the obstacles.
        log_sink: Logs ``columns``, one row a control period.
        columns: Names of the logged values; those that operator, safety filter and faults add come last.
        safety_filter: Keeps the robot clear of obstacles, if the config has a safety clearance.
    """

    config: SharedControlConfig
    robot: Robot
    operator: LeafSystem
    estimator: IntentionEstimator
    controller: LeafSystem
    arbiter: LeafSystem
    driver_switch: Arbiter
    arbitration: dict[str, Any]
    plant: LeafSystem
    scene_graph: SceneGraph
    log_sink: VectorLogSink
    columns: tuple[str, ...]
    safety_filter: SafetyFilter | None = None

    def check_inputs(self, builder: DiagramBuilder) -> None:
        """Checks, before ``builder`` builds, that the inputs of the parts are connected.

        Raises:
            InputError: One is open that nothing connects.
        """
        optional = {
            "operator": (),
            "controller": (),
            "arbiter": Arbiter.OPTIONAL_INPUTS,
            "plant": ("geometry_query",),
        }
        for role, names in optional.items():
            system: LeafSystem = getattr(self, role)
            check_inputs(builder, system, f"{role} {type(system).__name__}", names)

    def SetDriver(self, root: Context, driver: str) -> None:
        """Sets who drives, "shared", "human" or "agent", in the Context of the whole diagram."""
        self.driver_switch.SetDriver(self.driver_switch.GetMyMutableContextFromRoot(root), driver)

    def release_reason(self, root: Context) -> str | None:
        """Why the agent gives up control now; see `drake_shared.systems.arbiter.Arbiter`."""
        return self.driver_switch.release_reason(self.driver_switch.GetMyContextFromRoot(root))
