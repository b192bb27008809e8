"""What lies between the command and the robot: it changes as little as keeps the robot clear of obstacles."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryId, QueryObject, Role, SignedDistanceToPoint
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_shared.arbitration.safety.barrier import safe_command
from drake_shared.arbitration.safety.drift import Way
from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.scenario.obstacles import Obstacle

_LEAST_CLEARANCE, _MOST_CLEARANCE = 0.001, 1.0


class SafetyFilter(LeafSystem):
    """Passes a wheel command on, changed by the least that keeps a set clearance to every obstacle.

    .. pydrake_system::

        name: SafetyFilter
        input_ports:
        - pose
        - wheel_speed
        - wheel_command
        - geometry_query
        output_ports:
        - safe_command
        - intervention

    Inputs:
        pose (3): [x, y, yaw] in [m, m, rad], world frame. Where it is no number nobody knows what is safe,
            and the robot is braked.
        wheel_speed (2): [left, right] in [rad/s].
        wheel_command (2): [left, right] in [rad/s], wanted. What is no number counts as zero.
        geometry_query: QueryObject of a SceneGraph with convex obstacles, that stand still or move as told.

    Outputs:
        safe_command (2): [left, right] in [rad/s]. Bit for bit the one wanted, where that is safe; else
            wheel speeds that can be reached in one period. Feeds through.
        intervention (2): What was changed, safe_command - wheel_command, in [rad/s]. Feeds through.

    A command is safe if, after one period of it, braking both wheels as hard as they can still ends with the
    clearance to every obstacle kept: a control barrier function in discrete time, with full braking as the
    backup. :func:`drake_shared.arbitration.safety.barrier.safe_command` says how the nearest is found. It
    needs a plant that ramps as :class:`DiffDrivePlant` does and takes a new command once a period.

    Of obstacles that stand still it promises that none is touched, and the clearance kept, from wherever
    full braking does so. An obstacle that moves can come upon a robot at rest, so of these it promises less.
    It looks ahead for as long as braking from full speed takes. Where the robot, braking at once and then at
    rest, keeps the clearance for that time, so does what it lets through; where braking comes nearer, that
    comes no nearer in that time. Where the obstacle meets the robot even if it brakes, the robot is not
    driven against the place where the obstacle is by then: it stands, or is driven away or out of the way, as
    it is told. Farther ahead it does not look: a robot may come to rest where an obstacle will pass.

    Parameters (of the Context):
        clearance: In [m]; see :meth:`set_clearance`.

    Args:
        robot: Sizes and limits.
        clearance: Between body and obstacles, in [m]; the default of the parameter.
        period: Of the plant's update, in [s].
        obstacles: Those that move are expected on their paths, at the time of the Context, and known in the
            SceneGraph by their names. Any other is taken to stand where it is.

    Raises:
        InputError: The clearance is not from 0.001 to 1 m.
    """

    def __init__(
        self,
        *,
        robot: DiffDrive,
        clearance: float = 0.05,
        period: float = 0.05,
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        super().__init__()
        if not (math.isfinite(period) and period > 0):
            raise ValueError(f"period must be positive and finite, got {period}")
        check_clearance(clearance)
        self._robot = robot
        self._period = period
        self._ways = {item.name: _way(item) for item in obstacles if item.path}
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        self._speed_port = self.DeclareVectorInputPort("wheel_speed", 2)
        self._command_port = self.DeclareVectorInputPort("wheel_command", 2)
        self._query_port = self.DeclareAbstractInputPort("geometry_query", Value(QueryObject()))
        self._clearance_index = self.DeclareNumericParameter(BasicVector([clearance]))
        self._safe_port = self.DeclareVectorOutputPort("safe_command", 2, self._calc_command)
        self.DeclareVectorOutputPort("intervention", 2, self._calc_intervention)

    def set_clearance(self, context: Context, clearance: float | None) -> None:
        """Sets the clearance to keep, in [m]; None switches the filter off.

        Raises:
            InputError: It is not from 0.001 to 1 m.
        """
        if clearance is not None:
            check_clearance(clearance)
        parameter = context.get_mutable_numeric_parameter(self._clearance_index)
        parameter[0] = math.nan if clearance is None else clearance

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        clearance = context.get_numeric_parameter(self._clearance_index)[0]
        left, right = self._wanted(context)
        if math.isfinite(clearance):
            x, y, yaw = self._pose_port.Eval(context).tolist()
            if not math.isfinite(x + y + yaw):
                output.set_value([0.0, 0.0])
                return
            wheel_left, wheel_right = self._speed_port.Eval(context).tolist()
            query = self._query_port.Eval(context)
            left, right = safe_command(
                self._robot,
                (x, y, yaw),
                (wheel_left, wheel_right),
                (left, right),
                clearance=clearance,
                nearby=functools.partial(_nearby, query),
                period=self._period,
                moving=self._moving(query) if self._ways else None,
                now=context.get_time(),
            )
        output.set_value([left, right])

    def _calc_intervention(self, context: Context, output: BasicVector) -> None:
        output.set_value(self._safe_port.Eval(context) - self._wanted(context))

    def _moving(self, query: QueryObject) -> dict[GeometryId, Way]:
        """The ways of the obstacles that move, by what can be felt of them."""
        inspector = query.inspector()
        felt = ((name, inspector.GetName(name)) for name in inspector.GetAllGeometryIds(Role.kProximity))
        return {name: self._ways[called] for name, called in felt if called in self._ways}

    def _wanted(self, context: Context) -> tuple[float, float]:
        left, right = self._command_port.Eval(context).tolist()
        return left if math.isfinite(left) else 0.0, right if math.isfinite(right) else 0.0


def check_clearance(clearance: float, *, source: str = "safety filter") -> None:
    """Makes sure that ``clearance``, in [m], is one that can be kept.

    Raises:
        InputError: It is not from 0.001 to 1 m.
    """
    if not _LEAST_CLEARANCE <= clearance <= _MOST_CLEARANCE:
        expected = f"must be from {_LEAST_CLEARANCE} to {_MOST_CLEARANCE:g} m"
        raise InputError(source, "clearance", expected, clearance)


def _way(obstacle: Obstacle) -> Way:
    times, xs, ys = np.transpose(obstacle.path)
    return times, xs + 1j * ys


def _nearby(query: QueryObject, x: float, y: float, reach: float) -> list[SignedDistanceToPoint]:
    return query.ComputeSignedDistanceToPoint(np.array([x, y, 0.0]), reach)
