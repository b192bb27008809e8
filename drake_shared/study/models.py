"""Mixed models of the measures of a study, and contrasts between its conditions.

A measure is modelled as the mean of its condition, a linear trend over the places in the order (within
participants), and random effects of participant, route, and participant in each condition (REML). The last
makes the contrast of a balanced study that of the participants' means. Shares, such as success, are modelled
by generalised estimating equations with an identity link, exchangeable within participants, and the
covariance of Mancl and DeRouen (2001): their contrasts are differences in share. Both are compared with
Student's t, with a degree of freedom for each participant, less one and one for the trend (between
participants: less the number of conditions).
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import special, stats
from scipy.linalg import solve_triangular
from scipy.optimize import minimize
from statsmodels.genmod.cov_struct import Exchangeable
from statsmodels.genmod.generalized_estimating_equations import GEE

from drake_shared.analysis.statistics import ALPHA, holm, holm_levels
from drake_shared.common.threads import single_threaded
from drake_shared.study.design import DeclaredMeasure

Floats = NDArray[np.float64]
# Bounds: of the residual variance, as a share of the values' own, and of the standard deviations of random
# effects, as multiples of that of the residuals.
_LEAST_VARIANCE, _LARGEST_DEVIATION = 1e-12, 100.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class Fit:
    """A fitted model.

    Attributes:
        names: Of the fixed effects: conditions, and "place" for the trend.
        values: Of the fixed effects.
        covariance: Of the fixed effects.
        freedom: Degrees of freedom of contrasts.
        model: What was fitted.
        variances: Of random effects, by name.
    """

    names: Sequence[str]
    values: Floats
    covariance: Floats
    freedom: float
    model: str
    variances: Mapping[str, float] = dataclasses.field(default_factory=dict)

    def contrast(self, weights: Mapping[str, float]) -> tuple[float, float]:
        """A weighted sum of fixed effects and its standard error; NaN where it cannot be estimated."""
        vector = np.array([weights.get(name, 0.0) for name in self.names])
        variance = float(vector @ self.covariance @ vector)
        return float(vector @ self.values), math.sqrt(variance) if variance > 0.0 else math.nan


@dataclasses.dataclass(frozen=True, kw_only=True)
class Contrast:
    """The difference of a measure between two conditions.

    Attributes:
        measure: Declared measure.
        one, other: Conditions.
        mean: Of ``one`` minus ``other``.
        low, high: Its interval, at ``level``.
        level: That at which Holm's method decided; 1 - 2 alpha where equivalence is tested.
        p: Adjusted p-value.
        effect, effect_low, effect_high: Cohen's d_z within participants or d between, of the participants'
            means, with its 95% interval.
        participants, observations: Their numbers.
        model: What was fitted.
        verdict: "different", "equivalent" or "open".
    """

    measure: DeclaredMeasure
    one: str
    other: str
    mean: float
    low: float
    high: float
    level: float
    p: float
    effect: float
    effect_low: float
    effect_high: float
    participants: int
    observations: int
    model: str
    verdict: str


def fit(rows: Sequence[Mapping[str, Any]], *, within: bool, share: bool) -> Fit:
    """Fits the model of a measure.

    Args:
        rows: With participant, condition, place, route and value.
        within: Whether participants meet all conditions.
        share: Whether the values are 0 and 1.
    """
    frame = pd.DataFrame(rows)
    conditions = list(dict.fromkeys(frame["condition"]))
    design = {name: (frame["condition"] == name).astype(float) for name in conditions}
    if within and frame["place"].nunique() > 1:
        design["place"] = frame["place"] - frame["place"].mean()
    fixed = pd.DataFrame(design)
    participants = frame["participant"].nunique()
    # One for the mean of each group of participants, and one for the trend.
    freedom = float(max(1, participants - (1 + ("place" in design) if within else len(conditions))))
    if share:
        return _fit_share(frame, fixed, freedom)
    groups = {"participant": frame["participant"].to_numpy()}
    if frame["route"].nunique() > 1:
        groups["route"] = frame["route"].to_numpy()
    cells = frame["participant"] + "\t" + frame["condition"]
    if within and cells.nunique() < len(frame):
        groups["participant in condition"] = cells.to_numpy()
    return _fit_mixed(frame["value"].to_numpy(float), fixed, groups, freedom)


def _fit_share(frame: pd.DataFrame, fixed: pd.DataFrame, freedom: float) -> Fit:
    if frame["value"].nunique() < 2:
        values = np.array([0.0 if name == "place" else frame["value"].iloc[0] for name in fixed])
        nothing = np.zeros((len(values), len(values)))
        model = "none: all values are the same"
        return Fit(names=list(fixed), values=values, covariance=nothing, freedom=freedom, model=model)
    model = GEE(
        frame["value"].to_numpy(float),
        fixed.to_numpy(float),
        groups=frame["participant"].to_numpy(),
        cov_struct=Exchangeable(),
    )
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            found = model.fit(cov_type="bias_reduced")
            covariance = np.asarray(found.cov_params())
        except np.linalg.LinAlgError:
            # A participant alone determines a coefficient, so that its variance is unknown.
            found = model.fit(cov_type="naive")
            covariance = np.full((len(found.params), len(found.params)), math.nan)
    return Fit(
        names=list(fixed),
        values=np.asarray(found.params),
        covariance=covariance,
        freedom=freedom,
        model="GEE, identity link, exchangeable within participants",
    )


def _fit_mixed(
    values: Floats, fixed: pd.DataFrame, groups: Mapping[str, NDArray[Any]], freedom: float
) -> Fit:
    """Maximises the restricted likelihood, profiled over fixed effects and residual variance.

    As in lme4 (Bates et al. 2015), a random effect is a relative standard deviation times a
    standard normal vector. The search uses no gradient: this vanishes where a variance is 0, which is often
    the best value.
    """
    x = fixed.to_numpy(float)
    levels = {name: sorted(set(labels)) for name, labels in groups.items()}
    z = np.hstack([np.array(labels)[:, None] == levels[name] for name, labels in groups.items()]).astype(
        float
    )
    # Values less their least squares: of a large mean and a small spread, products would lose the digits.
    first = np.linalg.lstsq(x, values, rcond=None)[0]
    rest = values - x @ first
    scale = float(rest.std()) or 1.0
    w = np.column_stack((x, rest / scale))
    products, freedom_left = (z.T @ z, z.T @ w, w.T @ w), len(values) - x.shape[1]
    sizes = [len(names) for names in levels.values()]

    def profiled(deviations: Floats) -> tuple[float, Floats, Floats, float]:
        """Deviance without constants, inverse of X' V^-1 X, fixed effects, and residual variance."""
        each = np.repeat(deviations, sizes)
        root = np.linalg.cholesky(np.eye(len(each)) + each[:, None] * products[0] * each)
        half = solve_triangular(root, each[:, None] * products[1], lower=True)
        left = products[2] - half.T @ half
        inverse = np.linalg.inv(left[:-1, :-1])
        effects = inverse @ left[:-1, -1]
        variance = max(float(left[-1, -1] - left[:-1, -1] @ effects) / freedom_left, _LEAST_VARIANCE)
        deviance = 2.0 * np.log(np.diag(root)).sum() - np.linalg.slogdet(inverse)[1]
        return float(deviance + freedom_left * math.log(variance)), inverse, effects, variance

    with single_threaded():
        found = minimize(
            lambda deviations: profiled(deviations)[0],
            np.full(len(sizes), 0.5),
            method="Powell",
            bounds=[(0.0, _LARGEST_DEVIATION)] * len(sizes),
            options={"xtol": 1e-5, "ftol": 1e-10},
        )
        _, inverse, effects, variance = profiled(found.x)
    residual = scale**2 * variance
    return Fit(
        names=list(fixed),
        values=first + scale * effects,
        covariance=residual * inverse,
        freedom=freedom,
        model="linear mixed model (REML), random " + ", ".join(groups),
        variances=dict(zip(groups, (residual * found.x**2).tolist(), strict=True)) | {"residual": residual},
    )


