"""Power of a planned study, by simulation with simulated participants.

Simulated participants give the variation between and within participants. Their differences between
conditions are centred, and the smallest effect of interest (none, where equivalence is tested) takes their
place: the power is that of finding this effect, not one that simulated operators happen to show. In a study
without missing trials the contrast of the mixed model is that of the participants' means, which is tested
here. Holm's method is at least as powerful as the level used, ALPHA divided by the number of contrasts.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from drake_shared.analysis.metrics import metrics_of
from drake_shared.analysis.statistics import ALPHA
from drake_shared.operators.behaviour import Behaviour
from drake_shared.study.design import DeclaredMeasure, Study
from drake_shared.study.orders import rows_of
from drake_shared.study.simulated import run_steps, simulated_behaviours, simulation_of
from drake_shared.study.steps import Step

Floats = NDArray[np.float64]
GOAL = 0.8
"""Power that a study should have."""
_STUDIES, _LARGEST = 2_000, 8


@dataclasses.dataclass(frozen=True, kw_only=True)
class Power:
    """Power of a contrast.

    Attributes:
        measure: Its name.
        contrast: "A - B".
        spread: Standard deviation, of the participants' differences or (between participants) means.
        power: Share of simulated studies that find the effect.
        enough: Fewest participants, in balanced orders, with which it is `GOAL`; None beyond eight times as
            many.
    """

    measure: str
    contrast: str
    spread: float
    power: float
    enough: int | None


def power_of(study: Study, *, pool: int = 40, fitted: Sequence[Behaviour] = ()) -> list[Power]:
    """Power of each contrast of each primary measure of trials; questionnaires cannot be simulated.

    Args:
        study: The study.
        pool: Number of simulated participants from which studies are drawn.
        fitted: See `drake_shared.study.simulated.simulated_behaviours`.
    """
    contrasts = list(itertools.combinations(study.conditions, 2))
    level = ALPHA / (len(contrasts) * len(study.measures.primary))
    measures = [measure for measure in study.measures.primary if "." not in measure.name]
    means = participant_means(study, pool=pool, fitted=fitted, measures=[m.name for m in measures])
    rows = rows_of(study.order, len(study.conditions)) if study.design == "within" else None
    step = len(rows) if rows else len(study.conditions) if study.design == "between" else 1
    found = []
    for measure in measures:
        for one, other in contrasts:
            samples = means[one][measure.name], means[other][measure.name]
            within = study.design == "within"
            power = [
                power_in_studies(
                    measure, samples, count if within else count // len(study.conditions), level, within
                )
                for count in range(step, _LARGEST * study.participants + 1, step)
            ]
            enough = next((step * (i + 1) for i, share in enumerate(power) if share >= GOAL), None)
            spread = _finite(samples[0] - samples[1] if within else samples[0]).std(ddof=1)
            share = power[study.participants // step - 1]
            contrast = f"{one} - {other}"
            found.append(
                Power(
                    measure=measure.name, contrast=contrast, spread=float(spread), power=share, enough=enough
                )
            )
    return found


def participant_means(
    study: Study, *, pool: int, fitted: Sequence[Behaviour], measures: Sequence[str]
) -> dict[str, dict[str, Floats]]:
    """Mean of each measure over the trials of each simulated participant, (pool,), by condition."""
    behaviours = simulated_behaviours(pool, seed=study.seed, fitted=fitted)
    routes = study.route_names()
    count = study.trials * (study.blocks if study.design == "within" else 1)
    found: dict[str, dict[str, Floats]] = {}
    for place, condition in enumerate(study.conditions):
        random = np.random.default_rng([study.seed, 11, place])
        steps = [
            Step(
                participant="",
                index=0,
                kind="trial",
                condition=condition,
                route=routes[trial % len(routes)],
                seed=int(random.integers(2**32)),
            )
            for _ in range(pool)
            for trial in range(count)
        ]
        each = [behaviour for behaviour in behaviours for _ in range(count)]
        rows = metrics_of(list(run_steps(simulation_of(study, condition), steps, each)))
        found[condition] = {
            name: _means(np.array([_number(row.get(name)) for row in rows]).reshape(pool, count))
            for name in measures
        }
    return found


def power_in_studies(
    measure: DeclaredMeasure, samples: tuple[Floats, Floats], count: int, level: float, within: bool
) -> float:
    """Share of studies drawn from simulated participants that find the smallest effect of a measure.

    Args:
        measure: Gives effect and hypothesis.
        samples: Means of the same participants in two conditions, each of shape (pool,).
        count: Number of participants, or of each group.
        level: Of the two-sided test.
        within: Whether each participant meets both conditions.
    """
    if count < 2:
        return 0.0
    random = np.random.default_rng(count)
    shift = measure.smallest_effect if measure.hypothesis == "difference" else 0.0
    parts = [_finite(samples[0] - samples[1])] if within else [_finite(sample) for sample in samples]
    if min(part.size for part in parts) < 2:
        return 0.0
    drawn = [random.choice(part - part.mean(), (_STUDIES, count)) for part in parts]
    mean = shift + drawn[0].mean(axis=1) - (0.0 if within else drawn[1].mean(axis=1))
    error = np.sqrt(sum(part.var(axis=1, ddof=1) / count for part in drawn))
    freedom = count - 1 if within else 2 * (count - 1)
    bound = stats.t.ppf(1.0 - level / 2.0, freedom) * error
    if measure.hypothesis == "difference":
        return float((np.abs(mean) > bound).mean())
    bound = stats.t.ppf(1.0 - level, freedom) * error
    return float((np.abs(mean) + bound < measure.smallest_effect).mean())


def _means(values: Floats) -> Floats:
    """Means of the defined values in each row; NaN where there is none."""
    defined = np.isfinite(values)
    total = np.where(defined, values, 0.0).sum(axis=1)
    means: Floats = np.where(defined.any(axis=1), total, math.nan) / np.maximum(defined.sum(axis=1), 1)
    return means


def _finite(values: Floats) -> Floats:
    return values[np.isfinite(values)]


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
