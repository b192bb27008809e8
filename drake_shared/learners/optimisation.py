"""One training from one seed: iterations, learning rate, and when to stop."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from drake_shared.errors import RunError
from drake_shared.learners.cnmp import CnmpLearner
from drake_shared.learners.cnmp_model import CnmpModel
from drake_shared.learners.dataset import Dataset, normalisation
from drake_shared.learners.features import time_features
from drake_shared.learners.loss import beta_nll
from drake_shared.learners.network import CnmpNetwork
from drake_shared.learners.parameters import TrainingParameters
from drake_shared.learners.sampling import Batch, Sampler, hold_out

Progress = Callable[[int, int, float], None]
"""Takes the iterations done, those planned, and the running mean loss in nats per point."""

LEAST_NOISE = 0.05
"""Relative; for lengths that are counted in the noise, where there is none."""
RISE = 0.1
"""Share of a one-cycle schedule in which the learning rate rises."""
CHECKS = 50
"""How often in a training progress is judged."""
LEAST_PROGRESS = 0.02
"""Less than this, in nats per point, is none."""
JUDGED = 256
"""Progress is judged by so many samples of demonstrations that are held out, if any are."""
CLOSING = 0.2
"""Share of the plan that is left to a training that is cut short, for the learning rate to fall."""


class Optimisation:
    """A network, what it is taught, and how far it is.

    Attributes:
        planned: Iterations, at the beginning of the run.
        iterations: Done so far.
        held_out: How many demonstrations only judge.
        losses: Pairs of iteration and running mean loss, in nats per point with positions in m.
        ignores_observations: Whether it was found to predict the same whatever it is shown.

    Args:
        dataset: What to learn; a tenth of it is only judged by if there are demonstrations enough.
        parameters: How.
        seed: Of the first weights and of all that is drawn.
    """

    def __init__(self, dataset: Dataset, parameters: TrainingParameters, seed: int) -> None:
        self.dataset, self.parameters, self.seed = dataset, parameters, seed
        self.scale, self.reference = normalisation(dataset, centred=parameters.centred)
        self.planned = self.iterations = 0
        self.losses: list[list[float]] = []
        self.ignores_observations = False
        features = time_features(dataset.grid, float(dataset.grid[-1]), parameters.harmonics)
        self._features = torch.tensor(features, dtype=torch.float32)
        self._floor = parameters.sigma_floor
        if parameters.relative_floor:
            self._floor *= dataset.spread
        paths = (dataset.positions - self.reference) / self.scale
        self._paths = torch.tensor(paths, dtype=torch.float32)
        held_out = hold_out(len(paths), seed) & (parameters.patience > 0.0)
        self.held_out = int(held_out.sum())
        self._sampler = self._make_sampler(paths, ~held_out, parameters)
        self._judge: Batch | None = None
        if self.held_out:
            plain = dataclasses.replace(parameters, batch=JUDGED, blending=0.0, even_spread=True)
            self._judge = self._make_sampler(paths, held_out, plain).draw()
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self._network = CnmpNetwork(
                features=self._features.shape[1],
                encoder=parameters.encoder,
                aggregation=parameters.aggregation,
                decoder=parameters.decoder,
            )
        self._optimiser = torch.optim.AdamW(
            self._network.parameters(),
            lr=parameters.learning_rate,
            betas=(0.9, parameters.second_moment),
            weight_decay=parameters.weight_decay,
            fused=True,
        )

    def run(self, *, deadline: float | None, progress: Progress | None, may_give_up: bool) -> None:
        """Trains until the plan is done, the loss is below Lt, nothing improves or time is over.

        Args:
            deadline: By `time.perf_counter`; plans the iterations in place of the parameters'.
            progress: Called some 200 times.
            may_give_up: Whether to stop at a quarter of the plan if observations are ignored.

        Raises:
            RunError: The loss became NaN or infinite.
        """
        p = self.parameters
        planned = total = p.iterations if deadline is None else self._plan(deadline)
        self.planned = planned
        every, check = max(1, planned // 200), max(1, planned // CHECKS)
        # A mean over some 2,000 points, whatever the batch: one query's loss says little.
        memory = max(10.0, 2_000.0 / (p.batch * p.queries))
        unit = 2.0 * math.log(self.scale)
        running, best, best_at, begun = 0.0, math.inf, 0, time.perf_counter()
        lately = 0.0  # Sum over the iterations since progress was judged.
        for iteration in range(planned):
            fraction = iteration / total
            for group in self._optimiser.param_groups:
                group["lr"] = p.learning_rate * self._rate(fraction)
            nll = self._step(fraction) + unit
            if not math.isfinite(nll):
                raise RunError(f"training diverged: the loss is {nll} after {iteration} iterations")
            running += (nll - running) / min(iteration + 1.0, memory)
            lately += nll
            self.iterations = iteration + 1
            if iteration % every == 0 or iteration + 1 == total:
                self.losses.append([iteration + 1, round(running, 4)])
                if progress is not None:
                    progress(iteration + 1, total, running)
            if p.loss_threshold is not None and iteration > memory and running <= p.loss_threshold:
                break
            if may_give_up and iteration == planned // 4:
                self.ignores_observations = self._ignores()
                if self.ignores_observations:
                    return
            if deadline is not None and iteration % 10 == 9:
                now = time.perf_counter()
                left = int((deadline - now) * (iteration + 1) / (now - begun))
                if iteration + 1 + left < 0.98 * total:
                    total = iteration + 1 + max(left, 0)
            if p.patience > 0.0 and iteration % check == check - 1:
                judged = lately / check if self._judge is None else self._judged() + unit
                lately = 0.0
                if judged < best - LEAST_PROGRESS:
                    best, best_at = judged, iteration
                elif iteration - best_at > p.patience * planned:
                    total = min(total, iteration + 1 + int(CLOSING * planned))
                    best_at = planned
            if iteration + 1 >= total:
                break
        self.ignores_observations = self._ignores()

    def export(
        self, *, confidence_gain: float, metadata: Mapping[str, Any], doubtful: float | None = None
    ) -> CnmpLearner:
        """The learner as it is now.

        Args:
            confidence_gain: K of eq. (1), in [1/m^2].
            metadata: For its file.
            doubtful: Variance that leaves hardly any confidence, in [m^2]; default: the demonstrations' own.
        """
        p, dataset = self.parameters, self.dataset
        noise = max(p.noise, LEAST_NOISE) * dataset.spread
        doubt_gain = 0.0
        if p.doubt_within > 0.0:
            doubt_gain = (doubtful or dataset.spread**2) / (p.doubt_within * noise) ** 2
        encoder, decoder = self._network.export()
        model = CnmpModel(
            preset=p.preset,
            encoder=encoder,
            aggregation=p.aggregation,
            decoder=decoder,
            harmonics=p.harmonics,
            grid=dataset.grid,
            reference=self.reference,
            scale=self.scale,
            sigma_floor=self._floor,
            demonstrations=dataset.positions,
            weights=dataset.weights,
            doubt_reach=p.doubt_from * noise or dataset.spread,
            doubt_gain=doubt_gain,
            confidence_gain=confidence_gain,
            metadata=metadata,
        )
        return CnmpLearner(model)

    def _make_sampler(
        self, paths: NDArray[np.float64], chosen: NDArray[np.bool_], parameters: TrainingParameters
    ) -> Sampler:
        weights = self.dataset.weights[chosen]
        return Sampler(
            paths=paths[chosen],
            features=self._features,
            weights=weights / weights.sum(),
            unit=self.dataset.spread / self.scale,
            parameters=parameters,
            seed=self.seed,
        )

    def _step(self, fraction: float) -> float:
        """One iteration; the negative log-likelihood per point in normalised units."""
        p = self.parameters
        beta = 0.0 if fraction >= 1.0 - p.plain_share else p.beta
        loss, nll = self._loss(self._sampler.draw(), beta)
        self._optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self._optimiser.step()
        return float(nll)

    def _loss(self, batch: Batch, beta: float) -> tuple[Tensor, Tensor]:
        mean, spread = self._network(batch.observations, batch.owners, batch.queries)
        sigma = spread + self._floor / self.scale
        return beta_nll(mean, sigma, batch.truth, lean=batch.lean, beta=beta)

    def _judged(self) -> float:
        """Negative log-likelihood per point of what is held out, in normalised units."""
        assert self._judge is not None
        with torch.no_grad():
            return float(self._loss(self._judge, 0.0)[1])

    def _rate(self, fraction: float) -> float:
        """The learning rate, relative to its peak, after a fraction of the plan."""
        if self.parameters.schedule == "constant":
            return 1.0
        if fraction < RISE:
            return 0.05 + 0.95 * fraction / RISE
        return 0.5 * (1.0 + math.cos(math.pi * (fraction - RISE) / (1.0 - RISE))) + 1e-4

    def _plan(self, deadline: float) -> int:
        """How many iterations there is time for, found on a training that is then thrown away."""
        trial = Optimisation(self.dataset, self.parameters, self.seed)
        spent: list[float] = []
        begun = time.perf_counter()
        while len(spent) < 80 and (not spent or time.perf_counter() < begun + 0.05 * (deadline - begun)):
            start = time.perf_counter()
            trial._step(0.0)
            spent.append(time.perf_counter() - start)
        # The first are slow, and a plan that is too long is cut; one that is too short wastes time.
        return max(1, int((deadline - time.perf_counter()) / float(np.percentile(spent, 25))))

    def _ignores(self) -> bool:
        """Whether it predicts the same whatever it is shown, where the demonstrations lie apart."""
        strays = np.square(self.dataset.positions - self.dataset.mean_path).mean(axis=(0, 2))
        if len(self._paths) < 2 or strays.mean() < (0.01 * self.dataset.extent) ** 2:
            return False  # There is nothing to tell apart.
        step = int(strays.argmax())
        shown = self._paths[:, step]
        observations = torch.cat([self._features[step].expand(len(shown), -1), shown], dim=-1)
        with torch.no_grad():
            mean, _ = self._network(observations, torch.arange(len(shown)), self._features)
        said = float((mean - mean.mean(dim=0)).square().mean())
        there = float((self._paths - self._paths.mean(dim=0)).square().mean())
        return said < 0.1 * there
