"""``drake-shared evaluate``: how accurate a learner's predictions are, and how well calibrated."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from drake_shared.cli.command import OptionalPath
from drake_shared.cli.common import open_learner, print_json
from drake_shared.cli.options import LearnerOptions
from drake_shared.cli.table import figure_lines
from drake_shared.common.console import say
from drake_shared.common.errors import InputError
from drake_shared.common.files import check_target
from drake_shared.learners import Learner
from drake_shared.learners.calibration import Calibration
from drake_shared.robots import Robot
from drake_shared.scenario import Scenario
from drake_shared.simulation.config import SharedControlConfig, blend_for

if TYPE_CHECKING:
    from drake_shared.analysis.confidence_calibration import ConfidenceSteps
    from drake_shared.simulation.trial import Trial


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
    recalibrate: OptionalPath = None
    """Write the learner here with its standard deviations scaled to fit the demonstrations."""
    calibration: Calibration = "percentile"
    """How K of that file is found: from the 95th percentile of the variance, or the largest (the paper)."""
    calibrate: OptionalPath = None
    """Write the learner here with a confidence that is a probability, calibrated on these trials."""
    figure: OptionalPath = None
    """Write a reliability diagram here (PNG)."""
    json: bool = False
    """Print everything as one JSON object."""

    @classmethod
    def config_for(cls, preset: str, robot: Robot | None, **changes: Any) -> SharedControlConfig:
        """The blend: its weight follows the confidence, which is judged."""
        return blend_for(preset, **changes)

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.analysis.evaluation import draw_reliability, evaluate, prediction_errors
        from drake_shared.demonstrations import Demonstration, align, motion_time, read_demonstrations
        from drake_shared.learners.loss_threshold import loss_threshold
        from drake_shared.scenario import load_scenario
        from drake_shared.simulation.teaching import teach

        scenario = load_scenario(self.scenario_source())
        learner, path = open_learner(scenario, self.model, self.preset)
        if self.trials < 0:
            raise InputError("evaluate", "trials", "must not be negative", self.trials)
        if self.calibrate is not None and not self.trials:
            raise InputError("--calibrate", "", "requires --trials")
        for file in (self.figure, self.recalibrate, self.calibrate):
            if file is not None:
                check_target(file)
        if self.demos:
            demonstrations = read_demonstrations(self.demos, scenario=scenario.name)
            if learner.metadata.get("clock") == "progress" and learner.demonstrations is not None:
                # Such a learner takes time for progress, as it does where it is used.
                taught = [
                    Demonstration(times=learner.grid, positions=path) for path in learner.demonstrations
                ]
                pace = float(np.median([motion_time(item) for item in taught]))
                demonstrations = align(demonstrations, pace=pace)
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
        """Judges the confidence on demonstrated routes, and apart from them on the others."""
        from drake_shared.analysis.ambiguity import (
            ambiguity,
            ambiguity_ranking,
            area_under_curve,
            mean_weights,
            undecided,
        )
        from drake_shared.analysis.confidence_calibration import (
            assess_confidence,
            confidence_calibration,
            demonstrations_of_routes,
            intended_path,
        )
        from drake_shared.analysis.online_coverage import online_coverage
        from drake_shared.simulation.trial import Simulation, TrialSettings

        simulation = Simulation(scenario, learner=learner, config=self.control)
        taught = demonstrations_of_routes(scenario, learner)
        parts: dict[bool, list[Any]] = {True: [], False: []}
        driven: dict[bool, list[Trial]] = {True: [], False: []}
        ambiguities, clocks, weights, times, open_steps = [], [], [], [], []
        for index in range(self.trials):
            route = scenario.routes[index % len(scenario.routes)].name
            trial = simulation.run(TrialSettings(route=route, seed=self.seed + index))
            intended = intended_path(scenario, learner, route)
            parts[route in taught].append(assess_confidence(learner, trial, intended))
            driven[route in taught].append(trial)
            weights.append(trial["human_weight"][:-1])
            times.append(trial["t"][:-1])
            open_steps.append(undecided(trial, scenario))
            if route in taught and learner.demonstrations is not None and len(learner.demonstrations) > 1:
                found = ambiguity(trial, learner.grid, learner.demonstrations, robot=scenario.robot)
                ambiguities.append(found)
                clocks.append(dataclasses.replace(found, human_weight=-trial["t"][:-1]))
        judged: dict[str, Any] = confidence_calibration(parts[True]) if parts[True] else {}
        if ambiguities:
            judged |= mean_weights(ambiguities)
            judged["ambiguity_ranking"] = ambiguity_ranking(ambiguities)
            judged["ambiguity_ranking_of_time"] = ambiguity_ranking(clocks)
        still_open = np.concatenate(open_steps)
        for name, values in (("decision_ranking", weights), ("decision_ranking_of_time", times)):
            scores = np.concatenate(values) * (-1.0 if values is times else 1.0)
            judged[name] = area_under_curve(scores[still_open], scores[~still_open])
        judged["taught_routes"] = sorted(taught)
        judged["untaught"] = confidence_calibration(parts[False]) if parts[False] else None
        for figures, trials in ((judged, driven[True]), (judged["untaught"], driven[False])):
            if trials:
                figures["online_coverage"], figures["learner_coverage"] = online_coverage(learner, trials)
        if self.calibrate is not None:
            self._write_calibrated(scenario, learner, driven[True], parts[True])
        return judged

    def _write_calibrated(
        self, scenario: Scenario, learner: Learner, trials: Sequence[Trial], steps: Sequence[ConfidenceSteps]
    ) -> None:
        """Writes the learner with a confidence that is calibrated on trials on demonstrated routes."""
        from drake_shared.analysis.confidence_fit import calibrated_confidence, open_ways_of
        from drake_shared.learners import save_learner
        from drake_shared.learners.calibrated_confidence import CALIBRATION_KEY
        from drake_shared.learners.stored import StoredLearner

        if not isinstance(learner, StoredLearner):
            raise InputError("--calibrate", "learner", "must be a StoredLearner", learner.name)
        assert self.calibrate is not None
        ratios = [trial["mean_variance"][:-1] * float(trial.metadata["confidence_gain"]) for trial in trials]
        calibration = calibrated_confidence(
            np.concatenate([*ratios, np.empty(0)]),
            np.concatenate([*(part.correct for part in steps), np.empty(0, bool)]),
            open_ways_of(scenario, learner),
        )
        metadata = {**learner.metadata, CALIBRATION_KEY: calibration.to_json()}
        save_learner(dataclasses.replace(learner, metadata=metadata), self.calibrate)
        say(f"wrote {self.calibrate}")


def _print(result: dict[str, Any]) -> None:
    if (end := result["loss_threshold"]) is not None:
        reached = "reached" if end["reached"] else "not reached, training stopped early"
        print(f"loss in training {end['loss']:.2f}, threshold {end['threshold']:g}: {reached}")
    print("predictions of the rest of a demonstration from one point:")
    _print_figures(result)
    for part in result["by_time_to_end"]:
        measures = ", ".join(f"{name} {part[name]:.3g}" for name in ("nll", "ade", "crps", "coverage90"))
        print(f"  {part['from']:.1f} to {part['to']:.1f} s to the end: {measures}")
    if "confidence" in result:
        judged = result["confidence"]
        taught = ", ".join(judged["taught_routes"]) or "none"
        print(f"confidence in shared trials of a simulated operator, on routes that were taught ({taught}):")
        _print_figures(judged)
        if judged["untaught"] is not None:
            print("on routes that were not taught:")
            _print_figures(judged["untaught"])


def _print_figures(figures: dict[str, Any]) -> None:
    known = [(name, value) for name, value in figures.items() if isinstance(value, float)]
    print("\n".join(figure_lines((name, f"{value:.4g}") for name, value in known)))
