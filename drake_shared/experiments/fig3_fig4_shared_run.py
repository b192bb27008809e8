"""Figs. 3 and 4 of Amirshirzad et al. 2022: a shared run, and where in it the human weight rises.

Seeds: the demonstrations of learner k have seeds from 1 000 000 + 100 k on, its trials from 1 100 000 + 100 k
on, and its training has seed k.
"""

from __future__ import annotations

import dataclasses
import itertools
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.ambiguity import (
    SEPARATE,
    TOGETHER,
    Ambiguity,
    ambiguity,
    ambiguity_ranking,
    area_under_curve,
    mean_weights,
    undecided,
)
from drake_shared.analysis.replay import write_replay
from drake_shared.analysis.statistics import Claim, interval, judge, larger
from drake_shared.experiments.common import (
    TRIAL_COST,
    Teaching,
    demonstrated,
    row_of,
    run_all,
    scenario_of,
    simulation_of,
)
from drake_shared.experiments.drawing import (
    COLOURS,
    draw_band,
    draw_demonstrations,
    draw_scene,
    legend_below,
    limit_to_workspace,
    new_figure,
)
from drake_shared.experiments.measures import select
from drake_shared.experiments.paired_trials import groups
from drake_shared.experiments.section import Experiment, Picture, PlannedTask, Rows, Section, Size, Table
from drake_shared.experiments.text import paragraphs, with_interval
from drake_shared.experiments.training import (
    PRESETS,
    ignores_observations,
    stopped_early,
    train_all,
    training_cost,
)
from drake_shared.learners import Learner
from drake_shared.simulation.config import blend_for
from drake_shared.simulation.runner import Task
from drake_shared.simulation.trial import Trial, TrialSettings

_DEMONSTRATION_SEED, _TRIAL_SEED, _STRIDE = 1_000_000, 1_100_000, 100
_GROUP = {"paper": 10, "default": 5}
_MOMENTS = (0.1, 0.3, 0.5, 0.7)
"""Times at which the intention is shown, as shares of the travel time."""
_KINDS = ("ambiguous", "clear")
_SMALLEST_WEIGHT, _SMALLEST_AREA = 0.1, 0.05


def plan(scenario: str | None, size: Size) -> list[PlannedTask]:
    """One task for each preset and a group of learners."""
    return [
        PlannedTask(
            Task.of(run_learners, scenario=scenario, preset=preset, learners=learners, trials=size.trials),
            training_cost(preset, len(learners))
            + (0.4 + TRIAL_COST * size.trials) * len(learners)
            + (3.0 if 0 in learners else 0.0),
        )
        for preset in PRESETS
        for learners in groups(size.of(preset).learners, _GROUP[preset])
    ]


def run_learners(scenario: str | None, preset: str, learners: list[int], trials: int) -> dict[str, Any]:
    """Runs trials with learners that have demonstrations of their own; one trial of the first is shown."""
    routes = [route.name for route in scenario_of(scenario).routes]
    sets = demonstrated(
        scenario, [Teaching(seed=_DEMONSTRATION_SEED + _STRIDE * index) for index in learners]
    )
    trained = train_all(sets, learners, preset=preset)
    settings = [
        TrialSettings(route=routes[turn % len(routes)], seed=_TRIAL_SEED + _STRIDE * index + turn)
        for index in learners
        for turn in range(trials)
    ]
    all_driven = run_all(scenario, [one for one in trained for _ in range(trials)], settings)
    rows, by_learner, shown = [], [], {}
    for index, learner in zip(learners, trained, strict=True):
        driven, parts, clocks = list(itertools.islice(all_driven, trials)), [], []
        for trial in driven:
            part = ambiguity(trial, learner.grid, learner.demonstrations)
            parts.append(part)
            clocks.append(dataclasses.replace(part, human_weight=-trial["t"][:-1]))
            kinds = {"ambiguous_share": part.ambiguous, "clear_share": part.clear}
            shares = {name: float(steps.mean()) for name, steps in kinds.items()}
            rows.append(row_of(trial, preset=preset, learner=index, **mean_weights([part]), **shares))
        if index == 0:
            candidates = range(min(trials, len(routes)))
            first = max(candidates, key=lambda one: count_clear_before_ambiguous(parts[one]))
            shown = _shown(scenario, learner, driven[first], parts[first])
        by_learner.append(
            {
                "preset": preset,
                "learner": index,
                **mean_weights(parts),
                "area": ambiguity_ranking(parts),
                "clock_area": ambiguity_ranking(clocks),
                **_decision_areas(scenario, driven),
                "ignores": ignores_observations(learner),
                "stopped_early": stopped_early(learner),
            }
        )
    return {"rows": rows, "by_learner": by_learner, "shown": shown}


