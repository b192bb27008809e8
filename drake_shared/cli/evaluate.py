"""``drake-shared evaluate``: how accurate a learner's predictions are, and how well calibrated."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from drake_shared.cli.common import open_learner, print_json
from drake_shared.cli.options import LearnerOptions
from drake_shared.common.console import say
from drake_shared.common.errors import InputError
from drake_shared.common.files import check_target
from drake_shared.learners import Learner
from drake_shared.learners.calibration import Calibration
from drake_shared.scenario import Scenario


@dataclasses.dataclass(kw_only=True)
class Evaluate(LearnerOptions):
    """Evaluates a learner on demonstrations, and its confidence in trials of a simulated operator."""

    demos: tuple[Path, ...] = ()
    """Demonstrations to evaluate it on; default: three fresh simulated drives of each route."""
    noise: float = 0.0
    """Standard deviation of the noise on the points shown, in m."""
    trials: int = 30
    """Trials in which the confidence is evaluated; 0 omits it."""
    seed: int = 0
    """Seed of the noise, the fresh drives and the trials."""
    recalibrate: Path | None = None
    """Write the learner here with its standard deviations scaled to fit the demonstrations."""
    calibration: Calibration = "percentile"
    """How K of that file is found: from the 95th percentile of the variance, or the largest (the paper)."""
    figure: Path | None = None
    """Write a reliability diagram here (PNG)."""
    json: bool = False
    """Print everything as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.analysis.evaluation import draw_reliability, evaluate, prediction_errors
        from drake_shared.demonstrations import read_demonstrations
        from drake_shared.learners.loss_threshold import loss_threshold
        from drake_shared.scenario import load_scenario
        from drake_shared.simulation.teaching import teach

        scenario = load_scenario(self.scenario)
        learner, path = open_learner(scenario, self.model, self.preset)
        if self.trials < 0:
            raise InputError("evaluate", "trials", "must not be negative", self.trials)
        for file in (self.figure, self.recalibrate):
            if file is not None:
                check_target(file)
        if self.demos:
            demonstrations = read_demonstrations(self.demos, scenario=scenario.name)
        else:
            # Seeds far from those of the demonstrations that ship.
            demonstrations = teach(scenario, count=3 * len(scenario.routes), seed=self.seed + 10_000)
        found = prediction_errors(learner, demonstrations, noise=self.noise, seed=self.seed)
        result: dict[str, Any] = {"model": str(path), **evaluate(found)}
        result["loss_threshold"] = loss_threshold(learner.metadata)
        if self.trials:
            result["confidence"] = self._assess(scenario, learner)
        if self.figure is not None:
            draw_reliability(result, self.figure)
            say(f"wrote {self.figure}")
        if self.recalibrate is not None:
            from drake_shared.learners import ScalableLearner, calibrate, save_learner

            if not isinstance(learner, ScalableLearner):
                raise InputError(path, "learner", "must have a method 'scaled'", learner.name)
            gain = calibrate(learner.scaled(result["scale"]), demonstrations, calibration=self.calibration)
            scaled = learner.scaled(result["scale"], confidence_gain=gain)
            save_learner(scaled, self.recalibrate)
            say(f"wrote {self.recalibrate}: standard deviations times {result['scale']:.3f}")
        if self.json:
            print_json(result)
        else:
            _print(result)

    def _assess(self, scenario: Scenario, learner: Learner) -> dict[str, Any]:
        from drake_shared.analysis.ambiguity import ambiguity, ambiguity_ranking, mean_weights
        from drake_shared.analysis.confidence_calibration import (
            assess_confidence,
            confidence_calibration,
            demonstrations_of_routes,
        )
        from drake_shared.simulation.trial import Simulation, TrialSettings

        simulation = Simulation(scenario, learner=learner, config=self.control)
        shown = demonstrations_of_routes(scenario, learner)
        parts, ambiguities = [], []
        for index in range(self.trials):
            route = scenario.routes[index % len(scenario.routes)]
            if route.name not in shown:
                continue
            trial = simulation.run(TrialSettings(route=route.name, seed=self.seed + index))
            parts.append(assess_confidence(learner, trial, shown[route.name]))
            if learner.demonstrations is not None and len(learner.demonstrations) > 1:
                ambiguities.append(ambiguity(trial, learner.grid, learner.demonstrations))
        if not parts:
            raise InputError("evaluate", "trials", "need a route of the scenario that was demonstrated")
        judged = confidence_calibration(parts)
        if ambiguities:
            judged |= {**mean_weights(ambiguities), "ambiguity_ranking": ambiguity_ranking(ambiguities)}
        return judged


def _print(result: dict[str, Any]) -> None:
    if (end := result["loss_threshold"]) is not None:
        reached = "reached" if end["reached"] else "not reached, training stopped early"
        print(f"  loss in training {end['loss']:.2f}, threshold {end['threshold']:g}: {reached}")
    names = ("nll", "ade", "fde", "crps", "coverage50", "coverage90", "coverage95", "scale")
    for name in names:
        print(f"  {name:28s} {result[name]:9.4g}")
    for part in result["by_time_to_end"]:
        measures = ", ".join(f"{name} {part[name]:.3g}" for name in ("nll", "ade", "crps", "coverage90"))
        print(f"  {part['from']:.1f} to {part['to']:.1f} s to the end: {measures}")
    if "confidence" in result:
        judged = result["confidence"]
        print("  over shared trials of a simulated operator:")
        for name, value in judged.items():
            if name != "bins":
                print(f"  {name:28s} {value:9.4g}")
