"""The analysis of studies: data with known answers, lme4, and studies without an effect."""

import itertools
import json
import math
import shutil
import subprocess

import nbformat
import numpy as np
import pandas as pd
import pytest
from scipy import stats

from drake_shared.cli.main import main
from drake_shared.study.design import DeclaredMeasure
from drake_shared.study.models import contrasts_of, effect_size, fit, trend
from drake_shared.study.protocol import plan, read_protocol

TIME = DeclaredMeasure(name="completion_time", smallest_effect=0.5)
SAME_LENGTH = DeclaredMeasure(name="path_length", smallest_effect=0.8, hypothesis="equivalence")
SUCCESS = DeclaredMeasure(name="success", smallest_effect=0.1)


def study(
    seed: int, *, effect: float = 0.0, learning: float = 0.0, slopes: float = 0.4, participants: int = 12
) -> list[dict]:
    """A balanced study of conditions a and b, three routes and two repeats; b is higher by ``effect``."""
    random = np.random.default_rng(seed)
    routes = random.normal(0.0, 0.5, 3)
    rows = []
    for participant in range(participants):
        skill, slope = random.normal(0.0, 1.0), random.normal(0.0, slopes)
        for place, condition in enumerate("ab" if participant % 2 else "ba"):
            for route in (0, 1, 2, 0, 1, 2):
                value = 10.0 + skill + routes[route] + learning * place + random.normal(0.0, 0.5)
                value += (effect + slope) * (condition == "b")
                keys = {"participant": f"P{participant:02d}", "condition": condition, "place": place}
                rows.append(keys | {"block": place + 1, "route": str(route), "value": value})
    return rows


def means(rows: list[dict], condition: str) -> np.ndarray:
    frame = pd.DataFrame(rows)
    return frame[frame["condition"] == condition].groupby("participant")["value"].mean().to_numpy()


def test_contrast_of_a_balanced_study_is_that_of_the_participants_means():
    rows = [row | {"place": 0} for row in study(1, effect=0.6)]
    (found,) = contrasts_of([(TIME, rows)], ["a", "b"], within=True)
    known = stats.ttest_rel(means(rows, "a"), means(rows, "b"))
    assert found.mean == pytest.approx((means(rows, "a") - means(rows, "b")).mean())
    assert found.p == pytest.approx(known.pvalue, rel=1e-3)
    interval = known.confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((interval.low, interval.high), rel=1e-3)
    assert found.verdict == "different"


def test_effect_of_order_is_found_and_does_not_bias_the_contrast():
    rows = study(2, effect=1.0, learning=-2.0)
    (found,) = contrasts_of([(TIME, rows)], ["a", "b"], within=True)
    assert found.low < -1.0 < found.high
    change = trend(fit(rows, within=True, share=False))
    assert change is not None
    assert change[1] < -2.0 < change[2]


def test_equivalence_is_claimed_only_inside_the_smallest_effect():
    near = contrasts_of([(SAME_LENGTH, study(3))], ["a", "b"], within=True)[0]
    far = contrasts_of([(SAME_LENGTH, study(3, effect=0.9))], ["a", "b"], within=True)[0]
    assert (near.verdict, far.verdict) == ("equivalent", "open")
    assert -0.8 < near.low < near.high < 0.8


def test_shares_are_compared_as_differences_of_shares():
    random = np.random.default_rng(4)
    rows = [
        row | {"value": float(random.random() < (0.9 if row["condition"] == "a" else 0.4)), "place": 0}
        for row in study(4)
    ]
    (found,) = contrasts_of([(SUCCESS, rows)], ["a", "b"], within=True)
    assert found.mean == pytest.approx((means(rows, "a") - means(rows, "b")).mean())
    assert found.verdict == "different"
    always = [row | {"value": 1.0} for row in rows]
    assert contrasts_of([(SUCCESS, always)], ["a", "b"], within=True)[0].verdict == "open"


@pytest.mark.parametrize("outcomes", list(itertools.product((0.0, 1.0), repeat=4)))
def test_two_participants_leave_a_share_undecided(outcomes):
    rows = [
        {"participant": who, "condition": condition, "place": place, "route": "0", "value": value}
        for (who, place, condition), value in zip(
            (("A", 0, "a"), ("A", 1, "b"), ("B", 0, "b"), ("B", 1, "a")), outcomes, strict=True
        )
    ]
    (found,) = contrasts_of([(SUCCESS, rows)], ["a", "b"], within=True)
    assert found.p == 1.0
    assert found.verdict == "open"


def test_holm_adjusts_over_all_contrasts_of_a_family():
    rows = study(5, effect=0.35)
    alone = contrasts_of([(TIME, rows)], ["a", "b"], within=True)[0].p
    family = [(TIME, rows), (DeclaredMeasure(name="path_length", smallest_effect=1.0), study(6))]
    together = contrasts_of(family, ["a", "b"], within=True)
    assert together[0].p == pytest.approx(min(1.0, 2.0 * alone))


