"""The hyperparameters of a training, and the presets."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.demonstrations.weights import DEFAULT_WIDTH


@dataclass(frozen=True, kw_only=True)
class TrainingParameters:
    """How a CNMP is built and trained. The defaults are those of the preset "default".

    Lengths marked "relative" are in units of the spread of the demonstrations: the root of their mean
    variance about their mean path, over time and coordinates. So the size of the task does not matter.

    The defaults are measured: averaging codes rather than weighting them by their precision costs 0.1 nats on
    five observations, and a network of three layers of 128 is no better than this one at ten times the cost.

    Attributes:
        preset: Name that files and logs hold.
        iterations: Steps of the optimizer; with a loss threshold, the most of them.
        cycle: Steps of one cycle of the schedules of learning rate and floor. Each further cycle is twice as
            long as the last. None makes all iterations one cycle.
        batch: Demonstrations sampled in each.
        queries: Query points, sampled in each iteration and shared by its demonstrations.
        observations: Largest number m of observations of a sample; Alg. 1 draws n from 1..m.
        single_share: Share of each batch that has exactly one observation.
        noise: Standard deviation of the noise on observed positions, relative. Without it the learner tells
            routes apart by meaningless millimetres.
        blending: Demonstrations that stay within about this of each other are of one route; training samples
            new ones from among them, see `make_neighborhoods`. Relative; 0 turns it off.
        widening: Factor on the deviations of the new demonstrations from the mean of their route, which make
            up for there being few.
        wandering: Standard deviation, relative, of low-frequency noise on a path; of n demonstrations of a
            route a share of 1/n of its variance is added. 0 turns it off.
        harmonics: Fourier features of time, sin and cos of k pi t/T for k = 1..harmonics; 0 is raw time.
        centred: Whether positions are counted from the demonstrations' mean path.
        encoder: Widths of its layers; the last is the size of a code.
        aggregation: Of the codes of several observations, "mean" or "bayesian"; see
            `drake_shared.learners.cnmp.layers.aggregate`.
        decoder: Widths of its hidden layers.
        time_scale, position_scale: The network sees t/T, and each coordinate of a position, between plus and
            minus these, where they are given. The larger they are, the sooner it learns what changes quickly.
            The exported weights are for inputs that are not scaled.
        learning_rate: Of AdamW; with the schedule "one-cycle", its peak.
        schedule: "constant" or "one-cycle".
        beta: Of the beta-NLL loss (Seitzer et al. 2022); 0 is plain negative log-likelihood.
        plain_share: Last share of the iterations, which use the plain negative log-likelihood.
        weight_decay: Of AdamW.
        second_moment: Of AdamW, the decay of the mean square gradient.
        loss_threshold: Lt of Alg. 1: training stops when the running mean loss, in nats per point with
            positions in m, is below it; None turns it off.
        first_floor: Least standard deviation at the start of a cycle, relative. It falls exponentially to
            ``sigma_floor`` by ``floor_share`` of the cycle. 0 turns it off. Where the standard deviation is
            large, the gradient of the mean vanishes, and a network that learns large ones first gets stuck
            for 100,000 steps; a common floor weights all errors alike.
        floor_share: See ``first_floor``.
        patience: Share of the iterations without improvement after which training is cut short; 0 never.
        sigma_floor: Least standard deviation, in [m], or relative if ``relative_floor``.
        relative_floor: See ``sigma_floor``.
        score_width: Of the density Pd over the scores, in standard deviations of the scores.
        even_spread: Whether sigma is learnt from demonstrations sampled evenly, and the scores weight only
            the mean. Otherwise demonstrations are sampled by Pd, as in the paper.
        doubt_from, doubt_within: Distance from all demonstrations raises the variance beyond ``doubt_from``
            times the noise, and within ``doubt_within`` times the noise more makes the confidence 0.05; a
            ``doubt_within`` of 0 turns it off.
        clock, evidence: Metadata of the learner; see `drake_shared.learners.Learner`.
        restarts: How often training restarts, from other seeds, if the learner ignores observations.
    """

    preset: str = "default"
    iterations: int = 1_500
    cycle: int | None = None
    batch: int = 64
    queries: int = 16
    observations: int = 6
    single_share: float = 0.1
    noise: float = 0.27
    blending: float = 0.65
    widening: float = 1.25
    wandering: float = 0.07
    harmonics: int = 6
    centred: bool = True
    encoder: tuple[int, ...] = (64, 128)
    aggregation: str = "bayesian"
    decoder: tuple[int, ...] = (128,)
    time_scale: float | None = None
    position_scale: float | None = None
    learning_rate: float = 1.2e-2
    schedule: str = "one-cycle"
    beta: float = 0.5
    plain_share: float = 0.15
    weight_decay: float = 1e-2
    second_moment: float = 0.99
    loss_threshold: float | None = None
    patience: float = 0.3
    first_floor: float = 0.0
    floor_share: float = 0.6
    sigma_floor: float = 0.01
    relative_floor: bool = True
    score_width: float = DEFAULT_WIDTH
    even_spread: bool = True
    doubt_from: float = 3.0
    doubt_within: float = 1.5
    clock: str = "progress"
    evidence: str = "pose+command"
    restarts: int = 3

    def to_json(self) -> dict[str, Any]:
        """As a JSON object."""
        return {**dataclasses.asdict(self), "encoder": list(self.encoder), "decoder": list(self.decoder)}


PRESETS = {
    # Alg. 1 of Amirshirzad et al. 2022, with the network that public CNMP codes use. What the paper leaves
    # open is chosen so that training is short: with one sample a step, a constant rate and the final floor
    # from the start, the loss is still above -4 nats after 350,000 steps. Three cycles are the limit.
    "paper": TrainingParameters(
        preset="paper",
        iterations=84_000,
        cycle=12_000,
        batch=32,
        queries=8,
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
        time_scale=4.0,
        position_scale=6.0,
        learning_rate=3e-3,
        schedule="one-cycle",
        beta=0.0,
        plain_share=1.0,
        weight_decay=0.0,
        second_moment=0.99,
        loss_threshold=-6.0,
        patience=0.0,
        first_floor=6.0,
        relative_floor=False,
        even_spread=False,
        doubt_from=0.0,
        doubt_within=0.0,
        clock="time",
        evidence="pose",
        restarts=0,
    ),
    "default": TrainingParameters(),
}


def find_parameters(preset: str) -> TrainingParameters:
    """The parameters of a preset.

    Raises:
        InputError: There is no such preset.
    """
    if preset not in PRESETS:
        raise InputError("train", "preset", f"must be one of {', '.join(PRESETS)}", repr(preset))
    return PRESETS[preset]
