"""``drake-shared train``: a learner from demonstrations and logs, by Alg. 1 of the paper."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from drake_shared.analysis.weight_figure import draw_weights
from drake_shared.cli.command import Command, OptionalFloat, OptionalInt, OptionalPath, OptionalText
from drake_shared.cli.common import print_json
from drake_shared.common.console import say
from drake_shared.common.errors import InputError
from drake_shared.common.files import check_target
from drake_shared.demonstrations import (
    Demonstrations,
    align,
    check_units,
    load_scorer,
    read_demonstrations,
    score_demonstrations,
)
from drake_shared.demonstrations.weights import DEFAULT_WIDTH
from drake_shared.learners.calibration import Calibration


@dataclasses.dataclass(kw_only=True)
class Train(Command):
    """Trains a learner on demonstrations and logs (logs that reached the goal without contact)."""

    demos: tuple[Path, ...]
    """Parquet files of demonstrations or logs, or folders of such files. Failed trials are left out."""
    out: Path
    """Safetensors file to write."""
    scenario: OptionalText = None
    """Scenario file, or the name of a shipped one; scores by clearance need its obstacles."""
    learner: str = "cnmp"
    """"cnmp", "mixture" (one expert per route), "cesn" (an echo state network, trained in seconds), "promp"
    (extra baselines), or a registered one."""
    preset: Literal["default", "paper"] = "default"
    """What works best, or the method of the paper."""
    score: OptionalText = None
    """How demonstrations are scored: "clearance", a column of the files, or "module:function" of the
    positions (n, D). Default: the scores in the files; where there are none, all have the same weight."""
    unweighted: bool = False
    """Sample all demonstrations with the same probability, whatever their scores."""
    seed: int = 0
    """Seed of the initial weights and of all sampling."""
    members: int = 1
    """More than one trains an ensemble of a "cnmp", whose disagreement adds to the variance."""
    seconds: OptionalFloat = None
    """Time limit of the training, in s, for which the iterations are planned; default: none."""
    iterations: OptionalInt = None
    """Limit on the iterations; default: the preset's. "paper" stops when its loss is below a threshold."""
    score_width: OptionalFloat = None
    """Width of the sampling density over the scores, in standard deviations of the scores; default: 2."""
    calibration: Calibration = "percentile"
    """How K is found: from the 95th percentile of the variance along the demonstrations, or the largest, as
    in the paper."""
    device: Literal["cpu", "cuda", "auto"] = "cpu"
    """Where networks are trained: "cuda" is a GPU (untested), "auto" a GPU if there is one. Another device
    gives other bits."""
    show_weights: OptionalPath = None
    """Write a figure of scores and sampling weights here (PNG), as in the paper's Fig. 5."""
    json: bool = False
    """Print the training record as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        from tqdm import tqdm

        demonstrations = self._read()
        check_target(self.out)
        from drake_shared.learners import find_learner, save_learner, train
        from drake_shared.learners.dataset import make_dataset
        from drake_shared.learners.loss_threshold import early_stop
        from drake_shared.learners.route_clustering import unlike_all_others

        find_learner(self.learner, source="--learner")
        if self.show_weights is not None:
            check_target(self.show_weights)
            draw_weights(
                demonstrations,
                self.show_weights,
                width=self.score_width if self.score_width is not None else DEFAULT_WIDTH,
            )
            say(f"wrote {self.show_weights}")

        with tqdm(unit="it", desc="training", disable=None) as bar:

            def progress(done: int, planned: int, loss: float) -> None:
                bar.total = planned
                bar.set_postfix_str(f"loss {loss:.3f}", refresh=False)
                bar.update(done - bar.n)

            learner = train(
                demonstrations,
                learner=self.learner,
                members=self.members,
                preset=self.preset,
                weighted=not self.unweighted,
                seed=self.seed,
                seconds=self.seconds,
                iterations=self.iterations,
                progress=progress,
                **self._changes(),
            )
        dataset = make_dataset(align(demonstrations))
        for index in unlike_all_others(dataset.positions):
            item = demonstrations[index]
            say(f"warning: {item.source} is like no other: if it is a mistake, train without it")
        save_learner(learner, self.out)
        record = learner.metadata.get("training", {})
        took = "" if "seconds" not in record else f" in {record['seconds']:.1f} s"
        say(
            f"wrote {self.out}: {learner.name}, {len(demonstrations)} demonstrations{took}, "
            f"K = {learner.confidence_gain:.4g} per m^2"
        )
        for change in _time_changes(record.get("sources", [])):
            say(change)
        if (warning := early_stop(learner.metadata)) is not None:
            say(f"warning: {warning}")
        if self.json:
            print_json(
                {
                    "model": str(self.out),
                    "learner": learner.name,
                    "preset": learner.preset,
                    "confidence_gain": learner.confidence_gain,
                    "training": record,
                }
            )

    def _changes(self) -> dict[str, Any]:
        """Options that not every learner accepts, where they differ from their defaults."""
        changes: dict[str, Any] = {}
        if self.score_width is not None:
            changes["score_width"] = self.score_width
        if self.calibration != "percentile":
            changes["calibration"] = self.calibration
        if self.device != "cpu":
            changes["device"] = self.device
        return changes

    def _read(self) -> Demonstrations:
        from drake_shared.scenario import clearance_scorer, load_scenario

        column = None
        if self.score is not None and self.score != "clearance" and ":" not in self.score:
            column = self.score
        scenario = None if self.scenario is None else load_scenario(self.scenario)
        failed: list[InputError] = []
        demonstrations = read_demonstrations(
            self.demos,
            scenario=None if scenario is None else scenario.name,
            score_column=column,
            failed=failed,
        )
        if failed:
            say(f"left out {len(failed)} failed trials, the first because of {failed[0]}")
        if scenario is None and demonstrations.scenario is not None:
            # Not every scenario that files name is at hand, nor needed.
            with contextlib.suppress(InputError):
                scenario = load_scenario(demonstrations.scenario)
        if scenario is not None:
            space = scenario.workspace
            extent = max(space.x_max - space.x_min, space.y_max - space.y_min)
            check_units(demonstrations, duration=scenario.duration, extent=extent)
        if self.score == "clearance" or (self.score is None and self._lacks_scores(demonstrations)):
            scenario = scenario or load_scenario(demonstrations.scenario)
            return score_demonstrations(demonstrations, clearance_scorer(scenario))
        if self.score is not None and ":" in self.score:
            return score_demonstrations(demonstrations, load_scorer(self.score))
        return demonstrations

    @staticmethod
    def _lacks_scores(demonstrations: Demonstrations) -> bool:
        """Whether some demonstrations, such as logs, have no score, so that all are scored by clearance."""
        return demonstrations.scores is None and demonstrations.scenario is not None


def _time_changes(sources: Sequence[Mapping[str, Any]]) -> list[str]:
    """What the alignment of demonstrations changed, from their training record."""
    changes = []
    for index, source in enumerate(sources):
        if "pauses" in source:
            changes.append(f"demonstration {index}: counted out pauses of {source['pauses']:.1f} s")
        factor = source.get("time_factor", 1.0)
        if abs(factor - 1.0) > 0.05:
            changes.append(f"demonstration {index}: brought to the others' pace, its time times {factor:.2f}")
    return changes
