"""Draws the predicted trajectory, its spread, the commands and the division of control in Meshcat."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import Cylinder, Meshcat, Rgba, Sphere
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiagramBuilder, InputPort, LeafSystem, OutputPort

from drake_shared.robots import Robot, check_robot, scaled_length
from drake_shared.systems.discrete_update import check_positive
from drake_shared.systems.intention import Intention, empty_intention

HUMAN_COLOR = (0.95, 0.62, 0.07)
AGENT_COLOR = (0.16, 0.50, 0.88)
SHARED_COLOR = (0.10, 0.62, 0.38)

# Lengths here are in [m] for the Pioneer P3-DX and scale with the robot.
_PATH_DOTS = 30
# Radius of what is scaled: small, so that a dot whose scale has not arrived yet does not disturb.
_UNIT = 0.05
_LEAST_SIGMA = 0.02
# Dots of each mode, largest number of modes, and least probability of a mode that is drawn.
_MODE_DOTS, _MODES = 18, 5
_LEAST_PROBABILITY = 0.01
_COMMAND_DOTS = 5
# Time that the arc of a command covers, in [s].
_COMMAND_TIME = 1.0
_COMMANDS = {"human": HUMAN_COLOR, "autonomous": AGENT_COLOR, "shared": SHARED_COLOR}


class IntentionVisualizer(LeafSystem):
    """Draws the predicted path with its spread, the commands, and the division of control.

    .. pydrake_system::

        name: IntentionVisualizer
        input_ports:
        - pose
        - intention
        - human_weight
        - human_command
        - autonomous_command
        - shared_command

    Inputs (all but ``pose`` and ``intention`` may be left open):
        pose: Configuration of the robot, such as [x, y, yaw] in [m, m, rad], world frame.
        intention: :class:`~drake_shared.systems.intention.Intention`.
        human_weight (1): w, from 0 to 1.
        human_command, autonomous_command, shared_command (M): Commands, in the robot's units.

    The path is a row of dots on discs (in space: ellipsoids) whose half axes are the standard deviations.
    Each mode of the prediction is a row of dots whose area grows with its probability. Each command is a row
    of dots along the arc on which it leads in the next second. Below the robot lies a disc of the agent's
    colour, covered by one of the human's whose share of the area is w. All objects are made at the start and
    then only moved, scaled and hidden, which is what Meshcat can record.

    Args:
        meshcat: Where to draw.
        robot: Gives the sizes of the ports, the arcs of commands and the size of what is drawn.
        period: Between drawings, in [s].
        prefix: Path in Meshcat's tree of all objects.

    Raises:
        InputError: ``period`` is not positive and finite, or ``robot`` is not a Robot.
    """

    def __init__(
        self, *, meshcat: Meshcat, robot: Robot, period: float = 0.1, prefix: str = "intention"
    ) -> None:
        super().__init__()
        self.set_name("intention_visualizer")
        check_robot(robot)
        check_positive(self, period=period)
        self._meshcat = meshcat
        self._robot = robot
        self._prefix = prefix
        names = tuple(robot.position_names)
        self._axes = tuple(names.index(name) if name in names else None for name in ("x", "y", "z"))
        self._in_space = self._axes[2] is not None
        self._pose_port = self.DeclareVectorInputPort("pose", len(robot.configuration_names))
        self._intention_port = self.DeclareAbstractInputPort("intention", Value(empty_intention(len(names))))
        self._weight_port = self.DeclareVectorInputPort("human_weight", 1)
        self._command_ports = {
            name: self.DeclareVectorInputPort(f"{name}_command", len(robot.command_names))
            for name in _COMMANDS
        }
        self._visible: dict[str, bool] = {}
        self._make_objects()
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)
        self.DeclareForcedPublishEvent(self._draw)

    @staticmethod
    def AddToBuilder(
        builder: DiagramBuilder,
        *,
        pose_port: OutputPort,
        intention_port: OutputPort,
        meshcat: Meshcat,
        robot: Robot,
        period: float = 0.1,
        prefix: str = "intention",
        **optional_ports: OutputPort,
    ) -> IntentionVisualizer:
        """Adds a visualizer to ``builder`` and connects it.

        Args:
            builder: The diagram's.
            pose_port, intention_port: Sources of the ports ``pose`` and ``intention``.
            meshcat, robot, period, prefix: See the constructor.
            optional_ports: Sources of further input ports, by name, such as ``human_weight=port``.
        """
        visualizer = IntentionVisualizer(meshcat=meshcat, robot=robot, period=period, prefix=prefix)
        builder.AddSystem(visualizer)
        sources = {"pose": pose_port, "intention": intention_port, **optional_ports}
        for name, source in sources.items():
            builder.Connect(source, visualizer.GetInputPort(name))
        return visualizer

    def get_pose_input_port(self) -> InputPort:
        """The port ``pose``."""
        return self._pose_port

    def get_intention_input_port(self) -> InputPort:
        """The port ``intention``."""
        return self._intention_port

    def _length(self, length: float) -> float:
        return scaled_length(self._robot, length)

    def _make_objects(self) -> None:
        radius = self._robot.characteristic_length + self._length(0.06)
        # A transform resets the scale of its object: what is scaled is the child of what is moved.
        self._dot("halo/agent", radius, 0.004, (*AGENT_COLOR, 0.75))
        self._dot("halo/human", radius, 0.004, (*HUMAN_COLOR, 1.0), height=0.004)
        for index in range(_PATH_DOTS):
            self._dot(f"path/{index}/spread", self._length(_UNIT), 0.002, (*AGENT_COLOR, 0.10), ball=True)
            self._dot(
                f"path/{index}/mean", self._length(0.022), 0.02, (*AGENT_COLOR, 1.0), height=0.015, ball=True
            )
        for mode in range(_MODES):
            for index in range(_MODE_DOTS):
                self._dot(
                    f"mode/{mode}/{index}/dot", self._length(_UNIT), 0.004, (*AGENT_COLOR, 0.45), ball=True
                )
        for name, color in _COMMANDS.items():
            for index in range(_COMMAND_DOTS):
                size = self._length(0.035 - 0.004 * index)
                self._dot(f"{name}/{index}", size, 0.02, (*color, 1.0), ball=True)

    def _dot(
        self,
        name: str,
        radius: float,
        thickness: float,
        color: tuple[float, ...],
        *,
        height: float = 0.0,
        ball: bool = False,
    ) -> None:
        """A flat disc, ``thickness`` high; a ball instead, with ``ball``, if the robot moves in space."""
        path = f"{self._prefix}/{name}"
        in_space = ball and self._in_space
        shape = Sphere(radius) if in_space else Cylinder(radius, self._length(thickness))
        self._meshcat.SetObject(path, shape, Rgba(*color))
        z = 0.0 if in_space else self._length(height)
        self._meshcat.SetTransform(path, RigidTransform([0.0, 0.0, z]))

    def _draw(self, context: Context) -> None:
        time = context.get_time()
        pose: list[float] = self._pose_port.Eval(context).tolist()
        intention: Intention = self._intention_port.Eval(context)
        known = self._weight_port.HasValue(context)
        self._show("halo", time, known)
        if known:
            self._draw_halo(time, pose, self._weight_port.Eval(context).item())
        self._draw_path(time, intention)
        self._draw_modes(time, intention)
        for level, (name, port) in enumerate(self._command_ports.items()):
            # One above the other, so that arcs that agree are all visible.
            self._draw_command(time, name, pose, context, port, 0.30 + 0.03 * level)

    def _draw_halo(self, time: float, pose: list[float], weight: float) -> None:
        self._place("halo", time, self._robot.position(pose), 0.01)
        # The human's disc lies on the agent's, and its share of the area is the human's share of control.
        root = max(math.sqrt(weight), 1e-3)
        self._scale("halo/human", time, [root, root, 1.0])

    def _draw_path(self, time: float, intention: Intention) -> None:
        picked = np.linspace(intention.first, len(intention.times) - 1, _PATH_DOTS).round().astype(int)
        unit, least = self._length(_UNIT), self._length(_LEAST_SIGMA)
        for index, entry in enumerate(picked):
            mean = intention.mean[entry].tolist()
            sigma = np.sqrt(intention.variance[entry]).tolist()
            known = math.isfinite(sum(mean) + sum(sigma))
            self._show(f"path/{index}", time, known)
            if known:
                self._place(f"path/{index}", time, mean, 0.015 + 2e-4 * index)
                scale = [1.0 if axis is None else max(sigma[axis], least) / unit for axis in self._axes]
                self._scale(f"path/{index}/spread", time, scale)

    def _draw_modes(self, time: float, intention: Intention) -> None:
        """Draws each mode with dots whose area grows with its probability."""
        modes = intention.modes
        drawn = [] if modes is None else modes.by_probability()
        likely = [mode for mode in drawn if mode[0] > _LEAST_PROBABILITY]
        for slot in range(_MODES):
            self._show(f"mode/{slot}", time, slot < len(likely))
        for slot, (probability, path) in enumerate(likely[:_MODES]):
            size = math.sqrt(probability)
            for index, entry in enumerate(np.linspace(0, len(path) - 1, _MODE_DOTS).round().astype(int)):
                self._place(f"mode/{slot}/{index}", time, path[entry].tolist(), 0.02)
                self._scale(f"mode/{slot}/{index}/dot", time, [size, size, size if self._in_space else 1.0])

    def _draw_command(
        self, time: float, name: str, pose: list[float], context: Any, port: InputPort, height: float
    ) -> None:
        command = port.Eval(context).tolist() if port.HasValue(context) else [math.nan]
        known = math.isfinite(sum(command))
        self._show(name, time, known)
        for index in range(_COMMAND_DOTS if known else 0):
            ahead = _COMMAND_TIME * (index + 1) / _COMMAND_DOTS
            self._place(f"{name}/{index}", time, self._robot.rollout(pose, command, ahead), height)

    def _place(self, name: str, time: float, position: Sequence[float], height: float) -> None:
        """Moves an object to ``position`` (D,), in [m]; to ``height``, in [m], for robots on the floor."""
        x, y, z = (0.0 if axis is None else position[axis] for axis in self._axes)
        if not self._in_space:
            z = self._length(height)
        self._meshcat.SetTransform(f"{self._prefix}/{name}", RigidTransform([x, y, z]), time)

    def _scale(self, name: str, time: float, scale: list[float]) -> None:
        self._meshcat.SetProperty(f"{self._prefix}/{name}", "scale", scale, time)

    def _show(self, name: str, time: float, visible: bool) -> None:
        # Most of the time nothing changes, and needs no message.
        if self._visible.get(name) is not visible:
            self._visible[name] = visible
            self._meshcat.SetProperty(f"{self._prefix}/{name}", "visible", visible, time)