def _decision_areas(scenario: str | None, driven: Sequence[Trial]) -> dict[str, float]:
    """How well w, and the remaining time, tell steps in which the route is still open from the others."""
    still_open = np.concatenate([undecided(trial, scenario_of(scenario)) for trial in driven])
    weight = np.concatenate([trial["human_weight"][:-1] for trial in driven])
    remaining = -np.concatenate([trial["t"][:-1] for trial in driven])
    return {
        "decision_area": area_under_curve(weight[still_open], weight[~still_open]),
        "decision_clock_area": area_under_curve(remaining[still_open], remaining[~still_open]),
    }


def count_clear_before_ambiguous(part: Ambiguity) -> int:
    """Number of clear steps before the last ambiguous one."""
    ambiguous = np.flatnonzero(part.ambiguous)
    return int(part.clear[: ambiguous[-1]].sum()) if len(ambiguous) else 0


def _shown(scenario: str | None, learner: Learner, trial: Trial, part: Ambiguity) -> dict[str, Any]:
    """A trial as JSON for the figures, with its replay."""
    assert learner.demonstrations is not None
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "replay.html"
        write_replay(trial, page, learner=learner)
        text = page.read_text(encoding="utf-8")
    columns = ("t", "x", "y", "human_weight", "confidence")
    commands = [f"{who}_{wheel}" for who in ("human", "autonomous", "shared") for wheel in ("left", "right")]
    return {
        "preset": learner.preset,
        "route": trial.metadata["route"],
        "ways": np.round(learner.demonstrations, 3),
        "columns": {name: np.round(trial[name], 4) for name in (*columns, *commands)},
        "ambiguous": part.ambiguous,
        "moments": _intentions(scenario, learner, trial),
        "page": text,
    }


