"""A simulated differential-drive robot that is controlled over UDP, in place of a real one.

Usage: python examples/udp_robot.py [PORT]

It receives commands, "<Idd": sequence number, left and right wheel speed in [rad/s]. It sends its pose to the
sender of the last command, "<Iddd": sequence number, x and y in [m], yaw in [rad]. As every robot should, it
stops by itself when commands cease.
"""

from __future__ import annotations

import math
import socket
import struct
import sys
import threading
import time

from drake_shared.robots import DiffDrive

COMMAND_TIMEOUT = 0.2  # s
PERIOD = 0.01  # s


class UdpRobotSimulator:
    """The robot.

    Attributes:
        address: Host and port that commands are sent to.
        pose: [x, y, yaw] in [m, m, rad].
        history: (time in [s], left, right wheel speed in [rad/s]) of every step.
        frozen: True stops the poses, as when the localisation fails.
        stopped: Ends :meth:`run` when set.
    """

    def __init__(self, port: int = 0) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._socket.setblocking(False)
        self.address: tuple[str, int] = self._socket.getsockname()
        self.pose = (0.0, 0.0, 0.0)
        self.history: list[tuple[float, float, float]] = []
        self.frozen = False
        self.stopped = threading.Event()
        self._controller: tuple[str, int] | None = None
        self._newest = 0
        self._command = (0.0, 0.0)
        self._command_time = -math.inf

    def run(self) -> None:
        """Runs in real time until ``stopped`` is set."""
        robot, sequence = DiffDrive(), 0
        while not self.stopped.wait(PERIOD):
            self._receive()
            if time.monotonic() - self._command_time > COMMAND_TIMEOUT:
                self._command = (0.0, 0.0)
            self.history.append((time.monotonic(), *self._command))
            speed, yaw_rate = robot.twist(*self._command)
            x, y, yaw = self.pose
            x, y = x + PERIOD * speed * math.cos(yaw), y + PERIOD * speed * math.sin(yaw)
            self.pose = (x, y, yaw + PERIOD * yaw_rate)
            sequence += 1
            if self._controller is not None and not self.frozen:
                self._socket.sendto(struct.pack("<Iddd", sequence, *self.pose), self._controller)
        self._socket.close()

    def _receive(self) -> None:
        while True:
            try:
                packet, sender = self._socket.recvfrom(64)
                sequence, left, right = struct.unpack("<Idd", packet)
            except BlockingIOError:
                return
            except struct.error:
                continue
            # A new controller starts a new sequence; late packets of the present one are dropped.
            if sender != self._controller or sequence > self._newest:
                self._controller, self._newest = sender, sequence
                self._command, self._command_time = (left, right), time.monotonic()


if __name__ == "__main__":
    simulator = UdpRobotSimulator(int(sys.argv[1]) if len(sys.argv) > 1 else 9000)
    print("robot at", *simulator.address, flush=True)
    simulator.run()