def contrasts_of(
    family: Sequence[tuple[DeclaredMeasure, Sequence[Mapping[str, Any]]]],
    conditions: Sequence[str],
    *,
    within: bool,
) -> list[Contrast]:
    """All contrasts of measures that are decided together, with Holm's method over all of them.

    Args:
        family: Measures with their rows; see `drake_shared.study.tidy.values_of`.
        conditions: Their names; contrasts are of each with each later one.
        within: Whether participants meet all conditions.
    """
    found = []
    for declared, rows in family:
        pairs = list(itertools.combinations(conditions, 2))
        enough = all(
            len({row["participant"] for row in rows if row["condition"] == name}) >= 2 for name in conditions
        )
        fitted = fit(rows, within=within, share=is_share(declared.name)) if enough else None
        for one, other in pairs:
            mean, error = fitted.contrast({one: 1.0, other: -1.0}) if fitted else (math.nan, math.nan)
            found.append((declared, rows, one, other, mean, error, fitted))
    p = [
        _p(declared, mean, error, 1.0 if fitted is None else fitted.freedom)
        for declared, _, _, _, mean, error, fitted in found
    ]
    adjusted, levels = holm(p), holm_levels(p, level=1.0 - ALPHA)
    return [
        _contrast(*item, within=within, p=one_p, level=level)
        for item, one_p, level in zip(found, adjusted, levels, strict=True)
    ]