def _intentions(scenario: str | None, learner: Learner, trial: Trial) -> list[dict[str, Any]]:
    """The predicted paths at some moments, from a repetition of the trial."""
    simulation = simulation_of(scenario, blend_for(learner.preset))
    settings = TrialSettings(route=trial.metadata["route"], seed=trial.metadata["seed"])
    running = simulation.begin(settings, learner=learner)
    estimator = simulation.parts.estimator
    found = []
    for share in _MOMENTS:
        running.advance(share * simulation.scenario.travel_time)
        intention = estimator.GetOutputPort("intention").Eval(estimator.GetMyContextFromRoot(running.root))
        ahead = slice(intention.first, None)
        row = int(trial["t"].searchsorted(running.time + 1e-9)) - 1
        found.append(
            {
                "time": running.time,
                "row": row,
                "mean": np.round(intention.mean[ahead], 4),
                "sigma": np.round(np.sqrt(intention.variance[ahead]), 4),
            }
        )
    return found


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Figs. 3 and 4 for both presets, and w in ambiguous and clear steps by learner."""
    rows = [row for result in results for row in result["rows"]]
    learners = [row for result in results for row in result["by_learner"]]
    shown = [
        next(one["shown"] for one in results if one["shown"] and one["shown"]["preset"] == preset)
        for preset in PRESETS
    ]
    return Section(
        title="A shared run, and where the human weight rises (Figs. 3 and 4)",
        text=paragraphs(
            "shared_run",
            size=size,
            together=TOGETHER,
            separate=SEPARATE,
            learners={preset: len(select(learners, preset=preset)) for preset in PRESETS},
            ignoring={
                preset: sum(row["ignores"] for row in select(learners, preset=preset)) for preset in PRESETS
            },
        ),
        pictures=[
            Picture.of(
                _moments_figure(scenario, shown),
                "The path driven so far (black) and the predicted path, with a band of one standard "
                "deviation, at four times; the demonstrations are dotted.",
            ),
            Picture.of(
                _time_figure(shown),
                "The same runs over time: weights, commands of each wheel and position. Ambiguous times are "
                "shaded.",
            ),
            Picture.of(
                _weight_figure(learners),
                "Mean w over the steps of each kind, one line for each learner, and the area under the ROC "
                "curve, one point for each; the dashed line is an area of 0.5.",
            ),
        ],
        tables=[_table(rows, learners)],
        claims=claims(learners),
        data={"shared_run_trials": rows, "shared_run_learners": learners},
        replays={
            f"Replay of the run with preset {one['preset']} (route {one['route']})": one["page"]
            for one in shown
        },
    )


def _column(learners: Rows, preset: str, name: str) -> NDArray[np.float64]:
    # The results of earlier versions do not have all columns.
    return np.array([row.get(name, np.nan) for row in select(learners, preset=preset)], dtype=float)


def claims(learners: Rows) -> list[Claim]:
    """w is higher in ambiguous steps, and distinguishes them better than the time does."""
    comparisons = (
        (
            "w is higher where the intended route is ambiguous than where it is clear",
            ("weight_where_ambiguous", "weight_where_clear", _SMALLEST_WEIGHT),
        ),
        (
            "w indicates ambiguity better than the remaining time does: areas under the ROC curve",
            ("area", "clock_area", _SMALLEST_AREA),
        ),
        (
            "w indicates that obstacles and routes leave the operator's route open, better than the "
            "remaining time does: areas under the ROC curve",
            ("decision_area", "decision_clock_area", _SMALLEST_AREA),
        ),
    )
    higher = [
        larger(
            f"{text} ({preset})",
            _column(learners, preset, one),
            _column(learners, preset, other),
            smallest=smallest,
            unit="",
            bounds=(-1.0, 1.0),
        )
        for text, (one, other, smallest) in comparisons
        for preset in PRESETS
    ]
    distinguishes = [
        larger(
            f"w distinguishes ambiguous from clear steps: area under the ROC curve above 0.5 ({preset})",
            areas,
            np.full_like(areas, 0.5),
            smallest=_SMALLEST_AREA,
            unit="",
            bounds=(-0.5, 0.5),
        )
        for preset in PRESETS
        for areas in [_column(learners, preset, "area")]
    ]
    return judge("shared run", higher + distinguishes)


def _table(rows: Rows, learners: Rows) -> Table:
    columns = {
        "weight_where_ambiguous": "w where ambiguous",
        "weight_where_clear": "w where clear",
        "area": "area of w",
        "clock_area": "area of the remaining time",
        "decision_area": "route open: area of w",
        "decision_clock_area": "route open: area of the remaining time",
    }
    lines = []
    for preset in PRESETS:
        own = select(rows, preset=preset)
        shares = [f"{100 * np.mean([row[f'{kind}_share'] for row in own]):.0f}%" for kind in _KINDS]
        estimates = [
            with_interval(interval(_column(learners, preset, name), bounds=(0.0, 1.0))) for name in columns
        ]
        success = f"{100 * np.mean([row['intent_success'] for row in own]):.0f}%"
        lines.append([preset, *shares, *estimates, success])
    return Table(
        caption="Means over learners with 95% intervals. Steps that are neither ambiguous nor "
        "clear are not counted; intent success is the share of all trials.",
        head=["preset", "steps ambiguous", "steps clear", *columns.values(), "intent success"],
        rows=lines,
    )


def _moments_figure(scenario: str | None, shown: Sequence[dict[str, Any]]) -> Any:
    world = scenario_of(scenario)
    figure, axes = new_figure(7.6, rows=len(_MOMENTS), columns=2, sharex=True, sharey=True)
    for column, one in enumerate(shown):
        path = np.stack([one["columns"]["x"], one["columns"]["y"]], axis=1)
        for place, moment in zip(axes[:, column], one["moments"], strict=True):
            draw_scene(place, world)
            draw_demonstrations(place, one["ways"])
            mean, sigma = np.array(moment["mean"]), np.array(moment["sigma"])
            draw_band(place, mean, sigma, COLOURS["agent"], "predicted")
            driven = path[: moment["row"] + 1]
            place.plot(*driven.T, color="black", linewidth=1.8, label="driven")
            place.plot(*driven[-1], marker="o", color="black", markersize=6)
            place.set_title(f"{one['preset']}: {moment['time']:.1f} s", fontsize=9)
            limit_to_workspace(place, world)
            place.label_outer()
    legend_below(figure, *axes[0, 0].get_legend_handles_labels(), columns=3)
    return figure


def _time_figure(shown: Sequence[dict[str, Any]]) -> Any:
    figure, axes = new_figure(7.6, rows=4, columns=2, sharex=True, sharey="row")
    for column, one in zip(axes.T, shown, strict=True):
        _draw_over_time(column, one)
    labels = ("weight", "left wheel, rad/s", "right wheel, rad/s", "position, m")
    for place, label in zip(axes[:, 0], labels, strict=True):
        place.set_ylabel(label)
        # Room for the legend.
        low, high = place.get_ylim()
        place.set_ylim(low, high + 0.25 * (high - low))
        place.legend(fontsize=7, frameon=False, loc="upper right", ncols=3)
    axes[0, 0].set_yticks([0.0, 0.5, 1.0])
    figure.align_ylabels(axes[:, 0])
    return figure


def _draw_over_time(column: Any, one: dict[str, Any]) -> None:
    columns = {name: np.array(values) for name, values in one["columns"].items()}
    t = columns["t"]
    top, left, right, bottom = column
    top.plot(t, columns["human_weight"], color=COLOURS["human"], label="w")
    top.plot(t, columns["confidence"], color=COLOURS["confidence"], linewidth=1.0, label="confidence")
    top.set_ylim(-0.03, 1.03)
    top.set_title(one["preset"], fontsize=10)
    for place, wheel in ((left, "left"), (right, "right")):
        for who, label in {"human": "human", "autonomous": "agent", "shared": "shared"}.items():
            command = columns[f"{who}_{wheel}"]
            place.plot(t, command, color=COLOURS[label], linewidth=1.1, label=label)
    bottom.plot(t, columns["x"], color="black", label="x")
    bottom.plot(t, columns["y"], color="black", linestyle="--", label="y")
    bottom.set_xlabel("t, s")
    for place in column:
        place.fill_between(
            t,
            0,
            1,
            # The last row is not applied, and is neither.
            where=np.append(one["ambiguous"], False),
            transform=place.get_xaxis_transform(),
            color="0.9",
            linewidth=0,
            zorder=0,
            label="ambiguous" if place is top else None,
        )


def _weight_figure(learners: Rows) -> Any:
    figure, axes = new_figure(2.6, columns=3)
    for at, (place, preset) in enumerate(zip(axes[:2], PRESETS, strict=True)):
        pairs = np.stack([_column(learners, preset, f"weight_where_{kind}") for kind in _KINDS], axis=1)
        for pair in pairs:
            place.plot([0, 1], pair, color=COLOURS[preset], linewidth=0.7, marker="o", markersize=3)
        place.set(xticks=[0, 1], xticklabels=_KINDS, xlim=(-0.3, 1.3), ylim=(0, 1.02))
        place.set(ylabel="mean w", title=preset)
        areas = _column(learners, preset, "area")
        # Side by side, so that each point is visible.
        x = at + np.linspace(-0.15, 0.15, len(areas))
        axes[2].plot(x, areas, "o", color=COLOURS[preset], markersize=3)
    axes[2].axhline(0.5, color="0.5", linestyle="--", linewidth=1)
    axes[2].set(xticks=[0, 1], xticklabels=PRESETS, xlim=(-0.5, 1.5), ylim=(0, 1.02))
    axes[2].set(ylabel="area under the ROC curve", title="w as an indicator of ambiguity")
    for place in axes:
        place.title.set_fontsize(9)
    return figure


EXPERIMENT = Experiment(name="shared_run", plan=plan, report=report)
