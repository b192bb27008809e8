"""What defines a training: the presets, and what each of their parameters does."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from drake_shared.errors import InputError


@dataclass(frozen=True, kw_only=True)
class TrainingParameters:
    """How a CNMP is built and trained.

    Lengths marked "relative" are in units of the spread of the demonstrations: the root of their mean
    variance about their mean path, over time and over x and y. So a room of 1 m and one of 50 m are the same.

    Attributes:
        preset: Name under which files and logs mention it.
        iterations: Steps of the optimiser.
        batch: Demonstrations drawn for each.
        queries: Query points of each of them, drawn anew for each iteration; 0 is the whole grid.
        observations: Largest number m of observations of a sample; Alg. 1 draws n from 1..m.
        single_share: Share of each batch that gets exactly one observation.
        noise: Standard deviation of the noise on observed positions, relative.
        harmonics: Fourier features of time, sin and cos of k pi t/T for k = 1..harmonics; 0 is raw time.
        centred: Whether the network sees and predicts deviations from the demonstrations' mean path.
        encoder, decoder: Widths of the hidden layers; the last of the encoder is the representation.
        learning_rate: Of Adam; where ``schedule`` is "one-cycle", its peak.
        schedule: "constant" or "one-cycle".
        beta: Of the beta-NLL loss (Seitzer et al. 2022); 0 is plain negative log-likelihood.
        plain_share: Last share of the iterations, which go by the plain negative log-likelihood.
        weight_decay: Of AdamW.
        loss_threshold: Lt of Alg. 1: training stops once the running mean loss, in nats per point with
            positions in m, is below it; None never stops.
        sigma_floor: Least standard deviation, in [m], relative if ``relative_floor``; the same for x and y.
        relative_floor: Says in which unit the floor is.
        even_spread: Whether sigma is learnt from demonstrations drawn evenly while the mean leans to the
            better ones. If not, Pd decides which demonstrations are drawn, as in the paper.
        distance_gain: How steeply distance from all demonstrations raises the variance; 0 never.
        clock: What consumers are to take as the time of an observation: "time" or "progress".
        restarts: How often a learner that ignores what it is shown is begun again from another seed.
    """

    preset: str
    iterations: int
    batch: int
    queries: int
    observations: int
    single_share: float
    noise: float
    harmonics: int
    centred: bool
    encoder: tuple[int, ...]
    decoder: tuple[int, ...]
    learning_rate: float
    schedule: str
    beta: float
    plain_share: float
    weight_decay: float
    loss_threshold: float | None
    sigma_floor: float
    relative_floor: bool
    even_spread: bool
    distance_gain: float
    clock: str
    restarts: int

    def to_json(self) -> dict[str, Any]:
        """As JSON can hold it."""
        return {**dataclasses.asdict(self), "encoder": list(self.encoder), "decoder": list(self.decoder)}


PRESETS = {
    # To the letter of Alg. 1 of Amirshirzad et al. 2022, with the network that public CNMP codes use.
    "paper": TrainingParameters(
        preset="paper",
        iterations=12_000,
        batch=1,
        queries=1,
        observations=5,
        single_share=0.0,
        noise=0.0,
        harmonics=0,
        centred=False,
        encoder=(128, 128, 128),
        decoder=(128, 128),
        learning_rate=3e-4,
        schedule="constant",
        beta=0.0,
        plain_share=1.0,
        weight_decay=0.0,
        loss_threshold=-6.0,
        sigma_floor=0.01,
        relative_floor=False,
        even_spread=False,
        distance_gain=0.0,
        clock="time",
        restarts=0,
    ),
    "default": TrainingParameters(
        preset="default",
        iterations=2_000,
        batch=64,
        queries=32,
        observations=6,
        single_share=0.5,
        noise=0.2,
        harmonics=6,
        centred=True,
        encoder=(128, 128, 128),
        decoder=(128, 128),
        learning_rate=3e-3,
        schedule="one-cycle",
        beta=0.5,
        plain_share=1.0 / 3.0,
        weight_decay=1e-4,
        loss_threshold=None,
        sigma_floor=0.01,
        relative_floor=True,
        even_spread=True,
        distance_gain=25.0,
        clock="progress",
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