def trend(fitted: Fit) -> tuple[float, float, float] | None:
    """The change of a measure from place to place with its 95% interval; None if places are not modelled."""
    if "place" not in fitted.names:
        return None
    mean, error = fitted.contrast({"place": 1.0})
    half = float(stats.t.ppf(0.975, fitted.freedom)) * error
    return mean, mean - half, mean + half


def _p(declared: DeclaredMeasure, mean: float, error: float, freedom: float) -> float:
    if not math.isfinite(error):
        return 1.0
    if declared.hypothesis == "difference":
        return float(2.0 * stats.t.sf(abs(mean) / error, freedom))
    # Two one-sided tests (Schuirmann 1987).
    return float(stats.t.sf((declared.smallest_effect - abs(mean)) / error, freedom))


def _contrast(
    declared: DeclaredMeasure,
    rows: Sequence[Mapping[str, Any]],
    one: str,
    other: str,
    mean: float,
    error: float,
    fitted: Fit | None,
    *,
    within: bool,
    p: float,
    level: float,
) -> Contrast:
    if declared.hypothesis == "equivalence":
        level = 1.0 - 2.0 * (1.0 - level)
    half = math.nan if fitted is None else float(stats.t.ppf(0.5 + level / 2.0, fitted.freedom)) * error
    decided = "different" if declared.hypothesis == "difference" else "equivalent"
    effect, low, high = effect_size(rows, one, other, within=within)
    return Contrast(
        measure=declared,
        one=one,
        other=other,
        mean=mean,
        low=mean - half,
        high=mean + half,
        level=level,
        p=p,
        effect=effect,
        effect_low=low,
        effect_high=high,
        participants=len({row["participant"] for row in rows}),
        observations=len(rows),
        model="too few data" if fitted is None else fitted.model,
        verdict=decided if p <= ALPHA else "open",
    )


def effect_size(
    rows: Sequence[Mapping[str, Any]], one: str, other: str, *, within: bool
) -> tuple[float, float, float]:
    """Cohen's d_z (within) or d (between) of participants' means, with its 95% interval (noncentral t)."""
    means: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        means.setdefault((row["condition"], row["participant"]), []).append(row["value"])
    sides = [
        {who: float(np.mean(values)) for (name, who), values in means.items() if name == side}
        for side in (one, other)
    ]
    if within:
        sample = np.array([sides[0][who] - sides[1][who] for who in sides[0] if who in sides[1]])
        if len(sample) < 2 or sample.std(ddof=1) == 0.0:
            return math.nan, math.nan, math.nan
        effect, size, freedom = sample.mean() / sample.std(ddof=1), float(len(sample)), len(sample) - 1
    else:
        a, b = (np.array(list(side.values())) for side in sides)
        freedom = len(a) + len(b) - 2
        if min(len(a), len(b)) < 2:
            return math.nan, math.nan, math.nan
        pooled = math.sqrt(((len(a) - 1) * a.var(ddof=1) + (len(b) - 1) * b.var(ddof=1)) / freedom)
        if pooled == 0.0:
            return math.nan, math.nan, math.nan
        effect, size = (a.mean() - b.mean()) / pooled, len(a) * len(b) / (len(a) + len(b))
    root = math.sqrt(size)
    t = float(effect) * root

    low, high = (float(special.nctdtrinc(freedom, probability, t)) / root for probability in (0.975, 0.025))
    return float(effect), low, high


def is_share(name: str) -> bool:
    """Whether a measure is 0 or 1 in each trial."""
    return name in ("success", "intent_success", "collision", "timeout")
