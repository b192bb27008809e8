"""Shows in Meshcat what the agent expects, how sure it is, and where each command leads."""

from __future__ import annotations

import math

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import Cylinder, Meshcat, Rgba
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, LeafSystem

from drake_shared.robots import DiffDrive
from drake_shared.systems.intention_estimator import EMPTY_INTENTION, Intention

HUMAN_COLOR = (0.95, 0.62, 0.07)
AGENT_COLOR = (0.16, 0.50, 0.88)
SHARED_COLOR = (0.10, 0.62, 0.38)

_PATH_DOTS = 30
# What is scaled has this radius, in [m]: small, so that nobody minds it where a scale has not arrived yet.
_UNIT = 0.05
# Of each way that is possible beside the one aimed at, and of how many such ways.
_MODE_DOTS, _MODES = 18, 5
_LEAST_LIKELY = 0.01
_COMMAND_DOTS = 5
# How far ahead the arcs of the commands reach, in [s].
_COMMAND_REACH = 1.0


class IntentionVisualizer(LeafSystem):
    """Draws the predicted path with its spread, the commands, and who has how much control.

    .. pydrake_system::

        name: IntentionVisualizer
        input_ports:
        - pose
        - intention
        - human_weight
        - human_command
        - autonomous_command
        - shared_command

    Inputs:
        pose (3): [x, y, yaw] in [m, m, rad], world frame.
        intention: :class:`~drake_shared.systems.intention_estimator.Intention`.
        human_weight (1): w, from 0 to 1.
        human_command, autonomous_command, shared_command (2): Wheel speeds [left, right] in [rad/s].

    The path is a row of dots on discs whose half axes are the standard deviations in x and y. Where the
    learner tells ways apart, each one is a row of dots the larger the likelier it is. Each command
    is a row of dots along the arc on which it leads in the next second. Below the robot lies a disc of the
    agent's colour, covered by one of the human's whose share of the area is w. All objects are made at the
    start and only moved, scaled and hidden, which is what Meshcat can record.

    Args:
        meshcat: Where to draw.
        robot: For the arcs of commands and the size of the halo.
        period: Between drawings, in [s].
        prefix: Path in Meshcat's tree under which everything lies.
    """

    def __init__(
        self, *, meshcat: Meshcat, robot: DiffDrive, period: float = 0.1, prefix: str = "intention"
    ) -> None:
        super().__init__()
        self._meshcat = meshcat
        self._robot = robot
        self._prefix = prefix
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        self._intention_port = self.DeclareAbstractInputPort("intention", Value(EMPTY_INTENTION))
        self._weight_port = self.DeclareVectorInputPort("human_weight", 1)
        self._command_ports = {
            name: self.DeclareVectorInputPort(f"{name}_command", 2)
            for name in ("human", "autonomous", "shared")
        }
        self._visible: dict[str, bool] = {}
        self._make_objects()
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)
        self.DeclareForcedPublishEvent(self._draw)

    def _make_objects(self) -> None:
        radius = self._robot.footprint_radius + 0.06
        # A transform puts the scale of what it moves back to 1: what is scaled is the child of what is moved.
        self._disc("halo/agent", radius, 0.004, (*AGENT_COLOR, 0.75))
        self._disc("halo/human", radius, 0.004, (*HUMAN_COLOR, 1.0), height=0.004)
        for index in range(_PATH_DOTS):
            self._disc(f"path/{index}/spread", _UNIT, 0.002, (*AGENT_COLOR, 0.10))
            self._disc(f"path/{index}/mean", 0.022, 0.02, (*AGENT_COLOR, 1.0), height=0.015)
        for mode in range(_MODES):
            for index in range(_MODE_DOTS):
                self._disc(f"mode/{mode}/{index}/dot", _UNIT, 0.004, (*AGENT_COLOR, 0.45))
        colors = {"human": HUMAN_COLOR, "autonomous": AGENT_COLOR, "shared": SHARED_COLOR}
        for name, color in colors.items():
            for index in range(_COMMAND_DOTS):
                self._disc(f"{name}/{index}", 0.035 - 0.004 * index, 0.02, (*color, 1.0))

    def _disc(
        self, name: str, radius: float, thickness: float, color: tuple[float, ...], *, height: float = 0.0
    ) -> None:
        path = f"{self._prefix}/{name}"
        self._meshcat.SetObject(path, Cylinder(radius, thickness), Rgba(*color))
        self._meshcat.SetTransform(path, RigidTransform([0.0, 0.0, height]))

    def _draw(self, context: Context) -> None:
        time = context.get_time()
        pose = self._pose_port.Eval(context).tolist()
        weight = float(self._weight_port.Eval(context)[0])
        self._draw_halo(time, pose, weight)
        intention = self._intention_port.Eval(context)
        self._draw_path(time, intention)
        self._draw_modes(time, intention)
        for height, (name, port) in enumerate(self._command_ports.items()):
            # One above the other, so that arcs that agree are all seen.
            self._draw_command(time, name, pose, port.Eval(context).tolist(), 0.30 + 0.03 * height)

    def _draw_halo(self, time: float, pose: list[float], weight: float) -> None:
        self._place("halo", time, pose[0], pose[1], 0.01)
        # The human's disc lies on the agent's, and its share of the area is the share of control.
        self._scale("halo/human", time, max(math.sqrt(weight), 1e-3), max(math.sqrt(weight), 1e-3))

    def _draw_path(self, time: float, intention: Intention) -> None:
        picked = np.linspace(intention.first, len(intention.times) - 1, _PATH_DOTS).round().astype(int)
        for index, entry in enumerate(picked):
            x, y = intention.mean[entry].tolist()
            sigma = np.sqrt(intention.variance[entry]).tolist()
            known = math.isfinite(x + y + sum(sigma))
            self._show(f"path/{index}", time, known)
            if known:
                self._place(f"path/{index}", time, x, y, 0.015 + 2e-4 * index)
                wide, tall = (max(value, 0.02) / _UNIT for value in sigma)
                self._scale(f"path/{index}/spread", time, wide, tall)

    def _draw_modes(self, time: float, intention: Intention) -> None:
        """Each way that is possible, with dots whose area says how likely it is."""
        modes = intention.modes
        likely = [] if modes is None else [way for way in modes.by_probability() if way[0] > _LEAST_LIKELY]
        for slot in range(_MODES):
            self._show(f"mode/{slot}", time, slot < len(likely))
        for slot, (probability, path) in enumerate(likely[:_MODES]):
            size = math.sqrt(probability)
            for index, entry in enumerate(np.linspace(0, len(path) - 1, _MODE_DOTS).round().astype(int)):
                x, y = path[entry].tolist()
                self._place(f"mode/{slot}/{index}", time, x, y, 0.02)
                self._scale(f"mode/{slot}/{index}/dot", time, size, size)

    def _draw_command(
        self, time: float, name: str, pose: list[float], command: list[float], height: float
    ) -> None:
        known = all(map(math.isfinite, command))
        self._show(name, time, known)
        if not known:
            return
        speed, yaw_rate = self._robot.twist(*command)
        x, y, yaw = pose
        for index in range(_COMMAND_DOTS):
            at = _COMMAND_REACH * (index + 1) / _COMMAND_DOTS
            half = 0.5 * yaw_rate * at
            chord = speed * at * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
            self._place(
                f"{name}/{index}",
                time,
                x + chord * math.cos(yaw + half),
                y + chord * math.sin(yaw + half),
                height,
            )

    def _place(self, name: str, time: float, x: float, y: float, z: float) -> None:
        self._meshcat.SetTransform(f"{self._prefix}/{name}", RigidTransform([x, y, z]), time)

    def _scale(self, name: str, time: float, x: float, y: float) -> None:
        self._meshcat.SetProperty(f"{self._prefix}/{name}", "scale", [x, y, 1.0], time)

    def _show(self, name: str, time: float, visible: bool) -> None:
        # Most of the time nothing changes: what is shown already needs no message.
        if self._visible.get(name) is not visible:
            self._visible[name] = visible
            self._meshcat.SetProperty(f"{self._prefix}/{name}", "visible", visible, time)
