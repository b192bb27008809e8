"""Draws the predicted routes, the commands and the division of control in Meshcat."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.geometry import Cylinder, Meshcat, Rgba
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiagramBuilder, InputPort, LeafSystem, OutputPort

from drake_shared.robots import Robot, check_robot, scaled_length
from drake_shared.systems.discrete_update import check_positive
from drake_shared.systems.intention import Intention, empty_intention
from drake_shared.systems.route_ribbons import Ribbon, route_ribbons
from drake_shared.systems.strip_mesh import strip_mesh

HUMAN_COLOR = (0.96, 0.64, 0.0)
AGENT_COLOR = (0.16, 0.47, 0.93)
SHARED_COLOR = (0.08, 0.09, 0.12)

# Largest number of routes that are drawn.
_ROUTES = 5
# Time that the arc of a command covers, in [s], and number of its points.
_COMMAND_TIME, _COMMAND_POINTS = 1.0, 13
_COMMANDS = {"human": HUMAN_COLOR, "autonomous": AGENT_COLOR, "shared": SHARED_COLOR}
# Lengths in [m] for the Pioneer P3-DX: height of the routes and of the lowest arc, half width of an arc.
_ROUTE_HEIGHT, _COMMAND_HEIGHT, _COMMAND_WIDTH = 0.02, 0.30, 0.015


class IntentionVisualizer(LeafSystem):
    """Draws the predicted routes, the commands, and the division of control.

    .. pydrake_system::

        name: IntentionVisualizer
        input_ports:
        - pose
        - intention
        - modes
        - human_weight
        - human_command
        - autonomous_command
        - shared_command

    Inputs (all but ``pose`` and ``intention`` may be left open):
        pose: Configuration of the robot, such as [x, y, yaw] in [m, m, rad], world frame.
        intention: :class:`~drake_shared.systems.intention.Intention`.
        modes: `drake_shared.learners.Modes` or None, of the estimator; without it, those of the intention.
        human_weight (1): w, from 0 to 1.
        human_command, autonomous_command, shared_command (M): Commands, in the robot's units.

    Each route is a ribbon that is as wide as the spread across it and as opaque as it is probable; see
    :mod:`drake_shared.systems.route_ribbons`. Each command is an arc above the robot, along which it leads in
    the next second. Below the robot lies a disc of the agent's colour, covered by one of the human's whose
    share of the area is w. Meshcat does not record the ribbons; `drake_shared.write_replay` shows them.

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
        self._pose_port = self.DeclareVectorInputPort("pose", len(robot.configuration_names))
        self._intention_port = self.DeclareAbstractInputPort("intention", Value(empty_intention(len(names))))
        self._modes_port = self.DeclareAbstractInputPort("modes", Value[object](None))
        self._weight_port = self.DeclareVectorInputPort("human_weight", 1)
        self._command_ports = {
            name: self.DeclareVectorInputPort(f"{name}_command", len(robot.command_names))
            for name in _COMMANDS
        }
        self._visible: dict[str, bool] = {}
        radius = robot.characteristic_length + self._length(0.06)
        # A transform resets the scale of its object: what is scaled is the child of what is moved.
        self._disc("halo/agent", radius, (*AGENT_COLOR, 0.75), height=0.0)
        self._disc("halo/human", radius, (*HUMAN_COLOR, 1.0), height=0.004)
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

    def _disc(self, name: str, radius: float, color: tuple[float, ...], *, height: float) -> None:
        path = f"{self._prefix}/{name}"
        self._meshcat.SetObject(path, Cylinder(radius, self._length(0.004)), Rgba(*color))
        self._meshcat.SetTransform(path, RigidTransform([0.0, 0.0, self._length(height)]))

    def _draw(self, context: Context) -> None:
        pose: list[float] = self._pose_port.Eval(context).tolist()
        position = self._robot.position(pose)
        intention: Intention = self._intention_port.Eval(context)
        known = self._weight_port.HasValue(context) and math.isfinite(sum(position))
        self._show("halo", known)
        if known:
            self._draw_halo(position, self._weight_port.Eval(context).item())
        modes: Any = self._modes_port.Eval(context) if self._modes_port.HasValue(context) else None
        shown = route_ribbons(intention, modes or intention.modes, position=position, robot=self._robot)
        for slot in range(_ROUTES):
            name = f"route/{slot}"
            self._show(name, slot < len(shown))
            if slot < len(shown):
                self._draw_route(name, shown[slot])
        for level, (name, port) in enumerate(self._command_ports.items()):
            # One above the other, so that arcs that agree are all visible.
            self._draw_command(name, pose, context, port, _COMMAND_HEIGHT + 0.03 * level)

    def _draw_halo(self, position: tuple[float, ...], weight: float) -> None:
        x, y, z = (0.0 if axis is None else position[axis] for axis in self._axes)
        X = RigidTransform([x, y, z if self._axes[2] is not None else self._length(0.01)])
        self._meshcat.SetTransform(f"{self._prefix}/halo", X)
        # The human's disc lies on the agent's, and its share of the area is the human's share of control.
        root = max(math.sqrt(weight), 1e-3)
        self._meshcat.SetProperty(f"{self._prefix}/halo/human", "scale", [root, root, 1.0])

    def _draw_route(self, name: str, ribbon: Ribbon) -> None:
        known = ribbon.fade > 0.0
        self._strip(name, ribbon.center, ribbon.half_width, AGENT_COLOR, _ROUTE_HEIGHT, known)
        opacity = ribbon.probability * float(ribbon.fade[known].mean())
        self._meshcat.SetProperty(f"{self._prefix}/{name}", "modulated_opacity", opacity)

    def _draw_command(
        self, name: str, pose: list[float], context: Context, port: InputPort, height: float
    ) -> None:
        command = port.Eval(context).tolist() if port.HasValue(context) else [math.nan]
        known = math.isfinite(sum(command)) and self._robot.speed(command) > 0.0
        self._show(name, known)
        if known:
            times = np.linspace(0.0, _COMMAND_TIME, _COMMAND_POINTS)
            arc = np.array([self._robot.rollout(pose, command, time) for time in times.tolist()])
            self._strip(name, arc, np.full(len(arc), self._length(_COMMAND_WIDTH)), _COMMANDS[name], height)

    def _strip(
        self,
        name: str,
        center: NDArray[np.float64],
        half_width: NDArray[np.float64],
        color: tuple[float, float, float],
        height: float,
        known: NDArray[np.bool_] | None = None,
    ) -> None:
        """A strip along ``center`` (n, D), in [m]; at ``height``, in [m], for robots on the floor."""
        at = np.zeros((len(center), 3))
        for column, axis in enumerate(self._axes):
            if axis is not None:
                at[:, column] = center[:, axis]
        if self._axes[2] is None:
            at[:, 2] = self._length(height)
        # Vertices are single precision: they are relative to the start, far from the origin as near it.
        origin = at[0].copy()
        at -= origin
        vertices, faces = strip_mesh(at, half_width, known)
        path = f"{self._prefix}/{name}"
        colors = np.repeat(np.reshape(color, (3, 1)), vertices.shape[1], axis=1)
        self._meshcat.SetTriangleColorMesh(path, vertices, faces, colors)
        self._meshcat.SetTransform(path, RigidTransform(origin))

    def _show(self, name: str, visible: bool) -> None:
        # Most of the time nothing changes, and needs no message.
        if self._visible.get(name) is not visible:
            self._visible[name] = visible
            self._meshcat.SetProperty(f"{self._prefix}/{name}", "visible", visible)
