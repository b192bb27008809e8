"""One training of learners side by side: iterations, learning rate, and when to stop."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from drake_shared.common.errors import RunError
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.loss import beta_nll
from drake_shared.learners.cnmp.model import CnmpModel
from drake_shared.learners.cnmp.network import CnmpNetwork
from drake_shared.learners.cnmp.parameters import TrainingParameters
from drake_shared.learners.cnmp.sampling import Batch, Lesson, Sampler, hold_out
from drake_shared.learners.cnmp.time_features import time_features
from drake_shared.learners.dataset import Dataset, normalisation

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
    """Networks of one shape, what each is taught, and how far they are.

    They are trained side by side, in one batched computation and by one plan: each learner by its own
    demonstrations, from its own seed, with its own loss.

    Attributes:
        planned: Iterations, at the beginning of the run.
        iterations: Done so far by each learner; one whose loss fell below Lt has stopped.
        held_out: How many demonstrations of each only judge.
        losses: Of each learner, pairs of iteration and running mean loss, in nats per point with positions
            in m.
        ignores_observations: Whether each was found to predict the same whatever it is shown.

    Args:
        datasets: What each is to learn, all on grids of as many steps; a tenth is only judged by if there are
            demonstrations enough.
        parameters: How.
        seeds: Of the first weights and of what is drawn for each.
    """

    def __init__(
        self, datasets: Sequence[Dataset], parameters: TrainingParameters, seeds: Sequence[int]
    ) -> None:
        self.datasets, self.parameters, self.seeds = list(datasets), parameters, list(seeds)
        steps = {len(dataset.grid) for dataset in datasets}
        if len(steps) != 1 or len(seeds) != len(datasets):
            raise ValueError(f"needs datasets of as many steps and as many seeds, got {steps}, {len(seeds)}")
        self._scales, self._references = zip(
            *(normalisation(dataset, centred=parameters.centred) for dataset in datasets), strict=True
        )
        count = len(self.datasets)
        self.planned = 0
        self.iterations = [0] * count
        self.losses: list[list[list[float]]] = [[] for _ in range(count)]
        self.ignores_observations = [False] * count
        grid = datasets[0].grid
        features = time_features(grid, float(grid[-1]), parameters.harmonics)
        self._features = torch.tensor(features, dtype=torch.float32)
        self._floors = [
            parameters.sigma_floor * (dataset.spread if parameters.relative_floor else 1.0)
            for dataset in datasets
        ]
        relative = [floor / scale for floor, scale in zip(self._floors, self._scales, strict=True)]
        self._least_sigma = torch.tensor(relative, dtype=torch.float32)[:, None, None, None]
        self._paths = [
            (dataset.positions - reference) / scale
            for dataset, reference, scale in zip(datasets, self._references, self._scales, strict=True)
        ]
        held_out = [
            hold_out(len(paths), seed) & (parameters.patience > 0.0)
            for paths, seed in zip(self._paths, seeds, strict=True)
        ]
        if not all(chosen.any() for chosen in held_out):
            held_out = [np.zeros_like(chosen) for chosen in held_out]
        self.held_out = [int(chosen.sum()) for chosen in held_out]
        self._sampler = self._make_sampler([~chosen for chosen in held_out], parameters)
        self._judge: Batch | None = None
        if self.held_out[0]:
            plain = dataclasses.replace(parameters, batch=JUDGED, blending=0.0, even_spread=True)
            self._judge = self._make_sampler(held_out, plain).draw()
        self._network = CnmpNetwork(
            features=self._features.shape[1],
            encoder=parameters.encoder,
            aggregation=parameters.aggregation,
            decoder=parameters.decoder,
            seeds=seeds,
        )
        self._stopped: dict[int, CnmpNetwork] = {}
        self._optimiser = torch.optim.AdamW(
            self._network.parameters(),
            lr=parameters.learning_rate,
            betas=(0.9, parameters.second_moment),
            weight_decay=parameters.weight_decay,
            fused=True,
        )

    def run(self, *, deadline: float | None, progress: Progress | None, may_give_up: bool) -> None:
        """Trains until the plan is done, every loss is below Lt, nothing improves or time is over.

        Args:
            deadline: By `time.perf_counter`; plans the iterations in place of the parameters'.
            progress: Called some 200 times.
            may_give_up: Whether to stop at a quarter of the plan if all ignore observations.

        Raises:
            RunError: A loss became NaN or infinite.
        """
        p = self.parameters
        planned = total = p.iterations if deadline is None else self._plan(deadline)
        self.planned = planned
        every, check = max(1, planned // 200), max(1, planned // CHECKS)
        # A mean over some 2,000 points, whatever the batch: one query's loss says little.
        memory = max(10.0, 2_000.0 / (p.batch * p.queries))
        unit = 2.0 * np.log(self._scales)
        running, best, best_at, begun = np.zeros(len(unit)), math.inf, 0, time.perf_counter()
        lately = 0.0  # Sum over the iterations since progress was judged.
        for iteration in range(planned):
            fraction = iteration / total
            for group in self._optimiser.param_groups:
                group["lr"] = p.learning_rate * self._rate(fraction)
            nll = self._step(fraction) + unit
            if not np.isfinite(nll).all():
                raise RunError(f"training diverged: the loss is {nll.sum()} after {iteration} iterations")
            running += (nll - running) / min(iteration + 1.0, memory)
            lately += float(nll.mean())
            last = iteration + 1
            self._note(last, running, iteration % every == 0 or last == total)
            if progress is not None and (iteration % every == 0 or last == total):
                progress(last, total, float(running.mean()))
            if p.loss_threshold is not None and iteration > memory:
                self._stop_below(p.loss_threshold, running)
                if len(self._stopped) == len(running):
                    break
            if may_give_up and iteration == planned // 4:
                self.ignores_observations = self._ignores()
                if all(self.ignores_observations):
                    return
            if deadline is not None and iteration % 10 == 9:
                now = time.perf_counter()
                left = int((deadline - now) * last / (now - begun))
                if last + left < 0.98 * total:
                    total = last + max(left, 0)
            if p.patience > 0.0 and iteration % check == check - 1:
                judged = lately / check if self._judge is None else float((self._judged() + unit).mean())
                lately = 0.0
                if judged < best - LEAST_PROGRESS:
                    best, best_at = judged, iteration
                elif iteration - best_at > p.patience * planned:
                    total = min(total, last + int(CLOSING * planned))
                    best_at = planned
            if last >= total:
                break
        self.ignores_observations = self._ignores()

    def export(
        self,
        index: int = 0,
        *,
        confidence_gain: float,
        metadata: Mapping[str, Any],
        doubtful: float | None = None,
    ) -> CnmpLearner:
        """The learner at ``index`` as it is now.

        Args:
            index: Which.
            confidence_gain: K of eq. (1), in [1/m^2].
            metadata: For its file.
            doubtful: Variance that leaves hardly any confidence, in [m^2]; default: the demonstrations' own.
        """
        p, dataset = self.parameters, self.datasets[index]
        noise = max(p.noise, LEAST_NOISE) * dataset.spread
        doubt_gain = 0.0
        if p.doubt_within > 0.0:
            doubt_gain = (doubtful or dataset.spread**2) / (p.doubt_within * noise) ** 2
        encoder, decoder = self._network_of(index).export()
        model = CnmpModel(
            preset=p.preset,
            encoder=encoder,
            aggregation=p.aggregation,
            decoder=decoder,
            harmonics=p.harmonics,
            grid=dataset.grid,
            reference=self._references[index],
            scale=self._scales[index],
            sigma_floor=self._floors[index],
            demonstrations=dataset.positions,
            weights=dataset.weights,
            doubt_reach=p.doubt_from * noise or dataset.spread,
            doubt_gain=doubt_gain,
            confidence_gain=confidence_gain,
            metadata=metadata,
        )
        return CnmpLearner(model)

    def _make_sampler(self, chosen: Sequence[NDArray[np.bool_]], parameters: TrainingParameters) -> Sampler:
        lessons = []
        for index, dataset in enumerate(self.datasets):
            weights = dataset.weights[chosen[index]]
            lessons.append(
                Lesson(
                    paths=self._paths[index][chosen[index]],
                    weights=weights / weights.sum(),
                    unit=dataset.spread / self._scales[index],
                    seed=self.seeds[index],
                )
            )
        return Sampler(lessons, self._features, parameters)

    def _step(self, fraction: float) -> NDArray[np.float64]:
        """One iteration; of each learner the negative log-likelihood per point in normalised units."""
        p = self.parameters
        beta = 0.0 if fraction >= 1.0 - p.plain_share else p.beta
        loss, nll = self._loss(self._sampler.draw(), beta)
        self._optimiser.zero_grad(set_to_none=True)
        loss.backward()
        self._optimiser.step()
        return nll.double().numpy()

    def _loss(self, batch: Batch, beta: float) -> tuple[Tensor, Tensor]:
        mean, spread = self._network(batch.observations, batch.owners, batch.queries)
        return beta_nll(mean, spread + self._least_sigma, batch.truth, lean=batch.lean, beta=beta)

    def _judged(self) -> NDArray[np.float64]:
        """Negative log-likelihoods per point of what is held out, in normalised units."""
        assert self._judge is not None
        with torch.no_grad():
            return self._loss(self._judge, 0.0)[1].double().numpy()

    def _note(self, iteration: int, running: NDArray[np.float64], with_loss: bool) -> None:
        for index, loss in enumerate(running.tolist()):
            if index not in self._stopped:
                self.iterations[index] = iteration
                if with_loss:
                    self.losses[index].append([iteration, round(loss, 4)])

    def _stop_below(self, threshold: float, running: NDArray[np.float64]) -> None:
        """Keeps what those learners are now that have learnt enough; the others go on."""
        for index in np.flatnonzero(running <= threshold).tolist():
            if index not in self._stopped:
                self._stopped[index] = self._network.only(index)

    def _network_of(self, index: int) -> CnmpNetwork:
        return self._stopped.get(index) or self._network.only(index)

    def _rate(self, fraction: float) -> float:
        """The learning rate, relative to its peak, after a fraction of the plan."""
        if self.parameters.schedule == "constant":
            return 1.0
        if fraction < RISE:
            return 0.05 + 0.95 * fraction / RISE
        return 0.5 * (1.0 + math.cos(math.pi * (fraction - RISE) / (1.0 - RISE))) + 1e-4

    def _plan(self, deadline: float) -> int:
        """How many iterations there is time for, found on a training that is then thrown away."""
        trial = Optimisation(self.datasets, self.parameters, self.seeds)
        spent: list[float] = []
        begun = time.perf_counter()
        while len(spent) < 80 and (not spent or time.perf_counter() < begun + 0.05 * (deadline - begun)):
            start = time.perf_counter()
            trial._step(0.0)
            spent.append(time.perf_counter() - start)
        # The first are slow, and a plan that is too long is cut; one that is too short wastes time.
        return max(1, int((deadline - time.perf_counter()) / float(np.percentile(spent, 25))))

    def _ignores(self) -> list[bool]:
        """Whether each predicts the same whatever it is shown, where its demonstrations lie apart."""
        return [self._ignored_by(index) for index in range(len(self.datasets))]

    def _ignored_by(self, index: int) -> bool:
        dataset = self.datasets[index]
        strays = np.square(dataset.positions - dataset.mean_path).mean(axis=(0, 2))
        if len(dataset.positions) < 2 or strays.mean() < (0.01 * dataset.extent) ** 2:
            return False  # There is nothing to tell apart.
        step = int(strays.argmax())
        paths = torch.tensor(self._paths[index], dtype=torch.float32)
        shown = paths[:, step]
        observations = torch.cat([self._features[step].expand(len(shown), -1), shown], dim=-1)
        with torch.no_grad():
            mean, _ = self._network_of(index)(observations[None], torch.arange(len(shown)), self._features)
        said = float((mean[0] - mean[0].mean(dim=0)).square().mean())
        there = float((paths - paths.mean(dim=0)).square().mean())
        return said < 0.1 * there
