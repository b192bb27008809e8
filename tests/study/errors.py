"""How often studies of simulated participants report an effect. Usage: errors.py [STUDIES [SEED]]

Each study has 12 participants, drawn with replacement from 60 simulated ones, who drive alone under two names
of the same condition, and two primary measures. An effect is then added to one of them.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy import stats

from drake_shared.analysis.metrics import metrics_of
from drake_shared.analysis.statistics import ALPHA, holm
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.study.design import Condition, DeclaredMeasure, Measures, Study, Texts
from drake_shared.study.models import fit
from drake_shared.study.power import power_in_studies
from drake_shared.study.simulated import run_steps, simulated_behaviours, simulation_of
from drake_shared.study.steps import participants_of, steps_of

POOL, SIZE = 60, 12
MEASURES = (
    DeclaredMeasure(name="completion_time", smallest_effect=0.1),
    DeclaredMeasure(name="human_effort", smallest_effect=1.0),
)


def pool_rows(seed: int) -> dict[str, list[list[dict]]]:
    """Rows of each measure, for each simulated participant."""
    alone = Condition(config=SharedControlConfig(driver="human"))
    study = Study(
        name="null",
        conditions={"a": alone, "b": alone},
        participants=POOL,
        trials=6,
        practice=0,
        texts=Texts(consent="-"),
        measures=Measures(primary=MEASURES),
        seed=seed,
    )
    simulation = simulation_of(study, "a")
    behaviours = simulated_behaviours(POOL, seed=seed)
    rows: dict[str, list[list[dict]]] = {measure.name: [] for measure in MEASURES}
    of_each = [
        [step for step in steps_of(study, name) if step.kind == "trial"] for name in participants_of(study)
    ]
    pairs = [(step, behaviours[number]) for number, steps in enumerate(of_each) for step in steps]
    measured = iter(metrics_of(list(run_steps(simulation, *zip(*pairs, strict=True)))))
    for steps in of_each:
        found = [next(measured) for _ in steps]
        for name, own in rows.items():
            keys = ("condition", "place", "block", "route")
            own.append(
                [
                    {key: getattr(step, key) for key in keys} | {"value": values[name]}
                    for step, values in zip(steps, found, strict=True)
                    if np.isfinite(values[name])
                ]
            )
    return rows


def difference(own: list[dict]) -> float:
    """Mean of a participant in b less that in a."""
    one, other = ([row["value"] for row in own if row["condition"] == name] for name in "ab")
    return float(np.mean(other) - np.mean(one))


def centre(rows: list[list[dict]], by_order: dict[str, list[int]]) -> None:
    """Takes away the difference between the conditions that the pool has by chance."""
    shift = np.mean([np.mean([difference(rows[number]) for number in group]) for group in by_order.values()])
    for own in rows:
        for row in own:
            row["value"] -= shift * (row["condition"] == "b")


def study_of(rows: list[list[dict]], chosen: np.ndarray) -> list[dict]:
    return [
        row | {"participant": f"P{place:02d}"} for place, number in enumerate(chosen) for row in rows[number]
    ]


def main() -> None:
    given = [int(text) for text in sys.argv[1:]]
    count, seed = [*given, *(200, 1)[len(given) :]]
    rows, random = pool_rows(seed), np.random.default_rng(seed)
    by_order: dict[str, list[int]] = {"a": [], "b": []}
    for number, own in enumerate(rows[MEASURES[0].name]):
        by_order[own[0]["condition"]].append(number)
    for own in rows.values():
        centre(own, by_order)
    false, found = 0, np.zeros(len(MEASURES), dtype=int)
    for _ in range(count):
        chosen = np.concatenate([random.choice(numbers, SIZE // 2) for numbers in by_order.values()])
        fits = [
            fit(study_of(rows[item.name], chosen), within=True, share=False).contrast({"a": 1.0, "b": -1.0})
            for item in MEASURES
        ]
        for effect in (False, True):
            # An effect moves the contrast by as much, and leaves its standard error as it is.
            t = [
                (mean - item.smallest_effect * effect) / error
                for item, (mean, error) in zip(MEASURES, fits, strict=True)
            ]
            decided = np.array(holm([2.0 * stats.t.sf(abs(one), SIZE - 2) for one in t])) <= ALPHA
            if effect:
                found += decided
            else:
                false += bool(decided.any())
    interval = stats.binomtest(false, count).proportion_ci(0.95)
    print(f"{false} of {count} studies without an effect report one", end=" ")
    print(f"({interval.low:.1%} to {interval.high:.1%})")
    for item, share in zip(MEASURES, found / count, strict=True):
        means = {
            name: np.array(
                [np.mean([r["value"] for r in own if r["condition"] == name]) for own in rows[item.name]]
            )
            for name in "ab"
        }
        planned = power_in_studies(item, (means["a"], means["b"]), SIZE, ALPHA / len(MEASURES), True)
        print(f"{item.name}: {share:.1%} find the effect of {item.smallest_effect:g}", end="; ")
        print(f"planned at least {planned:.1%}")


if __name__ == "__main__":
    main()
