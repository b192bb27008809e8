"""Counterfactual trials: recorded human input replayed in open loop under another arbiter.

The human reacted to the recorded motion of the robot. Once the replayed motion deviates from it, the commands
no longer fit. So the result is marked as open loop in its metadata, and metrics cover only the time until the
robot leaves the recorded path.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem

from drake_shared.analysis.metrics import metrics
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.robots.description import require_diff_drive
from drake_shared.scenario import Start, scenario_from_dict
from drake_shared.simulation.config import SharedControlConfig, config_of_log
from drake_shared.simulation.faults import Faults
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings
from drake_shared.systems.recorded_input import RecordedInput

MAX_DEVIATION = 0.1
"""Distance of the replayed from the recorded position at which the recorded path is left, in [m]."""
# Metrics that the end of a trial decides: undefined for a part of it.
_OUTCOMES = ("success", "intent_success", "timeout", "completion_time")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Counterfactual:
    """A recorded human input under another arbiter.

    Attributes:
        trial: The replayed trial, up to the end of the recording. Its metadata hold ``open_loop``, the time
            at which the recorded path was left, and the recorded trial's operator and arbitration.
        left_at: Time at which the position deviated by MAX_DEVIATION, in [s]; None if it never did.
    """

    trial: Trial
    left_at: float | None

    @property
    def until_left(self) -> Trial:
        """The part of the trial before the recorded path is left, in which the human input is valid."""
        if self.left_at is None:
            return self.trial
        rows = slice(0, int(self.trial["t"].searchsorted(self.left_at)) + 1)
        columns = {name: values[rows] for name, values in self.trial.columns.items()}
        return Trial(columns=columns, metadata={**self.trial.metadata, "status": "left_recorded_pose"})

    def metrics(self) -> dict[str, Any]:
        """The metrics of that part; None for those that the end of a trial decides, if it is not in it."""
        measured: dict[str, Any] = {**metrics(self.until_left)}
        if self.left_at is not None:
            measured |= dict.fromkeys(_OUTCOMES)
        return measured

    measures = metrics
    """The name of this method in version 0.1.0."""


def play_open_loop(
    recorded: Trial,
    *,
    config: SharedControlConfig | None = None,
    arbiter: LeafSystem | None = None,
    learner: Learner | None = None,
) -> Counterfactual:
    """Replays the human commands of ``recorded``, from the same start, under another arbiter.

    Args:
        recorded: The recorded trial.
        config: How control is shared; if None, as in the recorded trial, but without its faults.
        arbiter: A system in place of the config's arbiter.
        learner: The one that took part, or another.

    Raises:
        InputError: The robot is not a differential drive, the log holds no valid scenario or config, there is
            no such arbiter, or the commands are not finite.
    """
    metadata = recorded.metadata
    require_diff_drive(metadata, "to be replayed")
    scenario = scenario_from_dict(metadata["scenario"], source="the log's scenario")
    x, y, yaw = (float(recorded[name][0]) for name in ("x", "y", "yaw"))
    simulation = Simulation(
        dataclasses.replace(scenario, start=Start(x=x, y=y, yaw=yaw)),
        learner=learner,
        config=config or open_loop_config(metadata),
        operator=RecordedInput(period=scenario.control_period),
        arbiter=arbiter,
    )
    same_learner = learner is not None and learner.metadata.get("id") == metadata.get("learner_id")
    running = simulation.begin(
        TrialSettings(
            route=metadata.get("route"),
            then=metadata.get("then"),
            # The last row of a log is not applied.
            recording=recorded.commands("human")[:-1],
            confidence_gain=_confidence_gain(metadata) if same_learner else None,
        )
    )
    # Nothing is known about the human input after the end of the recording.
    running.advance(float(recorded["t"][-1]))
    left_at = _left_at(recorded, running.finish())
    source = {name: metadata.get(name) for name in ("operator", "mode", "arbitration", "seed", "status")}
    trial = running.finish(
        running.status or "record_ended", open_loop=True, left_recorded_pose_at=left_at, recorded=source
    )
    return Counterfactual(trial=trial, left_at=left_at)


def _left_at(recorded: Trial, played: Trial) -> float | None:
    rows = min(len(recorded["t"]), len(played["t"]))
    deviation = np.linalg.norm(played.positions[:rows] - recorded.positions[:rows], axis=1)
    # NaN, possible in a log from elsewhere, counts as a deviation.
    left = np.flatnonzero(~(deviation < MAX_DEVIATION))
    return float(played["t"][left[0]]) if left.size else None


def open_loop_config(metadata: Mapping[str, Any]) -> SharedControlConfig:
    """The config of a recorded trial for shared control without faults.

    Args:
        metadata: Of the trial's log.

    Raises:
        InputError: They hold no valid config.
    """
    config = config_of_log(metadata)
    return dataclasses.replace(config, driver="shared", faults=Faults(), confidence_gain=None)


def _confidence_gain(metadata: Mapping[str, Any]) -> float | None:
    gain = metadata.get("confidence_gain")
    if gain is None:
        return None
    if isinstance(gain, bool) or not isinstance(gain, int | float) or not 0 < gain < math.inf:
        raise InputError("the log", "confidence_gain", "must be positive and finite", repr(gain))
    return gain
