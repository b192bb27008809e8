"""What each figure means: its unit, which way is better, and its definition in one sentence."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType

HIGHER, LOWER = "higher", "lower"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Measure:
    """A figure.

    Attributes:
        unit: Empty for a number without one; "share" for one from 0 to 1. Measures of commands have the unit
            of wheels here; see `unit_for`.
        better: "higher", "lower", "near VALUE", or empty if neither is better.
        meaning: One sentence.
    """

    unit: str = ""
    better: str = ""
    meaning: str

    @property
    def direction(self) -> str:
        """Which way is better, as a phrase."""
        return f"{self.better} is better" if self.better else "describes, does not judge"

    def unit_for(self, command_unit: str) -> str:
        """The unit for a robot with commands in ``command_unit``, such as "m/s"."""
        return {"rad/s": command_unit, "rad": command_unit.removesuffix("/s")}.get(self.unit, self.unit)


OF_TRIALS: Mapping[str, Measure] = MappingProxyType(
    {
        "success": Measure(unit="share", better=HIGHER, meaning="A goal reached by T, without contact."),
        "intent_success": Measure(
            unit="share",
            better=HIGHER,
            meaning="Success at the goal of the route that the operator meant, and past every obstacle "
            "between start and that goal on the route's side; for a person, of the route instructed.",
        ),
        "wrong_goal": Measure(
            unit="share",
            better=LOWER,
            meaning="The robot reached another goal than that of the route that the operator meant.",
        ),
        "collision": Measure(unit="share", better=LOWER, meaning="The robot touched an obstacle."),
        "timeout": Measure(
            unit="share", better=LOWER, meaning="The time was over before the goal was reached."
        ),
        "completion_time": Measure(
            unit="s",
            better=LOWER,
            meaning="From the first command of the human to the goal, in trials that reached it: a mean is "
            "over successes, and a late start costs nothing.",
        ),
        "human_effort": Measure(
            unit="rad",
            better=LOWER,
            meaning="Integral over time of the norm of the human command (Javdani et al. 2018). For wheels "
            "it is nearly proportional to the path length, with help or without, and so hardly measures "
            "relief.",
        ),
        "excess_effort": Measure(
            unit="rad",
            better=LOWER,
            meaning="The same less that of the shared command, which the path needs.",
        ),
        "input_work": Measure(
            unit="rad/s",
            better=LOWER,
            meaning="Sum of the norms of the changes of the human command from step to step.",
        ),
        "corrections": Measure(
            better=LOWER,
            meaning="Turning points of the human command that stand out by over 5% of its limit, mean over "
            "its elements.",
        ),
        "mean_human_weight": Measure(
            meaning="Mean of w. A property of the arbiter, not of the human; the paper uses it as effort."
        ),
        "human_weight_variance": Measure(meaning="Variance of w over time."),
        "intervention_share": Measure(
            unit="share",
            better=LOWER,
            meaning="Share of the time in which the human gives a command (arXiv 2204.07026).",
        ),
        "disagreement": Measure(
            unit="rad/s",
            better=LOWER,
            meaning="Sum over steps of the absolute difference of human and autonomous command: the paper's "
            "measure. It grows with the number of steps: compare it at one period and duration only.",
        ),
        "disagreement_rate": Measure(
            unit="rad/s",
            better=LOWER,
            meaning="The same, averaged over time: comparable between trials of different lengths.",
        ),
        "saturated_share": Measure(
            unit="share", meaning="Share of steps at which a command is at the limit of the wheels."
        ),
        "dissimilarity": Measure(
            unit="rad/s", better=LOWER, meaning="Mean norm of human minus shared command."
        ),
        "agreement": Measure(
            unit="-1 to 1",
            better=HIGHER,
            meaning="Mean cosine between human and autonomous command, where both are not zero (arXiv "
            "2103.03453).",
        ),
        "agreement_share": Measure(unit="share", meaning="Share of steps for which `agreement` is defined."),
        "command_continuity": Measure(
            unit="rad/s", better=LOWER, meaning="Largest change of the shared command in one step."
        ),
        "weight_continuity": Measure(better=LOWER, meaning="Largest change of w in one step."),
        "path_length": Measure(unit="m", better=LOWER, meaning="Length of the path driven."),
        "clearance": Measure(
            unit="m", better=HIGHER, meaning="Least distance from the robot's body to an obstacle."
        ),
        "mean_clearance": Measure(
            unit="m", better=HIGHER, meaning="Mean distance from the robot's body to the nearest obstacle."
        ),
        "smoothness": Measure(
            better=HIGHER,
            meaning="SPARC, the spectral arc length of the speed; negative, closer to 0 is smoother "
            "(Balasubramanian et al. 2015).",
        ),
        "safety_change": Measure(
            unit="rad/s",
            better=LOWER,
            meaning="Mean norm of what the safety filter changed; only with a filter.",
        ),
        "safety_share": Measure(
            unit="share", better=LOWER, meaning="Share of steps that it changed; only with a filter."
        ),
        "plane_switches": Measure(
            better=LOWER,
            meaning="Number of switches between the planes x-y and y-z (Herlant et al. 2016); only with an "
            "arm.",
        ),
    }
)
"""Of the metrics of trials, in their order."""

OF_LEARNERS: Mapping[str, Measure] = MappingProxyType(
    {
        "nll": Measure(
            unit="nats",
            better=LOWER,
            meaning="Negative log-likelihood of the true positions, as a density per m².",
        ),
        "ade": Measure(
            unit="m",
            better=LOWER,
            meaning="Average displacement error: mean distance between prediction and truth.",
        ),
        "fde": Measure(
            unit="m", better=LOWER, meaning="Final displacement error: the same at the last time."
        ),
        "crps": Measure(
            unit="m",
            better=LOWER,
            meaning="Continuous ranked probability score (Gneiting and Raftery 2007).",
        ),
        "coverage50": Measure(
            unit="share",
            better="near 0.5",
            meaning="Share of the coordinates of true positions inside their predicted central 50% interval.",
        ),
        "coverage90": Measure(
            unit="share",
            better="near 0.9",
            meaning="Share of the coordinates of true positions inside their predicted central 90% interval.",
        ),
        "coverage95": Measure(
            unit="share",
            better="near 0.95",
            meaning="Share of the coordinates of true positions inside their predicted central 95% interval.",
        ),
        "coverage50_of_points": Measure(
            unit="share",
            better="near 0.5",
            meaning="Share of true positions inside the predicted 50% ellipse.",
        ),
        "coverage90_of_points": Measure(
            unit="share",
            better="near 0.9",
            meaning="Share of true positions inside the predicted 90% ellipse.",
        ),
        "coverage95_of_points": Measure(
            unit="share",
            better="near 0.95",
            meaning="Share of true positions inside the predicted 95% ellipse.",
        ),
        "coverage50_of_paths": Measure(
            unit="share",
            meaning="Share of observations after which all later positions are inside their 50% ellipses.",
        ),
        "coverage90_of_paths": Measure(
            unit="share",
            meaning="Share of observations after which all later positions are inside their 90% ellipses.",
        ),
        "coverage95_of_paths": Measure(
            unit="share",
            meaning="Share of observations after which all later positions are inside their 95% ellipses.",
        ),
        "scale": Measure(
            better="near 1",
            meaning="Factor on all predicted standard deviations that makes the errors likeliest.",
        ),
        "expected_calibration_error": Measure(
            better=LOWER,
            meaning="Mean difference between c_f and the share of steps in which the agent expected the "
            "right route, in ten bins of c_f of equal width. The prediction is the one in use, with the "
            "command as evidence. Unless it was calibrated, c_f is no probability: half of the steps may be "
            "above 0.99.",
        ),
        "brier_score": Measure(
            better=LOWER,
            meaning="Mean squared difference between c_f and 1 or 0 for a right or wrong prediction; "
            "without bins.",
        ),
        "confidence_ranking": Measure(
            better=HIGHER,
            meaning="Area under the ROC curve: how well c_f ranks right above wrong predictions, whatever "
            "its scale.",
        ),
        "confident_and_wrong": Measure(
            unit="share",
            better=LOWER,
            meaning="Steps with c_f above 0.8 in which the agent expected another route.",
        ),
        "online_coverage": Measure(
            unit="share",
            better="near 0.9",
            meaning="Positions 1 s later that adaptive conformal intervals cover in both coordinates.",
        ),
        "learner_coverage": Measure(
            unit="share",
            better="near 0.9",
            meaning="The same with the learner's own 90% intervals.",
        ),
        "weight_where_ambiguous": Measure(
            better=HIGHER,
            meaning="Mean w where another demonstrated route is within 0.15 m at equal progress.",
        ),
        "weight_where_clear": Measure(better=LOWER, meaning="Mean w elsewhere."),
        "ambiguity_ranking": Measure(
            better=HIGHER,
            meaning="Area under the ROC curve: how well w ranks ambiguous steps above clear ones. "
            "Demonstrations decide both, so this checks the implementation.",
        ),
        "ambiguity_ranking_of_time": Measure(
            meaning="The same for the remaining time in place of w: what a clock alone achieves."
        ),
        "decision_ranking": Measure(
            better=HIGHER,
            meaning="Area under the ROC curve for steps in which the route is open: another route of the "
            "scenario is within 0.15 m and passes an obstacle ahead on the other side. All steps count.",
        ),
        "decision_ranking_of_time": Measure(
            meaning="The same for the remaining time in place of w: what a clock alone achieves."
        ),
    }
)
"""Of the evaluation of a learner, in their order."""


def measure(name: str) -> Measure | None:
    """The measure of that name; None if there is none."""
    return OF_TRIALS.get(name) or OF_LEARNERS.get(name)
