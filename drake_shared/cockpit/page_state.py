"""The messages about the task, the running trial and its result; see docs/websocket_protocol.md."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pydrake.systems.framework import LeafSystem

from drake_shared.analysis.metrics import metrics
from drake_shared.analysis.scene_data import describe_task
from drake_shared.arbitration.feedback import Feedback
from drake_shared.learners import Learner
from drake_shared.learners.loss_threshold import early_stop
from drake_shared.scenario import Scenario
from drake_shared.simulation.trial import RunningTrial, Simulation, Trial
from drake_shared.systems.mouse_input import MouseInput

SHOWN_METRICS = (
    "completion_time",
    "human_effort",
    "mean_human_weight",
    "disagreement_rate",
    "clearance",
    "path_length",
    "smoothness",
)

_CONFLICT = ("conflict", "conflict_left", "conflict_right")


def describe_scene(
    scenario: Scenario,
    operator: LeafSystem,
    learner: Learner | None,
    feedback: Feedback | None = None,
) -> dict[str, Any]:
    """Returns the ``scene`` message: what is the same in all trials."""
    robot = scenario.robot
    driven = isinstance(operator, MouseInput)
    return describe_task(scenario) | {
        "scenario": scenario.name,
        "duration": scenario.duration,
        "max_speed": operator.max_speed if driven else robot.max_speed,
        "max_yaw_rate": operator.max_yaw_rate if driven else 2.0,
        "learner": None if learner is None else learner.name,
        "learner_warning": None if learner is None else early_stop(learner.metadata),
        "driven": driven,
        "feedback": {"rumble": feedback.rumble, "tone": feedback.tone} if feedback else None,
    }


class LogReader:
    """Reads the current values of the log's columns in a running trial."""

    def __init__(self, simulation: Simulation) -> None:
        self._columns = simulation.parts.columns
        multiplexer = simulation.diagram.GetSubsystemByName("log_multiplexer")
        self._multiplexer = multiplexer
        self._port = multiplexer.get_output_port()
        self._parts = simulation.parts

    def read(self, running: RunningTrial) -> dict[str, float]:
        """Returns the current value of each column of the log.

        This is cheap at a control step, where the values are cached; between steps it costs a prediction.
        """
        context = self._multiplexer.GetMyContextFromRoot(running.root)
        return dict(zip(self._columns, self._port.Eval(context).tolist(), strict=True))

    def read_let_go(self, running: RunningTrial) -> str | None:
        """Returns why the agent gives up control, or None; see `drake_shared.systems.arbiter.Arbiter`."""
        return self._parts.release_reason(running.root)


def describe_now(values: Mapping[str, float], time: float, let_go: str | None = None) -> dict[str, Any]:
    """Returns the ``now`` message: the values that the page shows during a trial.

    Args:
        values: Value of each column of the log; those of a real robot may lack clearance and contact.
        time: Time since the start of the trial, in [s].
        let_go: Why the agent gives up its authority, if it does.
    """
    return {
        "t": round(time, 3),
        "let_go": let_go,
        "pose": _numbers(*(values.get(name) for name in ("x", "y", "yaw"))),
        "human_weight": _number(values["human_weight"]),
        "confidence": _number(values["confidence"]),
        "human": _pair(values, "human"),
        "autonomous": _pair(values, "autonomous"),
        "shared": _pair(values, "shared"),
        "clearance": _number(values.get("clearance")),
        "contact": values.get("contact", 0.0) > 0.5,
        "stick": _numbers(values.get("stick_forward"), values.get("stick_left")),
        "conflict": [_number(values[name]) for name in _CONFLICT] if "conflict" in values else None,
    }


def describe_result(trial: Trial, saved: str | None, trouble: str | None) -> dict[str, Any]:
    """Returns the ``result`` of a ``trial`` message.

    Args:
        trial: The finished trial.
        saved: Name of its log's file, if it was saved.
        trouble: Why it was not saved, if it should have been.
    """
    measures = metrics(trial)
    result: dict[str, Any] = {name: _number(measures.get(name)) for name in SHOWN_METRICS}
    return result | {
        "status": trial.status,
        "collision": bool(measures["collision"]),
        "time": round(float(trial["t"][-1]), 2) if len(trial["t"]) else 0.0,
        "mode": trial.metadata["mode"],
        "saved": saved,
        "trouble": trouble,
        "failure": trial.metadata.get("failure"),
    }


def _pair(values: Mapping[str, float], who: str) -> list[float | None]:
    return _numbers(values[f"{who}_left"], values[f"{who}_right"])


def _numbers(*values: float | None) -> list[float | None]:
    return [_number(value) for value in values]


def _number(value: Any) -> float | None:
    """JSON has neither NaN nor infinity: null takes their place, and the page shows a dash."""
    if value is None or not math.isfinite(value):
        return None
    return round(float(value), 4)
