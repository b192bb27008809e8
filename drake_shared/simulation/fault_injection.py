"""The systems of faults, between those of the loop."""

from __future__ import annotations

from pydrake.common import RandomDistribution
from pydrake.systems.framework import DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import RandomSource

from drake_shared.simulation.faults import Faults
from drake_shared.systems.channel_fault import ChannelFault
from drake_shared.systems.learner_fault import LearnerFault
from drake_shared.systems.pose_fault import PoseFault
from drake_shared.systems.wheel_slip import WheelSlip

_DRAWN = {"noise": RandomDistribution.kGaussian, "chance": RandomDistribution.kUniform}


class FaultInjection:
    """Puts the systems that ``faults`` need into a diagram; where nothing goes wrong there is none.

    Each method is given the ports of what is right and returns those of what arrives, the same ones if
    there is no such fault.

    Args:
        builder: Of the diagram.
        faults: None goes wrong if None.
        period: Of the control step, in [s].

    Attributes:
        logged: What arrived, with the names of its columns in a log.
    """

    def __init__(self, builder: DiagramBuilder, faults: Faults | None, period: float) -> None:
        self._builder = builder
        self._faults = faults or Faults()
        self._period = period
        self._random: list[LeafSystem] = []
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
            period=self._period,
        )
        self._insert("channel_fault", fault, sent=human)
        return self._log(fault, "received", ("received_left", "received_right"))

    def pose(self, pose: OutputPort) -> tuple[OutputPort, OutputPort]:
        """The pose as it is seen by the agent, and as it is shown to the operator."""
        if not self._faults.on_pose:
            return pose, pose
        faults = self._faults
        fault = PoseFault(
            noise=faults.pose_noise,
            yaw_noise=faults.yaw_noise,
            drift=faults.pose_drift,
            nan=faults.pose_nan,
            period=self._period,
        )
        self._insert("pose_fault", fault, pose=pose)
        seen = self._log(fault, "seen_pose", ("seen_x", "seen_y", "seen_yaw"))
        return seen, fault.GetOutputPort("shown_pose")

    def learner(self, intention: OutputPort, confidence: OutputPort) -> tuple[OutputPort, OutputPort]:
        """What the learner says, as it arrives."""
        if not self._faults.on_learner:
            return intention, confidence
        fault = LearnerFault(
            delay=self._faults.late_learner, nan=self._faults.learner_nan, period=self._period
        )
        self._insert("learner_fault", fault, intention=intention, confidence=confidence)
        heard = self._log(fault, "late_confidence", ("heard_confidence",))
        return fault.GetOutputPort("late_intention"), heard

    def wheels(self, command: OutputPort) -> OutputPort:
        """The command as the ground lets it come true."""
        if not self._faults.slip:
            return command
        fault = WheelSlip(slip=self._faults.slip)
        self._insert("wheel_slip", fault, wheel_command=command)
        return self._log(fault, "slipped_command", ("slipped_left", "slipped_right"))

    def add_chance(self) -> None:
        """Connects what is random. After all else: the order decides what a seed draws for whom."""
        for fault in self._random:
            for name, distribution in _DRAWN.items():
                if fault.HasInputPort(name):
                    port = fault.GetInputPort(name)
                    source = RandomSource(distribution, port.size(), self._period)
                    self._builder.AddNamedSystem(f"{fault.get_name()}_{name}", source)
                    self._builder.Connect(source.get_output_port(), port)

    def _insert(self, name: str, fault: LeafSystem, **inputs: OutputPort) -> None:
        self._builder.AddNamedSystem(name, fault)
        for port, source in inputs.items():
            self._builder.Connect(source, fault.GetInputPort(port))
        self._random.append(fault)

    def _log(self, fault: LeafSystem, port: str, columns: tuple[str, ...]) -> OutputPort:
        self.logged[columns] = fault.GetOutputPort(port)
        return self.logged[columns]
