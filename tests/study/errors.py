"""How often studies of simulated participants report an effect. Usage: errors.py [STUDIES [SEED]]

Each study has 12 participants of its own, whose trials are all simulated: they drive alone, under two names
of the same condition. Its three primary measures are analysed as `study analyze` does, first as they are, and
then with the smallest effect of the first one added to its values. The power planned for it is that of
`study plan`.
"""

from __future__ import annotations

import dataclasses
import math
import sys

from scipy import stats
from tqdm import tqdm

from drake_shared.analysis.metrics import metrics_of
from drake_shared.common.threads import limit_threads
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.study.design import Condition, DeclaredMeasure, Measures, Study, Texts
from drake_shared.study.models import contrasts_of
from drake_shared.study.power import power_of
from drake_shared.study.simulated import run_steps, simulated_behaviours, simulation_of
from drake_shared.study.steps import participants_of, steps_of

POOL = 400
EFFECT = DeclaredMeasure(name="completion_time", smallest_effect=0.15)
MEASURES = (
    EFFECT,
    DeclaredMeasure(name="human_effort", smallest_effect=1.0),
    DeclaredMeasure(name="intent_success", smallest_effect=0.1),
)
ALONE = Condition(config=SharedControlConfig(driver="human"))
STUDY = Study(
    name="null",
    conditions={"a": ALONE, "b": ALONE},
    participants=12,
    trials=6,
    practice=0,
    texts=Texts(consent="-"),
    measures=Measures(primary=MEASURES),
)


def rows_of(study: Study, simulation) -> list[dict]:
    """Metrics of all trials, with what the models need."""
    behaviours = simulated_behaviours(study.participants, seed=study.seed)
    pairs = [
        (step, behaviour)
        for name, behaviour in zip(participants_of(study), behaviours, strict=True)
        for step in steps_of(study, name)
        if step.kind == "trial"
    ]
    found = metrics_of(list(run_steps(simulation, *zip(*pairs, strict=True))))
    return [dataclasses.asdict(step) | values for (step, _), values in zip(pairs, found, strict=True)]


def reported(rows: list[dict], effect: float) -> set[str]:
    """The measures that are reported to differ between the conditions."""
    family = []
    for item in MEASURES:
        shift = {"a": 0.0, "b": effect if item is EFFECT else 0.0}
        values = [row | {"value": row[item.name] + shift[row["condition"]]} for row in rows]
        family.append((item, [row for row in values if not math.isnan(row["value"])]))
    found = contrasts_of(family, list(STUDY.conditions), within=True)
    return {item.measure.name for item in found if item.verdict == "different"}


def main() -> None:
    limit_threads()
    given = [int(text) for text in sys.argv[1:]]
    count, seed = [*given, *(200, 1)[len(given) :]]
    simulation = simulation_of(STUDY, "a")
    false = true = 0
    for number in tqdm(range(count), unit="study", disable=None):
        rows = rows_of(dataclasses.replace(STUDY, seed=1000 * seed + number), simulation)
        false += bool(reported(rows, 0.0))
        true += EFFECT.name in reported(rows, EFFECT.smallest_effect)
    low, high = stats.binomtest(false, count).proportion_ci(0.95)
    share = f"{false / count:.1%} [{low:.1%}, {high:.1%}]"
    print(f"{false} of {count} studies without an effect report one: {share}")
    low, high = stats.binomtest(true, count).proportion_ci(0.95)
    planned = power_of(dataclasses.replace(STUDY, seed=seed), pool=POOL)[0]
    print(
        f"{true / count:.1%} [{low:.1%}, {high:.1%}] find {EFFECT.smallest_effect} s more of {EFFECT.name},"
    )
    print(f"planned {planned.power:.1%}")


if __name__ == "__main__":
    main()
