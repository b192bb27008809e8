"""Safety filter: changes a wheel command as little as possible to keep the robot clear of obstacles."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryId, QueryObject, Role, SignedDistanceToPoint
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_shared.arbitration.safety.barrier import safe_command
from drake_shared.arbitration.safety.obstacle_motion import ObstaclePath
from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive
from drake_shared.scenario.obstacles import Obstacle

_MIN_CLEARANCE, _MAX_CLEARANCE = 0.001, 1.0


class SafetyFilter(LeafSystem):
    """Discrete-time control barrier function for a differential drive, with full braking as the backup.

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

    A command is safe if, after one period of it, full braking of both wheels keeps the clearance to every
    obstacle. :func:`drake_shared.arbitration.safety.barrier.safe_command` finds the nearest safe command. The
    plant must ramp its wheels as :class:`DiffDrivePlant` does and take a new command once per period.

    Inputs:
        pose (3): [x, y, yaw] in [m, m, rad], world frame. If it is not finite the robot is braked.
        wheel_speed (2): [left, right] in [rad/s].
        wheel_command (2): Desired [left, right] in [rad/s]. NaN and infinite values count as zero.
        geometry_query: QueryObject of a SceneGraph with convex obstacles.

    Outputs:
        safe_command (2): [left, right] in [rad/s]. Equal to wheel_command, bit for bit, if that is safe;
            otherwise wheel speeds that can be reached in one period. Feeds through.
        intervention (2): safe_command - wheel_command, in [rad/s]. Feeds through.

    Parameters (of the Context):
        clearance: In [m]; see :meth:`set_clearance`.

    Static obstacles are never touched, and the clearance is kept from every state from which full braking
    keeps it. A moving obstacle can hit a robot at rest, so the guarantee there is weaker. The prediction
    horizon is the time that braking from full speed takes. If immediate braking keeps the clearance within
    the horizon, so does the safe command; if braking comes nearer, the safe command comes no nearer than
    braking does. If an obstacle hits the robot even under full braking, the robot does not drive towards the
    place of the contact: it stands, or moves away or out of the path as commanded. Nothing beyond the horizon
    is predicted: a robot may come to rest where an obstacle will pass later.

    Args:
        robot: Dimensions and limits.
        clearance: Between body and obstacles, in [m]; the default of the parameter.
        period: Update period of the plant, in [s].
        obstacles: Those with a path are predicted along it, at the time of the Context, and are identified in
            the SceneGraph by their names. All others are treated as static.

    Raises:
        InputError: The clearance is not from 0.001 to 1 m.
        ValueError: The period is not positive and finite.
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
        self.set_name("safety_filter")
        if not (math.isfinite(period) and period > 0):
            raise ValueError(f"period must be positive and finite, got {period}")
        check_clearance(clearance)
        self._robot = robot
        self._period = period
        self._paths = {item.name: _path(item) for item in obstacles if item.path}
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        self._speed_port = self.DeclareVectorInputPort("wheel_speed", 2)
        self._command_port = self.DeclareVectorInputPort("wheel_command", 2)
        self._query_port = self.DeclareAbstractInputPort("geometry_query", Value(QueryObject()))
        self._clearance_index = self.DeclareNumericParameter(BasicVector([clearance]))
        self._safe_port = self.DeclareVectorOutputPort("safe_command", 2, self._calc_command)
        self.DeclareVectorOutputPort("intervention", 2, self._calc_intervention)

    def set_clearance(self, context: Context, clearance: float | None) -> None:
        """Sets the clearance to keep, in [m]; None disables the filter.

        Raises:
            InputError: The clearance is not from 0.001 to 1 m.
        """
        if clearance is not None:
            check_clearance(clearance)
        parameter = context.get_mutable_numeric_parameter(self._clearance_index)
        parameter[0] = math.nan if clearance is None else clearance

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        clearance = context.get_numeric_parameter(self._clearance_index)[0]
        left, right = self._desired(context)
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
                query=functools.partial(_query_distances, query),
                period=self._period,
                moving=self._moving(query) if self._paths else None,
                time=context.get_time(),
            )
        output.set_value([left, right])

    def _calc_intervention(self, context: Context, output: BasicVector) -> None:
        output.set_value(self._safe_port.Eval(context) - self._desired(context))

    def _moving(self, query: QueryObject) -> dict[GeometryId, ObstaclePath]:
        """Paths of the moving obstacles by their proximity geometries."""
        inspector = query.inspector()
        names = {id: inspector.GetName(id) for id in inspector.GetAllGeometryIds(Role.kProximity)}
        return {id: self._paths[name] for id, name in names.items() if name in self._paths}

    def _desired(self, context: Context) -> tuple[float, float]:
        left, right = self._command_port.Eval(context).tolist()
        return left if math.isfinite(left) else 0.0, right if math.isfinite(right) else 0.0


def check_clearance(clearance: float, *, source: str = "safety filter") -> None:
    """Checks that ``clearance``, in [m], is within the range that the filter supports.

    Raises:
        InputError: The clearance is not from 0.001 to 1 m.
    """
    if not _MIN_CLEARANCE <= clearance <= _MAX_CLEARANCE:
        expected = f"must be from {_MIN_CLEARANCE} to {_MAX_CLEARANCE:g} m"
        raise InputError(source, "clearance", expected, clearance)


def _path(obstacle: Obstacle) -> ObstaclePath:
    times, xs, ys = np.transpose(obstacle.path)
    return times, xs + 1j * ys


def _query_distances(query: QueryObject, x: float, y: float, distance: float) -> list[SignedDistanceToPoint]:
    found: list[SignedDistanceToPoint] = query.ComputeSignedDistanceToPoint(np.array([x, y, 0.0]), distance)
    return found
