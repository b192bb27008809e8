"""Inserts the systems that cause faults between those of the loop."""

from __future__ import annotations

from pydrake.common import RandomDistribution
from pydrake.systems.framework import DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import RandomSource

from drake_shared.robots import Robot
from drake_shared.simulation.faults import Faults
from drake_shared.systems.channel_fault import ChannelFault
from drake_shared.systems.learner_fault import LearnerFault
from drake_shared.systems.pose_fault import PoseFault
from drake_shared.systems.wheel_slip import WheelSlip

_DISTRIBUTIONS = {"noise": RandomDistribution.kGaussian, "chance": RandomDistribution.kUniform}


class FaultInjection:
    """Inserts the systems that ``faults`` need into a diagram, and no others.

    Each method takes the true output ports and returns those with faults, which are the same ones where
    there is no such fault.

    Args:
        builder: Of the diagram.
        faults: What to inject.
        robot: Names the columns of the log, and the sizes of pose and command.
        period: Of the control step, in [s].
        prefix: Of the names of the systems.

    Attributes:
        logged: Output ports with faults, by the names of their columns in a log.
    """

    def __init__(
        self, builder: DiagramBuilder, faults: Faults, *, robot: Robot, period: float, prefix: str = ""
    ) -> None:
        self._builder = builder
        self._faults = faults
        self._robot = robot
        self._period = period
        self._prefix = prefix
        self._inserted: list[LeafSystem] = []
        self.logged: dict[tuple[str, ...], OutputPort] = {}

    def channel(self, human: OutputPort) -> OutputPort:
        """The human's command as it is received."""
        if not self._faults.on_channel:
            return human
        faults = self._faults
        fault = ChannelFault(
            delay=faults.delay,
            jitter=faults.jitter,
            loss=faults.loss,
            freeze_time=faults.freeze_time,
            freeze=faults.freeze,
            nan=faults.human_nan,
            size=len(self._robot.command_names),
            period=self._period,
        )
        self._insert("channel_fault", fault, sent=human)
        return self._log(fault, "received", "received", self._robot.command_names)

    def pose(self, pose: OutputPort) -> tuple[OutputPort, OutputPort]:
        """The pose as the agent measures it, and as it is shown to the operator."""
        if not self._faults.on_pose:
            return pose, pose
        faults = self._faults
        fault = PoseFault(
            noise=faults.pose_noise,
            yaw_noise=faults.yaw_noise,
            drift=faults.pose_drift,
            nan=faults.pose_nan,
            robot=self._robot,
            period=self._period,
        )
        self._insert("pose_fault", fault, pose=pose)
        seen = self._log(fault, "seen_pose", "seen", self._robot.configuration_names)
        return seen, fault.GetOutputPort("shown_pose")

    def learner(self, intention: OutputPort, confidence: OutputPort) -> tuple[OutputPort, OutputPort]:
        """The learner's output, delayed or corrupted."""
        if not self._faults.on_learner:
            return intention, confidence
        fault = LearnerFault(
            delay=self._faults.late_learner,
            nan=self._faults.learner_nan,
            robot=self._robot,
            period=self._period,
        )
        self._insert("learner_fault", fault, intention=intention, confidence=confidence)
        late_confidence = self._log(fault, "late_confidence", "heard", ("confidence",))
        return fault.GetOutputPort("late_intention"), late_confidence

    def wheels(self, command: OutputPort) -> OutputPort:
        """The command that the wheels follow in spite of slip."""
        if not self._faults.slip:
            return command
        fault = WheelSlip(slip=self._faults.slip, size=len(self._robot.command_names))
        self._insert("wheel_slip", fault, wheel_command=command)
        return self._log(fault, "slipped_command", "slipped", self._robot.command_names)

    def add_noise(self) -> None:
        """Connects random sources. Call it last: their order decides which numbers a seed gives to whom."""
        for fault in self._inserted:
            for name, distribution in _DISTRIBUTIONS.items():
                if fault.HasInputPort(name):
                    port = fault.GetInputPort(name)
                    source = RandomSource(distribution, port.size(), self._period)
                    self._builder.AddNamedSystem(f"{fault.get_name()}_{name}", source)
                    self._builder.Connect(source.get_output_port(), port)

    def _insert(self, name: str, fault: LeafSystem, **inputs: OutputPort) -> None:
        self._builder.AddNamedSystem(f"{self._prefix}{name}", fault)
        for port, source in inputs.items():
            self._builder.Connect(source, fault.GetInputPort(port))
        self._inserted.append(fault)

    def _log(self, fault: LeafSystem, port: str, prefix: str, names: tuple[str, ...]) -> OutputPort:
        columns = tuple(f"{prefix}_{name}" for name in names)
        self.logged[columns] = fault.GetOutputPort(port)
        return self.logged[columns]