def test_effect_size_is_that_of_cohen():
    rows = study(7, effect=0.8)
    difference = means(rows, "a") - means(rows, "b")
    effect, low, high = effect_size(rows, "a", "b", within=True)
    assert effect == pytest.approx(difference.mean() / difference.std(ddof=1))
    t = effect * math.sqrt(12)
    assert stats.nct.cdf(t, 11, low * math.sqrt(12)) == pytest.approx(0.975, abs=1e-4)
    assert stats.nct.cdf(t, 11, high * math.sqrt(12)) == pytest.approx(0.025, abs=1e-4)


def test_groups_are_compared_between_participants():
    rows = [
        row | {"place": 0}
        for row in study(8, effect=3.0, participants=24)
        if (row["condition"] == "a") == (int(row["participant"][1:]) < 12)
    ]
    (found,) = contrasts_of([(TIME, rows)], ["a", "b"], within=False)
    known = stats.ttest_ind(means(rows, "a"), means(rows, "b"))
    assert found.mean == pytest.approx(means(rows, "a").mean() - means(rows, "b").mean(), abs=1e-6)
    assert found.p == pytest.approx(known.pvalue, rel=0.05)


@pytest.mark.skipif(shutil.which("Rscript") is None, reason="needs R with lme4")
def test_mixed_model_agrees_with_lme4(tmp_path):
    # Without slopes the best variance of participants in conditions is often 0, where optimizers stop early.
    studies = [
        study(seed, effect=0.5, learning=0.2, slopes=slopes)
        for seed, slopes in [(9, 0.4), (9, 0.0), (10, 0.0), (11, 0.0)]
    ]
    studies.append([row for number, row in enumerate(studies[0]) if number % 7])  # With missing trials.
    for number, rows in enumerate(studies):
        pd.DataFrame(rows).to_csv(tmp_path / f"{number}.csv", index=False)
    code = f"""
    if (!requireNamespace("lme4", quietly = TRUE)) quit(status = 77)
    for (number in 0:{len(studies) - 1}) {{
      d <- read.csv(paste0("{tmp_path}/", number, ".csv"))
      d$place <- d$place - mean(d$place); d$route <- factor(d$route)
      m <- lme4::lmer(
        value ~ 0 + condition + place + (1|participant) + (1|route) + (1|participant:condition), d,
        control = lme4::lmerControl(optCtrl = list(xtol_abs = 1e-10, ftol_abs = 1e-12)))
      v <- as.matrix(vcov(m)); l <- c(1, -1, 0)
      cat(sum(l * lme4::fixef(m)), sqrt(t(l) %*% v %*% l), lme4::fixef(m)[3], "\\n")
    }}"""
    ran = subprocess.run(["Rscript", "-e", code], capture_output=True, text=True)
    if ran.returncode == 77:
        pytest.skip("needs R with lme4")
    for rows, line in zip(studies, ran.stdout.splitlines(), strict=True):
        mean, error, place = map(float, line.split())
        found = fit(rows, within=True, share=False)
        assert found.contrast({"a": 1.0, "b": -1.0}) == pytest.approx((mean, error), rel=1e-4, abs=1e-6)
        assert found.contrast({"place": 1.0})[0] == pytest.approx(place, rel=1e-4, abs=1e-6)


def test_studies_without_an_effect_seldom_report_one():
    # The full number is run by scripts/study_errors.
    reported = sum(
        any(
            item.verdict != "open" for item in contrasts_of([(TIME, study(100 + n))], ["a", "b"], within=True)
        )
        for n in range(40)
    )
    assert reported <= stats.binom.ppf(0.999, 40, 0.05)


def test_report_is_self_contained_and_carries_the_protocol(small, capsys):
    plan(small)
    assert main(["study", "run", str(small), "--simulate", "4"]) == 0
    capsys.readouterr()
    assert main(["study", "analyze", str(small), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["primary"]) == 2
    assert found["checks"]["missing trials"].startswith("0 of 24")
    page = (small / "report" / "report.html").read_text()
    assert read_protocol(small)["hash"] in page
    assert "<svg" in page
    assert "src=" not in page
    trials = pd.read_csv(small / "report" / "data" / "trials.csv")
    again = pd.read_parquet(small / "report" / "data" / "trials.parquet")
    assert len(trials) == len(again) == 4 * 7
    assert (trials["excluded"] == "practice").sum() == 4
    nbformat.validate(nbformat.read(small / "report" / "analysis.ipynb", as_version=4))
    assert main(["study", "status", str(small), "--json"]) == 0
    status = json.loads(capsys.readouterr().out)
    assert {found["next"] for found in status["participants"].values()} == {None}


def test_a_study_without_trials_is_not_analysed(small, capsys):
    plan(small)
    assert main(["study", "analyze", str(small)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
