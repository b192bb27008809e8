"""What if another arbiter had divided the control: recorded human input, played in open loop.

The person saw what the robot did then, not what it does now: as soon as the two part, the commands answer a
world that is no longer there. So the outcome is marked as open loop wherever it goes, and measures are taken
only until the robot has left the recorded way.
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
from drake_shared.scenario import Start, scenario_from_dict
from drake_shared.simulation.config import SharedControlConfig, config_of_log
from drake_shared.simulation.faults import Faults
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings
from drake_shared.systems.recorded_input import RecordedInput

LEFT = 0.1
"""The recorded way is left where both poses are so far apart, in [m]."""
# What a trial ends in says nothing of one that is looked at only in part.
_OF_THE_END = ("success", "intent_success", "timeout", "completion_time")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Counterfactual:
    """A recorded human input under another arbiter.

    Attributes:
        trial: What happened, up to the time at which the record ends. Its metadata say ``open_loop``, when
            the recorded pose was left, and whose trial was recorded.
        left_at: When the pose had left the recorded one by LEFT, in [s]; None if it never did.
    """

    trial: Trial
    left_at: float | None

    @property
    def until_left(self) -> Trial:
        """The part of the trial in which the human input is still an answer to what the robot does."""
        if self.left_at is None:
            return self.trial
        rows = slice(0, int(self.trial["t"].searchsorted(self.left_at)) + 1)
        columns = {name: values[rows] for name, values in self.trial.columns.items()}
        return Trial(columns=columns, metadata={**self.trial.metadata, "status": "left_recorded_pose"})

    def measures(self) -> dict[str, Any]:
        """The measures of that part; what the end of a trial decides is None if the end is not in it."""
        measured: dict[str, Any] = {**metrics(self.until_left)}
        if self.left_at is not None:
            measured |= dict.fromkeys(_OF_THE_END)
        return measured


def play_open_loop(
    recorded: Trial,
    *,
    config: SharedControlConfig | None = None,
    arbiter: LeafSystem | None = None,
    learner: Learner | None = None,
) -> Counterfactual:
    """Plays the human commands of ``recorded``, from where it began, under another arbiter.

    Args:
        recorded: The trial.
        config: How control is shared; if None, as in the recorded trial, but without its faults and its
            safety filter.
        arbiter: A system in place of the config's arbiter.
        learner: The one that took part, or another.

    Raises:
        InputError: The log holds no valid scenario or config, there is no such arbiter, or the commands are
            not finite.
    """
    told = recorded.metadata
    scenario = scenario_from_dict(told["scenario"], source="the log's scenario")
    x, y, yaw = (float(recorded[name][0]) for name in ("x", "y", "yaw"))
    simulation = Simulation(
        dataclasses.replace(scenario, start=Start(x=x, y=y, yaw=yaw)),
        learner=learner,
        config=config or open_loop_config(told),
        operator=RecordedInput(period=scenario.control_period),
        arbiter=arbiter,
    )
    same_learner = learner is not None and learner.metadata.get("id") == told.get("learner_id")
    running = simulation.begin(
        TrialSettings(
            route=told.get("route"),
            then=told.get("then"),
            # The last row of a log was never applied.
            recording=recorded.commands("human")[:-1],
            confidence_gain=_confidence_gain(told) if same_learner else None,
        )
    )
    # Of what the person would have done after the end of the record nothing is known.
    running.advance(float(recorded["t"][-1]))
    left_at = _left_at(recorded, running.finish())
    source = {name: told.get(name) for name in ("operator", "mode", "arbitration", "seed", "status")}
    trial = running.finish(
        running.status or "record_ended", open_loop=True, left_recorded_pose_at=left_at, recorded=source
    )
    return Counterfactual(trial=trial, left_at=left_at)


def _left_at(recorded: Trial, played: Trial) -> float | None:
    rows = min(len(recorded["t"]), len(played["t"]))
    apart = np.hypot(*(played.positions[:rows] - recorded.positions[:rows]).T)
    # A log may hold NaN where somebody wrote it by hand: nobody is there.
    left = np.flatnonzero(~(apart < LEFT))
    return float(played["t"][left[0]]) if left.size else None


def open_loop_config(metadata: Mapping[str, Any]) -> SharedControlConfig:
    """The config of a recorded trial for shared control without faults and without a safety filter.

    Args:
        metadata: Of the trial's log.

    Raises:
        InputError: They hold no valid config.
    """
    config = config_of_log(metadata)
    return dataclasses.replace(
        config, driver="shared", faults=Faults(), safety_clearance=None, confidence_gain=None
    )


def _confidence_gain(metadata: Mapping[str, Any]) -> float | None:
    gain = metadata.get("confidence_gain")
    if gain is None:
        return None
    if isinstance(gain, bool) or not isinstance(gain, int | float) or not 0 < gain < math.inf:
        raise InputError("the log", "confidence_gain", "must be positive and finite", repr(gain))
    return gain
