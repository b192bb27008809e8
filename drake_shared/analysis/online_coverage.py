"""Coverage of forecasts in trials, with and without adaptive conformal intervals."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from drake_shared.analysis.confidence_calibration import predictions
from drake_shared.learners import Learner
from drake_shared.learners.conformal import AdaptiveConformal, score_of
from drake_shared.simulation.trial import Trial

Floats = NDArray[np.float64]

# Of the adaptation. A larger one follows a shift sooner, with intervals that vary more.
_RATE = 0.05


def online_coverage(
    learner: Learner, trials: Iterable[Trial], *, coverage: float = 0.9, ahead: float = 1.0
) -> tuple[float, float]:
    """Share of positions, ``ahead`` s later, that the forecast's intervals cover in both coordinates.

    The trials are one stream: what is learnt from one serves the next.

    Args:
        learner: That took part.
        trials: Logs, in order.
        coverage: Nominal, from 0 to 1.
        ahead: In [s].

    Returns:
        With intervals that adapt online, and with those of the learner; NaN without a forecast.
    """
    conformal = AdaptiveConformal(coverage=coverage, rate=_RATE)
    adapted, own = [], []
    for trial in trials:
        steps = round(ahead / float(trial["t"][1] - trial["t"][0]))
        stated: list[tuple[Floats, Floats, float]] = []
        for step, (intention, _) in enumerate(predictions(learner, trial)):
            if step >= steps:
                mean, variance, factor = stated[step - steps]
                score = score_of(trial.positions[step] - mean, variance, coverage)
                if np.isfinite(score):
                    adapted.append(conformal.observe(score, factor))
                    own.append(score <= 1.0)
            at = intention.time + ahead
            index = min(max(int(intention.times.searchsorted(at)), intention.first), len(intention.times) - 1)
            mean = np.array(intention.position_at(at))
            stated.append((mean, intention.variance[index], conformal.factor))
    return (float(np.mean(adapted)), float(np.mean(own))) if adapted else (float("nan"), float("nan"))
