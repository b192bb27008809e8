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
from drake_shared.arbitration.authority import Authority
from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.scenario import Start, scenario_from_dict
from drake_shared.simulation.trial import Simulation, Trial, TrialSettings
from drake_shared.systems.arbiters import DEFAULT
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
        measured = metrics(self.until_left)
        if self.left_at is not None:
            measured |= dict.fromkeys(_OF_THE_END)
        return measured


def play_open_loop(
    recorded: Trial,
    *,
    arbiter: LeafSystem | str,
    learner: Learner | None = None,
    authority: Authority | bool | None = None,
) -> Counterfactual:
    """Plays the human commands of ``recorded``, from where it began, under another arbiter.

    Args:
        recorded: The trial.
        arbiter: A name or a system, see `drake_shared.systems.arbiters`.
        learner: The one that took part, or another.
        authority: What "blend" leaves to the human: True is the default, False nothing. If None it is what
            was left in the recorded trial if that was a blend, too, and else what the learner's preset says.

    Raises:
        InputError: The log's scenario is none, there is no such arbiter, or the commands are no numbers.
    """
    told = recorded.metadata
    scenario = scenario_from_dict(told["scenario"], source="the log's scenario")
    x, y, yaw = (float(recorded[name][0]) for name in ("x", "y", "yaw"))
    simulation = Simulation(
        dataclasses.replace(scenario, start=Start(x=x, y=y, yaw=yaw)),
        learner=learner,
        operator=RecordedInput(period=scenario.control_period),
        arbiter=arbiter,
        authority=_authority(told) if authority is None and arbiter == DEFAULT else authority,
        look_ahead=_number(told, "look_ahead", 0.6),
    )
    same_learner = learner is not None and learner.metadata.get("id") == told.get("learner_id")
    running = simulation.begin(
        TrialSettings(
            route=told.get("route"),
            then=told.get("then"),
            # The last row of a log was never applied.
            recording=recorded.commands("human")[:-1],
            confidence_gain=_number(told, "confidence_gain", None) if same_learner else None,
            end="duration" if told.get("end") == "duration" else "reached",
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


def _authority(told: Mapping[str, Any]) -> Authority | bool | None:
    """What was left to the human in the recorded trial; None if it was no blend."""
    if "arbitration" not in told:
        return False  # Of a time when there was none.
    try:
        if told["arbitration"]["name"] != DEFAULT:
            return None
        left = told["arbitration"]["configuration"]["authority"]
        return False if left is None else Authority(**left)
    except (KeyError, TypeError) as error:
        raise InputError("the log", "arbitration", "must be name and configuration of an arbiter") from error


def _number(told: Mapping[str, Any], field: str, default: Any) -> Any:
    value = told.get(field, default)
    if value is default:
        return default
    if isinstance(value, bool) or not isinstance(value, int | float) or not (0 < value < math.inf):
        raise InputError("the log", field, "must be positive and finite", repr(value))
    return value
