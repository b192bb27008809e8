"""What the page is told of a task, of a trial under way, and of one that is over, as JSON holds it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from drake_shared.analysis.metrics import metrics
from drake_shared.scenario import Scenario
from drake_shared.simulation.trial import RunningTrial, Simulation, Trial
from drake_shared.systems.confidence_blender import ConfidenceBlender
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


def describe_scene(simulation: Simulation) -> dict[str, Any]:
    """What stays the same from trial to trial. Lengths in [m], times in [s], speeds in [m/s], [rad/s]."""
    scenario: Scenario = simulation.scenario
    space, robot, operator = scenario.workspace, scenario.robot, simulation.parts.operator
    learner = simulation.learner
    driven = isinstance(operator, MouseInput)
    return {
        "scenario": scenario.name,
        "duration": scenario.duration,
        "workspace": [space.x_min, space.x_max, space.y_min, space.y_max],
        "wheel_radius": robot.wheel_radius,
        "track": robot.track,
        "max_speed": operator.max_speed if isinstance(operator, MouseInput) else robot.max_speed,
        "max_yaw_rate": operator.max_yaw_rate if isinstance(operator, MouseInput) else 2.0,
        "learner": None if learner is None else learner.name,
        "driven": driven,
    }


class Instruments:
    """Reads the values of a trial under way; they are those that its log keeps."""

    def __init__(self, simulation: Simulation) -> None:
        self._columns = simulation.parts.columns
        multiplexer = simulation.diagram.GetSubsystemByName("log_multiplexer")
        self._multiplexer = multiplexer
        self._port = multiplexer.get_output_port()
        self._blender = simulation.parts.blender

    def read(self, running: RunningTrial) -> dict[str, float]:
        """Each column of the log to its value now.

        It costs next to nothing at a control step, where the values are needed anyway, and a prediction
        in between.
        """
        context = self._multiplexer.GetMyContextFromRoot(running.root)
        return dict(zip(self._columns, self._port.Eval(context).tolist(), strict=True))

    def read_let_go(self, running: RunningTrial) -> str | None:
        """Why the agent leaves the control to the human now; see :meth:`ConfidenceBlender.let_go`."""
        if not isinstance(self._blender, ConfidenceBlender):
            return None
        return self._blender.let_go(self._blender.GetMyContextFromRoot(running.root))


def describe_now(values: Mapping[str, float], time: float, let_go: str | None = None) -> dict[str, Any]:
    """What the page's instruments show. Commands are wheel speeds [left, right] in [rad/s]."""
    return {
        "t": round(time, 3),
        "let_go": let_go,
        "human_weight": _number(values["human_weight"]),
        "confidence": _number(values["confidence"]),
        "human": _pair(values, "human"),
        "autonomous": _pair(values, "autonomous"),
        "shared": _pair(values, "shared"),
        "clearance": _number(values["clearance"]),
        "contact": values["contact"] > 0.5,
        "stick": _numbers(values.get("stick_forward"), values.get("stick_left")),
    }


def describe_result(trial: Trial, saved: str | None, trouble: str | None) -> dict[str, Any]:
    """How a trial went, for the page.

    Args:
        trial: What happened.
        saved: Name of the file that keeps it, if one does.
        trouble: Why none does, if one should.
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
    }


def _pair(values: Mapping[str, float], who: str) -> list[float | None]:
    return _numbers(values[f"{who}_left"], values[f"{who}_right"])


def _numbers(*values: float | None) -> list[float | None]:
    return [_number(value) for value in values]


def _number(value: Any) -> float | None:
    """JSON has no NaN and no infinity; the page shows a dash for what cannot be said."""
    if value is None or not math.isfinite(value):
        return None
    return round(float(value), 4)
