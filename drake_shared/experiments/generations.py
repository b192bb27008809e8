"""What the feedback loop does if it goes on: shared runs fed back again and again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drake_shared.analysis.confidence_calibration import (
    assess_confidence,
    confidence_calibration,
    demonstrations_of_routes,
)
from drake_shared.analysis.metrics import metrics
from drake_shared.analysis.statistics import Claim, interval, not_worse, paired, paired_claims
from drake_shared.common.errors import RunError
from drake_shared.demonstrations import Demonstration
from drake_shared.experiments.common import (
    as_demonstrations,
    drives,
    run,
    scenario_of,
    train_all,
    training_cost,
)
from drake_shared.experiments.drawing import COLOURS, draw_curve, legend_below, new_figure
from drake_shared.experiments.paired_trials import groups
from drake_shared.experiments.report import number, with_interval
from drake_shared.experiments.section import Experiment, Picture, Section, Size, Table
from drake_shared.operators.named import OPERATORS
from drake_shared.simulation.runner import Task

PRESETS = ("paper", "default")
OPERATOR = "unskilled"
"""The primary operator hardly ever fails: nothing that a loop does to intent success would show."""
GENERATIONS = 5
ARMS = {"shared": COLOURS["shared"], "human": COLOURS["human"], "frozen": "0.35"}
"""Name to colour. The last one gets no data; nothing becomes of it."""
FED = ("shared", "human")
_QUICK_GENERATIONS = 2
_TRIAL_MEASURES = {
    "intent_success": ("intent success, %", 100.0),
    "human_effort": ("human effort, rad", 1.0),
    "disagreement": ("disagreement, rad/s", 1.0),
    "mean_human_weight": ("mean human weight", 1.0),
}
_LOOP_MEASURES = {
    "expected_calibration_error": ("calibration error", 1.0),
    "confident_and_wrong": ("sure and wrong, % of steps", 100.0),
    "autonomy_share": ("made by autonomy, % of data", 100.0),
}
_MEASURES = {**_TRIAL_MEASURES, **_LOOP_MEASURES}
# Smallest effects of interest: one trial in twenty, 4% of what is usual, and a fiftieth of the scale.
_SMALLEST = {"intent_success": 5.0, "disagreement": 20.0, "expected_calibration_error": 0.02}
_GROUP = {"paper": 10, "default": 5}
_TRIAL_SECONDS, _DRIVE_SECONDS = 0.09, 0.1
_EVERY = 4
# Seeds of a repeat begin a thousand apart: of the base demonstrations at 0, of generation g's runs at 100 g,
# of the trials at 900. Drives that are repeated add multiples of 1 000 003 to theirs.
_FIRST_SEED, _STRIDE, _RUNS, _TRIALS = 40_000_000, 1_000, 100, 900


def tasks(scenario: str | None, size: Size) -> list[Task]:
    """One for each preset and some repeats; half as many repeats as learners elsewhere."""
    return [
        Task(
            "drake_shared.experiments.generations:run_repeats",
            {
                "scenario": scenario,
                "preset": preset,
                "repeats": repeats,
                "generations": _QUICK_GENERATIONS if size.name == "quick" else GENERATIONS,
                "trials": size.trials,
            },
        )
        for preset in PRESETS
        for repeats in groups(max(2, size.learners // 2), _GROUP[preset])
    ]


def cost(task: Task) -> float:
    """Seconds of one core, roughly."""
    told = task.arguments
    repeats, generations = len(told["repeats"]), told["generations"]
    routes = len(scenario_of(told["scenario"]).routes)
    training = training_cost(told["preset"], repeats)
    training += generations * training_cost(told["preset"], len(FED) * repeats)
    learners = 1 + generations * len(FED)
    return training + repeats * learners * (_TRIAL_SECONDS * told["trials"] + _DRIVE_SECONDS * routes)


def run_repeats(
    scenario: str | None, preset: str, repeats: Sequence[int], generations: int, trials: int
) -> list[dict[str, Any]]:
    """Repeats side by side; a row for each generation and arm.

    A repeat is: a base demonstration of each route by the primary operator alone, and a learner. Then in each
    generation the operator under study drives each route once more, in shared control with the newest
    learner or alone, with the same noise seeds; a new learner is taught all data so far, and gets a K of its
    own. Where the operator does not manage that in many attempts nothing is added, and the learner stays
    ("stalled"). All learners of a repeat are trained with the same seed and take part in the same trials, so
    that the frozen learner's are those of generation 0.

    Args:
        scenario: File or name.
        preset: Of the learners.
        repeats: Their indices, below 1000; they fix all seeds.
        generations: After the first learner, at most 8.
        trials: With each learner, at most 100.
    """
    behaviour = OPERATORS[OPERATOR].behaviour_in(scenario_of(scenario))
    count = len(scenario_of(scenario).routes)
    base = {repeat: drives(scenario, count=count, seed=_seed(repeat)) for repeat in repeats}
    first = _taught(scenario, base, preset)
    data = {(repeat, arm): list(base[repeat]) for repeat in repeats for arm in FED}
    newest = {(repeat, arm): first[repeat] for repeat, arm in data}
    frozen = {
        repeat: _judged(scenario, first[repeat], base[repeat], _seed(repeat, _TRIALS), trials)
        for repeat in repeats
    }
    rows: dict[int, list[dict[str, Any]]] = {
        repeat: [_told(preset, repeat, arm, 0) | frozen[repeat] for arm in ARMS] for repeat in repeats
    }
    for generation in range(1, generations + 1):
        grown = []
        for repeat, arm in data:
            learner = newest[repeat, arm] if arm == "shared" else None
            seed = _seed(repeat, _RUNS * generation)
            try:
                added = drives(scenario, learner=learner, count=count, seed=seed, behaviour=behaviour)
            except RunError:
                # To leave such repeats out would be to look at those loops alone that went well.
                continue
            data[repeat, arm] += added
            grown.append((repeat, arm))
        newest |= _taught(scenario, {key: data[key] for key in grown}, preset)
        for (repeat, arm), learner in newest.items():
            judged = _judged(scenario, learner, data[repeat, arm], _seed(repeat, _TRIALS), trials)
            judged["stalled"] = (repeat, arm) not in grown
            rows[repeat].append(_told(preset, repeat, arm, generation) | judged)
            if arm == FED[-1]:
                rows[repeat].append(_told(preset, repeat, "frozen", generation) | frozen[repeat])
    return [row for repeat in repeats for row in rows[repeat]]


def report(scenario: str | None, size: Size, results: list[Any]) -> Section:
    """Curves over generations, what is left of them at the end, and whether the loop did harm."""
    rows = [row for result in results for row in result]
    last = max(row["generation"] for row in rows)
    stalled = [
        f"{count} with preset {preset}, arm {arm}"
        for preset in PRESETS
        for arm in FED
        if (count := sum(row["stalled"] for row in rows if (row["preset"], row["arm"]) == (preset, arm)))
    ]
    counts = [
        f"{len(_values(rows, 'intent_success', preset, 'frozen', 0))} repeats of preset {preset}"
        for preset in PRESETS
    ]
    routes = len(scenario_of(scenario).routes)
    text = [
        f"A learner of {routes} demonstrations by the primary operator is generation 0. In each of {last} "
        f"further generations the {OPERATOR} operator, who is simulated as all are here, adds {routes} runs: "
        "in shared control with the newest learner (arm shared) or alone (arm human), on the same routes and "
        "noise seeds. A new learner is taught all data so far, each run weighted by its own clearance, and K "
        "is calibrated anew. The frozen learner stays as it is: it is generation 0 in the same trials, "
        "routes, seeds and all. So shared against frozen tells what the whole loop does, and shared against "
        "human what sharing does to it beyond more data. The operator is one who fails alone now and "
        "then: with one who never does no harm to success could be seen.",
        f"{' and '.join(counts)}, {size.trials} trials with each learner. Intervals are 95% by bootstrap "
        "over repeats; those of the claims are wider, for both presets and all measures of a kind. The "
        "calibration error compares the confidence with how often the expected way was the operator's; sure "
        "and wrong is a confidence above 0.8 in another way. The share of data that autonomy made is the "
        "mean of 1 − w over the training runs.",
        _outcome(rows, last),
        "A run is added only if it reached the goal without contact, else it is driven again with another "
        "seed: the worst of what a learner does is never fed back. A run that went another way than was "
        "meant is added as well. The base demonstrations are a steadier operator's than all that is added: "
        "in both fed arms the share of unsteady driving grows.",
    ]
    if stalled:
        text.append(
            "Sometimes the operator did not reach the goal in any of many attempts to drive a route. Then "
            "nothing was added and the learner stayed for that generation, and it counts as it is: "
            f"{', '.join(stalled)} (generations of a repeat)."
        )
    return Section(
        title="The feedback loop over generations",
        text=text,
        pictures=[
            Picture.of(
                _curves(rows, _TRIAL_MEASURES, last),
                "What the trials tell, by generation; above preset paper, below preset default. Lines are "
                "means over repeats, bands their 95% intervals.",
            ),
            Picture.of(
                _curves(rows, _LOOP_MEASURES, last),
                "How honest the confidence is, and how much of the training data autonomy made.",
            ),
        ],
        tables=[_means_table(rows, last), _differences_table(rows, last)],
        claims=_claims(rows, last),
        data={"generations": rows},
    )


def _seed(repeat: int, purpose: int = 0) -> int:
    return _FIRST_SEED + _STRIDE * repeat + purpose


def _told(preset: str, repeat: int, arm: str, generation: int) -> dict[str, Any]:
    return {
        "preset": preset,
        "operator": OPERATOR,
        "repeat": repeat,
        "arm": arm,
        "generation": generation,
    }


def _taught(scenario: str | None, data: Mapping[Any, Sequence[Demonstration]], preset: str) -> dict[Any, Any]:
    """A learner for each set of data, by its key: a repeat, or a repeat and an arm."""
    seeds = [key[0] if isinstance(key, tuple) else key for key in data]
    sets = [as_demonstrations(scenario, items) for items in data.values()]
    return dict(zip(data, train_all(sets, seeds, preset=preset), strict=True))


def _judged(
    scenario: str | None, learner: Any, data: Sequence[Demonstration], seed: int, trials: int
) -> dict[str, Any]:
    """The means of the trials' measures, the calibration over all their steps, and what the data are."""
    world = scenario_of(scenario)
    behaviour = OPERATORS[OPERATOR].behaviour_in(world)
    ways = demonstrations_of_routes(world, learner)
    found: list[Mapping[str, Any]] = []
    parts = []
    for index in range(trials):
        route = world.routes[index % len(world.routes)].name
        trial = run(scenario, learner, route=route, seed=seed + index, behaviour=behaviour)
        found.append(metrics(trial))
        if route in ways:
            parts.append(assess_confidence(learner, trial, ways[route], every=_EVERY))
    honest: Mapping[str, Any] = confidence_calibration(parts) if parts else {}
    return {
        **{name: float(np.mean([one[name] for one in found])) for name in _TRIAL_MEASURES},
        "expected_calibration_error": honest.get("expected_calibration_error", float("nan")),
        "confident_and_wrong": honest.get("confident_and_wrong", float("nan")),
        "autonomy_share": float(np.mean([1.0 - item.provenance["human_weight"] for item in data])),
        "demonstrations": len(data),
        "confidence_gain": learner.confidence_gain,
        "stalled": False,
    }


