"""A robot that is controlled over UDP, in place of a simulated plant."""

from __future__ import annotations

import contextlib
import math
import socket
import struct
import time

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem


class UdpPlant(LeafSystem):
    """Sends wheel commands over UDP and receives poses; udp_robot.py describes the packets.

    .. pydrake_system::

        name: UdpPlant
        input_ports:
        - wheel_command
        - enable
        - pose_fresh
        output_ports:
        - pose
        - pose_age

    Inputs:
        wheel_command (2): Wheel speeds [left, right], in [rad/s].
        enable (1), pose_fresh (1): If one of them is 0, or the command is not finite, zero is sent.

    Outputs (discrete state):
        pose (3): The newest pose, [x, y, yaw] in [m, m, rad]; NaN until the first one arrives.
        pose_age (1): Time since it arrived, in [s]; infinite until then.

    Args:
        address: Host and port of the robot.
        period: Time between commands, in [s].
    """

    def __init__(self, address: tuple[str, int], *, period: float) -> None:
        super().__init__()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(address)
        self._socket.setblocking(False)
        self._sent = self._received = 0
        self._arrival = -math.inf
        self._command_port = self.DeclareVectorInputPort("wheel_command", 2)
        self._enable_port = self.DeclareVectorInputPort("enable", 1)
        self._fresh_port = self.DeclareVectorInputPort("pose_fresh", 1)
        self._pose = self.DeclareDiscreteState(np.full(3, math.nan))
        self._age = self.DeclareDiscreteState([math.inf])
        self.DeclareStateOutputPort("pose", self._pose)
        self.DeclareStateOutputPort("pose_age", self._age)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._receive)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._send)

    def _receive(self, context: Context, state: DiscreteValues) -> None:
        while True:
            try:
                sequence, *pose = struct.unpack("<Iddd", self._socket.recv(64))
            except (OSError, struct.error):  # No packet is waiting, or the robot is not running yet.
                break
            if sequence > self._received and all(map(math.isfinite, pose)):
                self._received, self._arrival = sequence, time.monotonic()
                state.set_value(self._pose, pose)
        state.set_value(self._age, [time.monotonic() - self._arrival])

    def _send(self, context: Context) -> None:
        command = self._command_port.Eval(context)
        enabled = self._enable_port.Eval(context)[0] and self._fresh_port.Eval(context)[0]
        if not (enabled and np.all(np.isfinite(command))):
            command = np.zeros(2)
        self._sent += 1
        with contextlib.suppress(OSError):  # The robot is not running yet.
            self._socket.send(struct.pack("<Idd", self._sent, *command))
