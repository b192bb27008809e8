"""The agent's hands: steers to where the person is expected to be a moment from now."""

from __future__ import annotations

import math

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_shared.robots import DiffDrive
from drake_shared.systems.intention_estimator import EMPTY_INTENTION, Intention

# Within this distance of the waypoint, in [m], the robot is there: directions to it mean nothing.
_THERE = 0.01


class WaypointController(LeafSystem):
    """Steers along the arc to the position expected a look-ahead from now, to be there by then.

    .. pydrake_system::

        name: WaypointController
        input_ports:
        - pose
        - intention
        output_ports:
        - autonomous_command

    Inputs:
        pose (3): [x, y, yaw] in [m, m, rad], world frame.
        intention: :class:`~drake_shared.systems.intention_estimator.Intention`.

    Outputs:
        autonomous_command (2): Wheel speeds [left, right] in [rad/s], within the limits of the wheels; NaN
            where the intention is. Feeds through.

    The arc through the waypoint that starts in the robot's direction is pure pursuit (Coulter 1992). To a
    waypoint that lies behind, the robot turns first.

    Args:
        robot: Sizes and limits.
        look_ahead: In [s]. One control step is the paper's; a robot of limited acceleration needs more.
        turn_gain: Yaw rate per angle to a waypoint behind, in [1/s].
    """

    def __init__(self, *, robot: DiffDrive, look_ahead: float = 0.6, turn_gain: float = 2.0) -> None:
        super().__init__()
        if not (math.isfinite(look_ahead) and look_ahead > 0):
            raise ValueError(f"look_ahead must be positive and finite, got {look_ahead}")
        self._robot = robot
        self._look_ahead = look_ahead
        self._turn_gain = turn_gain
        self._pose_port = self.DeclareVectorInputPort("pose", 3)
        self._intention_port = self.DeclareAbstractInputPort("intention", Value(EMPTY_INTENTION))
        self.DeclareVectorOutputPort(
            "autonomous_command",
            2,
            self._calc_command,
            {
                self.input_port_ticket(self._pose_port.get_index()),
                self.input_port_ticket(self._intention_port.get_index()),
            },
        )

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        intention: Intention = self._intention_port.Eval(context)
        goal_x, goal_y = intention.position(intention.time + self._look_ahead)
        x, y, yaw = self._pose_port.Eval(context).tolist()
        output.set_value(np.array(self._command(goal_x - x, goal_y - y, yaw)))

    def _command(self, dx: float, dy: float, yaw: float) -> tuple[float, float]:
        distance = math.hypot(dx, dy)
        if not math.isfinite(distance):
            return math.nan, math.nan
        if distance < _THERE:
            return 0.0, 0.0
        bearing = math.remainder(math.atan2(dy, dx) - yaw, math.tau)
        if abs(bearing) > 0.5 * math.pi:
            return self._robot.wheel_speeds(0.0, self._turn_gain * bearing)
        # The chord of length d at angle b belongs to an arc of length d b/sin b and curvature 2 sin b/d.
        turn = 2.0 * bearing / self._look_ahead
        arc = distance * (bearing / math.sin(bearing) if abs(bearing) > 1e-6 else 1.0)
        return self._robot.wheel_speeds(arc / self._look_ahead, turn)