def _values(
    rows: Sequence[Mapping[str, Any]], measure: str, preset: str, arm: str, generation: int
) -> np.ndarray:
    """A value for each repeat, by its index, in the unit in which the measure is told."""
    found = {
        row["repeat"]: row[measure]
        for row in rows
        if (row["preset"], row["arm"], row["generation"]) == (preset, arm, generation)
    }
    return _MEASURES[measure][1] * np.array([found[repeat] for repeat in sorted(found)], dtype=float)


def _claims(rows: Sequence[Mapping[str, Any]], last: int) -> list[Claim]:
    """Shared against frozen at the end: intent success, disagreement and calibration, for each preset."""

    def end(measure: str, preset: str, arm: str) -> np.ndarray:
        return _values(rows, measure, preset, arm, last)

    after = f"after {last} generations of shared runs"
    margins = [
        ("intent_success", f"{after} intent success is not lower than of the frozen learner", "points", 1.0),
        ("expected_calibration_error", f"{after} the confidence is calibrated no worse", "", -1.0),
    ]
    # Bonferroni's levels: not-worse claims have intervals alone, and no p to be ordered by.
    level = 1.0 - 0.05 / (len(margins) * len(PRESETS))
    kept = [
        not_worse(
            f"{text} (preset {preset})",
            sign * (end(measure, preset, "shared") - end(measure, preset, "frozen")),
            margin=_SMALLEST[measure],
            unit=unit,
            level=level,
        )
        for measure, text, unit, sign in margins
        for preset in PRESETS
    ]
    lower = paired_claims(
        [
            {
                "text": f"{after} disagreement is lower than with the frozen learner (preset {preset})",
                "one": end("disagreement", preset, "frozen"),
                "other": end("disagreement", preset, "shared"),
                "smallest": _SMALLEST["disagreement"],
                "unit": "rad/s",
            }
            for preset in PRESETS
        ]
    )
    return [*kept[: len(PRESETS)], *lower, *kept[len(PRESETS) :]]


