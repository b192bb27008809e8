"""Calibration of an agent's confidence: how often it expects the operator's route, by its confidence.

c_f = min(1, 1 / (K var)) is a measure of certainty and no probability. The calibration error reads it as one;
the ranking does not.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from drake_shared.analysis.ambiguity import area_under_curve
from drake_shared.arbitration.path_repair import make_path_repair
from drake_shared.learners import Learner
from drake_shared.robots import Arm, scaled_length
from drake_shared.scenario import Scenario, scenario_from_dict
from drake_shared.scenario.paths import passing_side
from drake_shared.simulation.config import config_of_log
from drake_shared.simulation.trial import Trial
from drake_shared.systems.intention import Intention
from drake_shared.systems.intention_estimator import IntentionEstimator

# A predicted path is on the operator's route if its root mean squared distance to it is less, in [m].
_SAME_ROUTE = 0.15


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ConfidenceSteps:
    """Confidence of the agent at n steps of trials, and whether its prediction was correct.

    Attributes:
        confidence: c_f: shape (n,).
        correct: Whether the predicted path was on the operator's route: shape (n,).
    """

    confidence: NDArray[np.float64]
    correct: NDArray[np.bool_]


def demonstrations_of_routes(scenario: Scenario, learner: Learner) -> dict[str, int]:
    """For each demonstrated route, the index of the first demonstration that passes obstacles alike.

    For an arm, of the first one that ends nearest to the goal of the route.
    """
    found: dict[str, int] = {}
    for index, path in enumerate(() if learner.demonstrations is None else learner.demonstrations):
        if isinstance(scenario.robot, Arm):
            goal = scenario.goal_at(path[-1])
            for route in scenario.routes:
                if scenario.goal_of(route) is goal:
                    found.setdefault(route.name, index)
            continue
        sides = {item.name: passing_side(path, (item.x, item.y)) for item in scenario.static_obstacles}
        for route in scenario.routes:
            if route.sides == sides:
                found.setdefault(route.name, index)
    return found


def intended_path(scenario: Scenario, learner: Learner, route: str) -> NDArray[np.float64]:
    """The path (n, D), in [m], that an operator on a route follows, to judge predictions by.

    It is the demonstration of the route, or, if the learner was shown none, the curve of the route itself.
    """
    taught = demonstrations_of_routes(scenario, learner)
    if route in taught and learner.demonstrations is not None:
        demonstration: NDArray[np.float64] = learner.demonstrations[taught[route]]
        return demonstration
    return scenario.points_of(scenario.route(route), 501)


def assess_confidence(
    learner: Learner, trial: Trial, intended: NDArray[np.float64], *, every: int = 1
) -> ConfidenceSteps:
    """Compares the path that the agent predicted at each step of ``trial`` with the one that was meant.

    The prediction is the one in use, to which the logged confidence belongs; see `predictions`. It is correct
    if its root mean squared distance to the intended path, at any time, is less than 0.15 m for the Pioneer
    P3-DX; that scales with the robot.

    Args:
        learner: The learner that took part.
        trial: The log.
        intended: Path that the operator meant, shape (n, D), in [m]; see `intended_path`.
        every: Distance between the assessed steps.
    """
    path = cKDTree(intended)
    same = scaled_length(scenario_from_dict(trial.metadata["scenario"]).robot, _SAME_ROUTE)
    correct = []
    for intention, _ in itertools.islice(predictions(learner, trial), 0, None, every):
        predicted = intention.mean[intention.first :]
        # Without a pose nothing is predicted.
        known = bool(np.isfinite(predicted).all())
        correct.append(known and math.sqrt(np.mean(path.query(predicted)[0] ** 2)) < same)
    return ConfidenceSteps(confidence=trial["confidence"][:-1][::every], correct=np.array(correct))


def predictions(learner: Learner, trial: Trial) -> Iterator[tuple[Intention, float]]:
    """Intention and c_f at each applied step of ``trial``, as an `IntentionEstimator` gives them.

    It receives the logged poses and commands of the human, as the faults of the trial let them arrive.
    """
    scenario, config = scenario_from_dict(trial.metadata["scenario"]), config_of_log(trial.metadata)
    robot = scenario.robot
    repairs = config.path_repair
    estimator = IntentionEstimator(
        learner=learner,
        robot=robot,
        period=float(trial["t"][1] - trial["t"][0]),
        repair=make_path_repair(scenario, robot, look_ahead=config.look_ahead) if repairs else None,
    )
    context = estimator.CreateDefaultContext()
    estimator.SetLearner(
        context,
        learner,
        confidence_gain=trial.metadata.get("confidence_gain"),
        use_human_command=trial.metadata.get("mode") != "agent",
    )
    poses = _logged(trial, robot.configuration_names, "seen_", "")
    commands = _logged(trial, robot.command_names, "received_", "human_")
    for time, pose, command in zip(trial["t"][:-1], poses, commands, strict=False):
        context.SetTime(time)
        estimator.get_pose_input_port().FixValue(context, pose)
        estimator.get_human_command_input_port().FixValue(context, command)
        yield (
            estimator.get_intention_output_port().Eval(context),
            estimator.get_confidence_output_port().Eval(context)[0],
        )
        estimator.CalcForcedDiscreteVariableUpdate(context, context.get_mutable_discrete_state())


def _logged(trial: Trial, names: Sequence[str], seen: str, usual: str) -> NDArray[np.float64]:
    """Columns as the estimator saw them, which differ from the others where faults were injected."""
    columns = [seen + name if seen + name in trial.columns else usual + name for name in names]
    return np.stack([trial[column] for column in columns], axis=1)


def confidence_calibration(parts: Sequence[ConfidenceSteps], *, bins: int = 10) -> dict[str, Any]:
    """Expected calibration error of c_f over all steps, and the share of confident wrong predictions.

    Returns:
        expected_calibration_error: Mean over steps of |c_f - share correct|, in ``bins`` bins of c_f of equal
            width; it depends on them.
        brier_score: Mean over steps of (c_f - correct)^2, which needs no bins.
        confidence_ranking: Area under the ROC curve: how well c_f ranks correct above wrong predictions,
            whatever its scale; NaN if there are none of one kind.
        confident_and_wrong: Share of steps with c_f > 0.8 and a wrong prediction.
        bins: For each bin with steps: mean c_f, share correct ("right"), and number of steps.
    """
    confidence = np.concatenate([part.confidence for part in parts])
    correct = np.concatenate([part.correct for part in parts])
    index = np.minimum((confidence * bins).astype(int), bins - 1)
    table = [
        {
            "confidence": float(confidence[index == bin].mean()),
            "right": float(correct[index == bin].mean()),
            "steps": int((index == bin).sum()),
        }
        for bin in np.unique(index).tolist()
    ]
    error = sum(row["steps"] * abs(row["confidence"] - row["right"]) for row in table) / len(confidence)
    return {
        "expected_calibration_error": error,
        "brier_score": float(np.mean((confidence - correct) ** 2)),
        "confidence_ranking": area_under_curve(confidence[correct], confidence[~correct]),
        "confident_and_wrong": float(((confidence > 0.8) & ~correct).mean()),
        "bins": table,
    }
