"""Figs. 3 and 4 of Amirshirzad et al. 2022: a shared run, and where in it the human's share rises."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from drake_shared.analysis.ambiguity import (
    SEPARATE,
    TOGETHER,
    Ambiguity,
    ambiguity,
    ambiguity_ranking,
    mean_weights,
)
from drake_shared.analysis.replay import write_replay
from drake_shared.analysis.statistics import Claim, claim, interval, paired_claims
from drake_shared.experiments.common import (
    TRIAL_COST,
    as_demonstrations,
    drives,
    measured,
    run,
    scenario_of,
    simulation_of,
    train_all,
    training_cost,
)
from drake_shared.experiments.drawing import COLOURS, draw_band, draw_scene, legend_below, new_figure
from drake_shared.experiments.paired_trials import groups
from drake_shared.experiments.report import with_interval
from drake_shared.experiments.section import Experiment, Picture, Section, Size, Table
from drake_shared.learners import Learner
from drake_shared.simulation.config import config_for
from drake_shared.simulation.runner import Task
from drake_shared.simulation.trial import Trial, TrialSettings

_DRIVES, _TRIALS, _LEARNER_STEP = 1_000_000, 1_100_000, 100
"""Seeds: learner k is taught by drives from _DRIVES + 100 k on, helps in trials from _TRIALS + 100 k on, and
is itself trained from seed k."""
_PRESETS = ("paper", "default")
_TOGETHER = {"paper": 10, "default": 5}
_MOMENTS = (0.1, 0.3, 0.5, 0.7)
"""At which the intention is shown, as shares of the travel time."""
_SMALLEST_WEIGHT, _SMALLEST_AREA = 0.1, 0.05


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """Some learners of one preset each."""
    return [
        Task(
            "drake_shared.experiments.fig3_fig4_shared_run:run_learners",
            {
                "scenario": scenario,
                "preset": preset,
                "learners": learners,
                "trials": size.trials,
            },
        )
        for preset in _PRESETS
        for learners in groups(size.learners, _TOGETHER[preset])
    ]


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    told = task.arguments
    each = 0.4 + TRIAL_COST * told["trials"]
    training = training_cost(told["preset"], len(told["learners"]))
    return training + each * len(told["learners"]) + (3.0 if 0 in told["learners"] else 0.0)


def run_learners(scenario: str | None, preset: str, learners: list[int], trials: int) -> dict[str, Any]:
    """Trials with learners that are each taught by drives of their own; of the first learner one is shown."""
    world = scenario_of(scenario)
    taught = [
        as_demonstrations(
            scenario, drives(scenario, count=len(world.routes), seed=_DRIVES + _LEARNER_STEP * index)
        )
        for index in learners
    ]
    trained = train_all(taught, learners, preset=preset)
    rows, by_learner, shown = [], [], {}
    for index, learner in zip(learners, trained, strict=True):
        driven, parts, clocks = [], [], []
        for turn in range(trials):
            route = world.routes[turn % len(world.routes)].name
            seed = _TRIALS + _LEARNER_STEP * index + turn
            trial = run(scenario, learner, route=route, seed=seed)
            part = ambiguity(trial, learner.grid, learner.demonstrations)
            driven.append(trial)
            parts.append(part)
            clocks.append(dataclasses.replace(part, human_weight=-trial["t"][:-1]))
            told = {"preset": preset, "learner": index, **mean_weights([part]), **_shares(part)}
            rows.append(measured(trial, **told))
        if index == 0:
            first = max(range(min(trials, len(world.routes))), key=lambda one: _clear_before(parts[one]))
            shown = _shown(scenario, learner, driven[first], parts[first])
        by_learner.append(
            {
                "preset": preset,
                "learner": index,
                **mean_weights(parts),
                "area": ambiguity_ranking(parts),
                "clock_area": ambiguity_ranking(clocks),
                "ignores": bool(learner.metadata["training"]["ignores_observations"]),
            }
        )
    return {"rows": rows, "by_learner": by_learner, "shown": shown}


def _shares(part: Ambiguity) -> dict[str, float]:
    return {"ambiguous_share": float(part.ambiguous.mean()), "clear_share": float(part.clear.mean())}


def _clear_before(part: Ambiguity) -> int:
    """How many clear steps come before an ambiguous one."""
    ambiguous = np.flatnonzero(part.ambiguous)
    return int(part.clear[: ambiguous[-1]].sum()) if len(ambiguous) else 0


def _shown(scenario: str | None, learner: Learner, trial: Trial, part: Ambiguity) -> dict[str, Any]:
    """A trial as figures and a page show it."""
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
    """The same trial again, stopped to ask where the robot is expected."""
    simulation = simulation_of(scenario, config_for(learner.preset))
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
    """Figs. 3 and 4 for both presets, and w where it is ambiguous and where it is clear, by learner."""
    rows = [row for result in results for row in result["rows"]]
    learners = [row for result in results for row in result["by_learner"]]
    shown = [next(r["shown"] for r in results if r["shown"] and r["shown"]["preset"] == p) for p in _PRESETS]
    ignoring = [
        f"{sum(row['ignores'] for row in learners if row['preset'] == preset)} of {size.learners} with "
        f"preset {preset}"
        for preset in _PRESETS
    ]
    return Section(
        title="A shared run, and where the human's share rises (Figs. 3 and 4)",
        text=[
            "The primary simulated operator shares the control with learners that it taught, each by one "
            f"drive of each route alone. Of each preset {size.learners} learners, each from drives and a "
            f"seed of its own, took part in {size.trials} trials each; routes take turns. Figures show that "
            "trial of the first learner, one of each route, in which most clear steps come before ambiguous "
            "ones: there w has most reason to rise again.",
            "The paper says that w rises where demonstrated ways run together, as at the start and between "
            "the obstacles. Here a step is ambiguous if another demonstration at equal progress is within "
            f"{TOGETHER} m of the robot and later parts from the path driven by over {SEPARATE} m; it is "
            f"clear if every other demonstration is over {SEPARATE} m away. The area under the ROC curve "
            "of w as a sign of ambiguity is 1 if every ambiguous step has a higher w than every clear one, "
            "and 0.5 if w knows nothing. But a run is the less ambiguous the longer it lasts, so a mere "
            "clock tells something, too: the table gives the area of the time left in place of w.",
            f"Learners that expect the same whatever they are shown: {' and '.join(ignoring)}. The w of such "
            "a learner depends on the time alone. With preset default the human keeps a floor of w and gets "
            "the control back in a conflict, which preset paper does not know; both are in the w measured "
            "here. Intervals are 95% bootstrap intervals over learners; those of claims are adjusted.",
        ],
        pictures=[
            Picture.of(
                _moments_figure(scenario, shown),
                "The way driven so far (black) and the way expected from there on, with a band of one "
                "standard deviation, at four moments; the demonstrations are dotted.",
            ),
            Picture.of(
                _time_figure(shown),
                "The same runs over time: weights, commands to either wheel and position. Ambiguous times "
                "are shaded.",
            ),
            Picture.of(
                _weight_figure(learners),
                "Mean w over the steps of each kind, a line for each learner, and the area under the ROC "
                "curve, a point for each; dashes mark an area of 0.5.",
            ),
        ],
        tables=[_table(rows, learners)],
        claims=_claims(learners),
        data={"shared_run_trials": rows, "shared_run_learners": learners},
        replays={
            f"Replay of the run with preset {one['preset']} (route {one['route']})": one["page"]
            for one in shown
        },
    )


def _of(learners: list[dict[str, Any]], preset: str, name: str) -> np.ndarray:
    return np.array([row[name] for row in learners if row["preset"] == preset], dtype=float)


def _claims(learners: list[dict[str, Any]]) -> list[Claim]:
    higher = paired_claims(
        [
            {
                "text": f"w is higher where it is ambiguous which way is meant than where it is clear "
                f"({preset})",
                "one": _of(learners, preset, "weight_where_ambiguous"),
                "other": _of(learners, preset, "weight_where_clear"),
                "smallest": _SMALLEST_WEIGHT,
                "unit": "",
            }
            for preset in _PRESETS
        ]
        + [
            {
                "text": f"w tells more of ambiguity than the time left does: areas under the ROC curve "
                f"({preset})",
                "one": _of(learners, preset, "area"),
                "other": _of(learners, preset, "clock_area"),
                "smallest": _SMALLEST_AREA,
                "unit": "",
            }
            for preset in _PRESETS
        ]
    )
    ranks = [
        claim(
            f"w tells ambiguous from clear steps: area under the ROC curve above 0.5 ({preset})",
            _of(learners, preset, "area") - 0.5,
            smallest=_SMALLEST_AREA,
            unit="",
        )
        for preset in _PRESETS
    ]
    return higher + ranks


def _table(rows: list[dict[str, Any]], learners: list[dict[str, Any]]) -> Table:
    lines = []
    for preset in _PRESETS:
        told = [_of(learners, preset, f"weight_where_{kind}") for kind in ("ambiguous", "clear")]
        shares = [
            f"{100 * np.mean([row[f'{kind}_share'] for row in rows if row['preset'] == preset]):.0f}%"
            for kind in ("ambiguous", "clear")
        ]
        success = np.mean([row["intent_success"] for row in rows if row["preset"] == preset])
        told += [_of(learners, preset, name) for name in ("area", "clock_area")]
        estimates = [with_interval(interval(values)) for values in told]
        lines.append([preset, *shares, *estimates, f"{100 * success:.0f}%"])
    return Table(
        caption="Means over learners with 95% bootstrap intervals. Steps that are neither ambiguous nor "
        "clear do not count; intent success is the share of all trials.",
        head=[
            "preset",
            "steps ambiguous",
            "steps clear",
            "w where ambiguous",
            "w where clear",
            "area of w",
            "area of the time left",
            "intent success",
        ],
        rows=lines,
    )


def _moments_figure(scenario: str | None, shown: list[dict[str, Any]]) -> Any:
    world = scenario_of(scenario)
    figure, axes = new_figure(7.6, rows=len(_MOMENTS), columns=2, sharex=True, sharey=True)
    for column, one in enumerate(shown):
        way = np.stack([one["columns"]["x"], one["columns"]["y"]], axis=1)
        for line, moment in enumerate(one["moments"]):
            place = axes[line, column]
            draw_scene(place, world)
            for index, demonstration in enumerate(one["ways"]):
                label = None if index else "demonstrations"
                place.plot(
                    *np.array(demonstration).T,
                    ":",
                    color=COLOURS["demonstration"],
                    linewidth=0.7,
                    label=label,
                )
            mean, sigma = np.array(moment["mean"]), np.array(moment["sigma"])
            draw_band(place, mean, sigma, COLOURS["agent"], "expected")
            so_far = way[: moment["row"] + 1]
            place.plot(*so_far.T, color="black", linewidth=1.8, label="driven")
            place.plot(*so_far[-1], marker="o", color="black", markersize=6)
            place.set_title(f"{one['preset']}: {moment['time']:.1f} s", fontsize=9)
            space = world.workspace
            place.set(xlim=(space.x_min, space.x_max), ylim=(space.y_min, space.y_max))
            place.label_outer()
    _legend(figure, axes[0, 0])
    return figure


def _time_figure(shown: list[dict[str, Any]]) -> Any:
    figure, axes = new_figure(7.6, rows=4, columns=2, sharex=True, sharey="row")
    whose = {"human": "human", "autonomous": "agent", "shared": "shared"}
    for column, one in enumerate(shown):
        columns = {name: np.array(values) for name, values in one["columns"].items()}
        t = columns["t"]
        top, left, right, place = axes[:, column]
        top.plot(t, columns["human_weight"], color=COLOURS["human"], label="w")
        top.plot(t, columns["confidence"], color=COLOURS["confidence"], linewidth=1.0, label="confidence")
        top.set_ylim(-0.03, 1.03)
        top.set_title(one["preset"], fontsize=10)
        for axis, wheel in ((left, "left"), (right, "right")):
            for who, name in whose.items():
                axis.plot(t, columns[f"{who}_{wheel}"], color=COLOURS[name], linewidth=1.1, label=name)
        place.plot(t, columns["x"], color="black", label="x")
        place.plot(t, columns["y"], color="black", linestyle="--", label="y")
        for axis in axes[:, column]:
            # The last row is not applied, and nothing is told of it.
            axis.fill_between(
                t,
                0,
                1,
                where=np.append(one["ambiguous"], False),
                transform=axis.get_xaxis_transform(),
                color="0.9",
                linewidth=0,
                zorder=0,
                label="ambiguous" if axis is top else None,
            )
        place.set_xlabel("t, s")
    for axis, label in zip(
        axes[:, 0], ("share", "left wheel, rad/s", "right wheel, rad/s", "position, m"), strict=True
    ):
        axis.set_ylabel(label)
        # Room for the legend.
        low, high = axis.get_ylim()
        axis.set_ylim(low, high + 0.25 * (high - low))
        if label == "share":
            axis.set_yticks([0.0, 0.5, 1.0])
        axis.legend(fontsize=7, frameon=False, loc="upper right", ncols=3)
    figure.align_ylabels(axes[:, 0])
    return figure


def _weight_figure(learners: list[dict[str, Any]]) -> Any:
    figure, axes = new_figure(2.6, columns=3)
    for place, preset in zip(axes[:2], _PRESETS, strict=True):
        pairs = np.stack(
            [_of(learners, preset, f"weight_where_{kind}") for kind in ("ambiguous", "clear")], axis=1
        )
        for pair in pairs:
            place.plot([0, 1], pair, color=COLOURS[preset], linewidth=0.7, marker="o", markersize=3)
        place.set(xticks=[0, 1], xticklabels=["ambiguous", "clear"], xlim=(-0.3, 1.3), ylim=(0, 1.02))
        place.set(ylabel="mean w", title=preset)
    for at, preset in enumerate(_PRESETS):
        areas = _of(learners, preset, "area")
        # Side by side where they are many, so that each is seen.
        beside = at + np.linspace(-0.15, 0.15, len(areas))
        axes[2].plot(beside, areas, "o", color=COLOURS[preset], markersize=3)
    axes[2].axhline(0.5, color="0.5", linestyle="--", linewidth=1)
    axes[2].set(xticks=[0, 1], xticklabels=_PRESETS, xlim=(-0.5, 1.5), ylim=(0, 1.02))
    axes[2].set(ylabel="area under the ROC curve", title="w as a sign of ambiguity")
    for place in axes:
        place.title.set_fontsize(9)
    return figure


def _legend(figure: Any, axes: Any) -> None:
    handles, labels = axes.get_legend_handles_labels()
    legend_below(figure, handles, labels, columns=len(labels))


EXPERIMENT = Experiment(name="shared_run", tasks=tasks, cost=cost, report=report)
