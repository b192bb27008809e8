"""What defines a training: the presets, and what each of their parameters does."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from drake_shared.common.errors import InputError


@dataclass(frozen=True, kw_only=True)
class TrainingParameters:
    """How a CNMP is built and trained.

    Lengths marked "relative" are in units of the spread of the demonstrations: the root of their mean
    variance about their mean path, over time and over x and y. So a room of 1 m and one of 50 m are the same.

    Attributes:
        preset: Name under which files and logs mention it.
        iterations: Steps of the optimiser.
        batch: Demonstrations drawn for each.
        queries: Query points, drawn anew for each iteration and shared by its demonstrations.
        observations: Largest number m of observations of a sample; Alg. 1 draws n from 1..m.
        single_share: Share of each batch that gets exactly one observation whatever was drawn.
        noise: Standard deviation of the noise on observed positions, relative. Without it the learner tells
            routes apart by millimetres that mean nothing.
        blending: Demonstrations that stay within about this of each other are one way, and what lies between
            them is as well: training draws new ones from among them; see `make_blend`. Relative; 0 never.
        widening: How much further than the demonstrations themselves the new ones stray from their mean: what
            comes varies more than the few that were seen. A factor.
        wandering: How far, relative, drives of one way stray from each other as long as demonstrations do not
            tell: of n on a way, a share of 1/n of this variance is left. 0 believes the demonstrations alone.
        harmonics: Fourier features of time, sin and cos of k pi t/T for k = 1..harmonics; 0 is raw time.
        centred: Whether the network sees and predicts deviations from the demonstrations' mean path.
        encoder: Widths of its layers; the last is the size of a code.
        aggregation: Of the codes of several observations: "mean", or "bayesian", where half of each code is
            its precision (Volpp et al. 2021, Bayesian context aggregation).
        decoder: Widths of its hidden layers.
        learning_rate: Of AdamW; where ``schedule`` is "one-cycle", its peak.
        schedule: "constant" or "one-cycle".
        beta: Of the beta-NLL loss (Seitzer et al. 2022); 0 is plain negative log-likelihood.
        plain_share: Last share of the iterations, which go by the plain negative log-likelihood.
        weight_decay: Of AdamW.
        second_moment: Of AdamW, the decay of the mean square gradient.
        loss_threshold: Lt of Alg. 1: training stops once the running mean loss, in nats per point with
            positions in m, is below it; None never stops.
        patience: Share of the iterations without progress after which the rest is cut short; 0 never is.
        sigma_floor: Least standard deviation, in [m], relative if ``relative_floor``; the same for x and y.
        relative_floor: Says in which unit the floor is.
        even_spread: Whether sigma is learnt from demonstrations drawn evenly while the mean leans to the
            better ones. If not, Pd decides which demonstrations are drawn, as in the paper.
        doubt_from, doubt_within: Distance from all demonstrations raises the variance beyond so many times
            the noise, and within so many more makes the confidence 0.05; 0 never does.
        clock: What consumers are to take as the time of an observation: "time" or "progress".
        evidence: What they are to show the learner: "pose" or "pose+command".
        restarts: How often a learner that ignores what it is shown is begun again from another seed.
    """

    preset: str
    iterations: int
    batch: int
    queries: int
    observations: int
    single_share: float
    noise: float
    blending: float
    widening: float
    wandering: float
    harmonics: int
    centred: bool
    encoder: tuple[int, ...]
    aggregation: str
    decoder: tuple[int, ...]
    learning_rate: float
    schedule: str
    beta: float
    plain_share: float
    weight_decay: float
    second_moment: float
    loss_threshold: float | None
    patience: float
    sigma_floor: float
    relative_floor: bool
    even_spread: bool
    doubt_from: float
    doubt_within: float
    clock: str
    evidence: str
    restarts: int

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        return {**dataclasses.asdict(self), "encoder": list(self.encoder), "decoder": list(self.decoder)}


PRESETS = {
    # To the letter of Alg. 1 of Amirshirzad et al. 2022, with the network that public CNMP codes use.
    "paper": TrainingParameters(
        preset="paper",
        iterations=15_000,
        batch=1,
        queries=1,
        observations=5,
        single_share=0.0,
        noise=0.0,
        blending=0.0,
        widening=1.0,
        wandering=0.0,
        harmonics=0,
        centred=False,
        encoder=(128, 128, 128),
        aggregation="mean",
        decoder=(128, 128),
        learning_rate=1e-3,
        schedule="constant",
        beta=0.0,
        plain_share=1.0,
        weight_decay=0.0,
        second_moment=0.999,
        loss_threshold=-6.0,
        patience=0.0,
        sigma_floor=0.01,
        relative_floor=False,
        even_spread=False,
        doubt_from=0.0,
        doubt_within=0.0,
        clock="time",
        evidence="pose",
        restarts=0,
    ),
    # Measured; a code averaged rather than weighed by its precision costs 0.1 nats on five observations, and
    # a network of three layers of 128 is no better than this one while it takes ten times as long.
    "default": TrainingParameters(
        preset="default",
        iterations=1_500,
        batch=64,
        queries=16,
        observations=6,
        single_share=0.1,
        noise=0.27,
        blending=0.65,
        widening=1.25,
        wandering=0.07,
        harmonics=6,
        centred=True,
        encoder=(64, 128),
        aggregation="bayesian",
        decoder=(128,),
        learning_rate=1.2e-2,
        schedule="one-cycle",
        beta=0.5,
        plain_share=0.15,
        weight_decay=1e-2,
        second_moment=0.99,
        loss_threshold=None,
        patience=0.3,
        sigma_floor=0.01,
        relative_floor=True,
        even_spread=True,
        doubt_from=3.0,
        doubt_within=1.5,
        clock="progress",
        evidence="pose+command",
        restarts=3,
    ),
}


def find_parameters(preset: str) -> TrainingParameters:
    """The parameters of a preset.

    Raises:
        InputError: There is none of that name.
    """
    if preset not in PRESETS:
        raise InputError("train", "preset", f"must be one of {', '.join(PRESETS)}", repr(preset))
    return PRESETS[preset]