def _difference(
    rows: Sequence[Mapping[str, Any]], measure: str, preset: str, one: str, other: str, last: int
) -> str:
    found = paired(*(_values(rows, measure, preset, arm, last) for arm in (one, other))).estimate
    return with_interval(found)


def _outcome(rows: Sequence[Mapping[str, Any]], last: int) -> str:
    said = []
    for preset in PRESETS:
        share = interval(_values(rows, "autonomy_share", preset, "shared", last))
        beyond = {
            measure: _difference(rows, measure, preset, "shared", "human", last) for measure in _MEASURES
        }
        said.append(
            f"with preset {preset} autonomy made {number(share.mean)}% of the shared arm's data; against the "
            f"human arm intent success differs by {beyond['intent_success']} points, effort by "
            f"{beyond['human_effort']} rad, disagreement by {beyond['disagreement']} rad/s, and the "
            f"calibration error by {beyond['expected_calibration_error']}"
        )
    return f"After generation {last}: {'; '.join(said)}."


def _curves(rows: Sequence[Mapping[str, Any]], measures: Mapping[str, tuple[str, float]], last: int) -> Any:
    figure, axes = new_figure(4.4, rows=len(PRESETS), columns=len(measures), sharex=True, sharey="col")
    at = range(last + 1)
    for row, preset in zip(axes, PRESETS, strict=True):
        for place, (measure, (title, _)) in zip(row, measures.items(), strict=True):
            for arm, colour in ARMS.items():
                found = [interval(_values(rows, measure, preset, arm, generation)) for generation in at]
                line = {"linestyle": "--", "marker": None} if arm == "frozen" else {}
                draw_curve(place, at, found, colour, arm, **line)
            if preset == PRESETS[0]:
                place.set_title(title, fontsize=9)
            else:
                place.set_xlabel("generation", fontsize=9)
                place.set_xticks(at)
        row[0].set_ylabel(f"preset {preset}", fontsize=9)
    legend_below(figure, *axes[0][0].get_legend_handles_labels(), columns=len(ARMS))
    return figure


def _means_table(rows: Sequence[Mapping[str, Any]], last: int) -> Table:
    cells = []
    for preset in PRESETS:
        for arm in ARMS:
            found = [interval(_values(rows, measure, preset, arm, last)) for measure in _MEASURES]
            cells.append(
                [
                    preset,
                    arm,
                    *(with_interval(one) for one in found),
                ]
            )
    return Table(
        caption=f"After generation {last}: means and 95% bootstrap intervals over repeats.",
        head=["preset", "arm", *(title for title, _ in _MEASURES.values())],
        rows=cells,
    )


def _differences_table(rows: Sequence[Mapping[str, Any]], last: int) -> Table:
    return Table(
        caption=f"Paired differences over repeats after generation {last}, with 95% bootstrap intervals that "
        "are not adjusted for their number.",
        head=["preset", "difference", *(title for title, _ in _MEASURES.values())],
        rows=[
            [
                preset,
                f"{one} − {other}",
                *(_difference(rows, measure, preset, one, other, last) for measure in _MEASURES),
            ]
            for preset in PRESETS
            for one, other in (("shared", "frozen"), ("human", "frozen"), ("shared", "human"))
        ],
    )


EXPERIMENT = Experiment(name="generations", tasks=tasks, cost=cost, report=report)
