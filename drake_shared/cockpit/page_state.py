"""The messages about the task, the running trial and its result; see docs/websocket_protocol.md."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem

from drake_shared.analysis.metrics import metrics
from drake_shared.analysis.scene_data import describe_task
from drake_shared.arbitration.feedback import Feedback
from drake_shared.cockpit.floor_plan import describe_instructed_routes, thinned
from drake_shared.cockpit.reasons import DemonstratedRoutes, Reason, Surroundings, reason_for
from drake_shared.learners import Learner
from drake_shared.learners.loss_threshold import early_stop
from drake_shared.robots import scaled_length
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
        "command_unit": robot.command_units[0],
        "learner": None if learner is None else learner.name,
        "learner_warning": None if learner is None else early_stop(learner.metadata),
        "driven": driven,
        "feedback": {"rumble": feedback.rumble, "tone": feedback.tone} if feedback else None,
        "routes": describe_instructed_routes(scenario),
    }


class StateReader:
    """Reads what the page shows of a running trial."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._multiplexer = simulation.diagram.GetSubsystemByName("log_multiplexer")
        self._port = self._multiplexer.get_output_port()
        self._scale = scaled_length(simulation.robot, 1.0)
        demonstrations = None if simulation.learner is None else simulation.learner.demonstrations
        self._routes = None
        if demonstrations is not None and demonstrations.shape[-1] == 2:
            self._routes = DemonstratedRoutes(demonstrations, scale=self._scale)
        self._before: tuple[float, float, float, float] | None = None

    def read(self, running: RunningTrial) -> dict[str, float]:
        """Returns the current value of each column of the log.

        This is cheap at a control step, where the values are cached; between steps it costs a prediction.
        """
        context = self._multiplexer.GetMyContextFromRoot(running.root)
        values = self._port.Eval(context).tolist()
        return dict(zip(self._simulation.parts.columns, values, strict=True))

    def describe(
        self, running: RunningTrial, values: Mapping[str, float], *, paused: bool = False
    ) -> dict[str, Any]:
        """Returns the ``now`` message of a control step, at which `read` returned ``values``."""
        parts = self._simulation.parts
        # At the start nobody has touched the controls, which is not worth a warning.
        let_go = parts.release_reason(running.root) if running.time > 0.0 else None
        estimator = parts.estimator
        intention = estimator.get_intention_output_port().Eval(estimator.GetMyContextFromRoot(running.root))
        surroundings = None
        if self._routes is not None and math.isfinite(values["x"] + values["y"]):
            surroundings = self._routes.look(intention.first, np.array([values["x"], values["y"]]))
        reason = reason_for(
            values,
            mode=running.driver,
            has_learner=self._simulation.learner is not None,
            arbitration=self._simulation.config.arbitration,
            let_go=let_go,
            surroundings=surroundings,
            scale=self._scale,
            paused=paused,
        )
        described = describe_now(
            values,
            running.time,
            let_go,
            reason=reason,
            surroundings=surroundings,
            commands=self._simulation.robot.command_names[:2],
        )
        if "yaw" not in values:
            described["pose"] = _numbers(values["x"], values["y"], 0.0)  # The shadow of an arm's tip.
        described["motion"] = self._motion(values, running.time)
        return described

    def _motion(self, values: Mapping[str, float], time: float) -> list[float | None]:
        """Speed in [m/s] and yaw rate in [rad/s] since the step before: the robot's own, not the command."""
        now = (time, values["x"], values["y"], values.get("yaw", math.nan))
        before, self._before = self._before, now
        if before is None or now[0] <= before[0]:
            return [0.0, 0.0]
        period, dx, dy, turned = (new - old for new, old in zip(now, before, strict=True))
        ahead = dx * math.cos(now[3]) + dy * math.sin(now[3])
        return _numbers(math.copysign(math.hypot(dx, dy), ahead) / period, turned / period)


def describe_now(
    values: Mapping[str, float],
    time: float,
    let_go: str | None = None,
    *,
    reason: Reason | None = None,
    surroundings: Surroundings | None = None,
    commands: Sequence[str] = ("left", "right"),
) -> dict[str, Any]:
    """Returns the ``now`` message: the values that the page shows during a trial.

    Args:
        values: Value of each column of the log; those of a real robot may lack clearance and contact.
        time: Time since the start of the trial, in [s].
        let_go: Why the agent gives up its authority, if it does.
        reason: Why the control is divided as it is, if it is known.
        surroundings: Where the robot is among the demonstrations, if they are known.
        commands: Names of the two elements of a command that are shown.
    """
    return {
        "t": round(time, 3),
        "let_go": let_go,
        "reason": reason,
        "open_routes": None if surroundings is None else surroundings.open_routes,
        "human_weight": _number(values["human_weight"]),
        "confidence": _number(values["confidence"]),
        "driver_noise": _number(values.get("driver_noise")),
        "human": _pair(values, "human", commands),
        "autonomous": _pair(values, "autonomous", commands),
        "shared": _pair(values, "shared", commands),
        "motion": None,
        "pose": _numbers(values.get("x"), values.get("y"), values.get("yaw")),
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
    names = ("x", "y", "human_weight", "confidence", "contact")
    rows = np.column_stack([trial["t"], *(trial[name] for name in names)])
    result: dict[str, Any] = {name: _number(measures.get(name)) for name in SHOWN_METRICS}
    return result | {
        "status": trial.status,
        "collision": bool(measures["collision"]),
        "time": round(float(trial["t"][-1]), 2) if len(trial["t"]) else 0.0,
        "mode": trial.metadata["mode"],
        "intent_success": measures["intent_success"],
        "route": trial.metadata.get("route"),
        "rows": [_numbers(*row) for row in thinned(rows)],
        "saved": saved,
        "trouble": trouble,
        "failure": trial.metadata.get("failure"),
    }


def _pair(values: Mapping[str, float], who: str, names: Sequence[str]) -> list[float | None]:
    return _numbers(*(values[f"{who}_{name}"] for name in names))


def _numbers(*values: float | None) -> list[float | None]:
    return [_number(value) for value in values]


def _number(value: Any) -> float | None:
    """JSON has neither NaN nor infinity: null takes their place, and the page shows a dash."""
    if value is None or not math.isfinite(value):
        return None
    return round(float(value), 4)
