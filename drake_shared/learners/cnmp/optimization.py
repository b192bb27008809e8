"""One training of learners side by side: iterations, learning rate, and when to stop."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from drake_shared.common.errors import RunError
from drake_shared.learners.cnmp.layers import time_features
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.loss import beta_nll
from drake_shared.learners.cnmp.network import CnmpNetwork
from drake_shared.learners.cnmp.parameters import TrainingParameters
from drake_shared.learners.cnmp.sampling import Batch, Sampler, TaskData, hold_out
from drake_shared.learners.dataset import Dataset, normalization
from drake_shared.learners.fields import Layer

Progress = Callable[[int, int, float], None]
"""Takes the iterations done, those planned, and the running mean loss in nats per point."""

MIN_NOISE = 0.05
"""Relative; the unit of lengths that are multiples of the noise, where there is none."""
WARM_UP = 0.1
"""Share of a one-cycle schedule in which the learning rate rises."""
MIN_MEMORY = 100.0
"""Iterations that the running mean loss, compared with Lt, extends over: with fewer the mean of a few lucky
samples would end the training."""
CHECKS = 50
"""Number of times in a training that the loss is checked for improvement."""
MIN_IMPROVEMENT = 0.02
"""In nats per point."""
VALIDATION_SAMPLES = 256
"""Samples of held-out demonstrations, if there are any, for these checks."""
COOL_DOWN = 0.2
"""Share of the plan that is left to a training that is cut short, for the learning rate to fall."""


class Optimization:
    """Trains networks of one shape side by side, in one batched computation and by one plan.

    Each learner has its own demonstrations, seed and loss.

    Attributes:
        planned: Iterations at the beginning of the run; with a loss threshold their limit.
        iterations: Done so far by each learner; one whose loss fell below Lt has stopped.
        held_out: Number of held-out demonstrations of each.
        losses: Of each learner, pairs of iteration and running mean loss, in nats per point with positions
            in m.
        ignores_observations: Whether each was found to predict the same whatever it observes.

    Args:
        datasets: Of each learner, on grids of one length. A tenth of the demonstrations is held out if there
            are enough.
        parameters: Of the training.
        seeds: Of the initial weights and the samples of each learner.
    """

    def __init__(
        self, datasets: Sequence[Dataset], parameters: TrainingParameters, seeds: Sequence[int]
    ) -> None:
        self.datasets, self.parameters, self.seeds = list(datasets), parameters, list(seeds)
        shapes = {dataset.mean_path.shape for dataset in datasets}
        if len(shapes) != 1 or len(seeds) != len(datasets):
            raise ValueError(f"needs datasets of one shape and as many seeds, got {shapes}, {len(seeds)}")
        self._scales, self._references = zip(
            *(normalization(dataset, centred=parameters.centred) for dataset in datasets), strict=True
        )
        count = len(self.datasets)
        self.planned = 0
        self.iterations = [0] * count
        self.losses: list[list[list[float]]] = [[] for _ in range(count)]
        self.ignores_observations = [False] * count
        grid = datasets[0].grid
        features = time_features(grid, float(grid[-1]), parameters.harmonics)
        if parameters.time_scale is not None:
            features = parameters.time_scale * (2.0 * features - 1.0)
        self._features = torch.tensor(features, dtype=torch.float32)
        axes = np.stack([_axis_scales(dataset) for dataset in datasets]) / np.array(self._scales)[:, None]
        self._axes = torch.tensor(axes, dtype=torch.float32)
        self._floors = [
            parameters.sigma_floor * (dataset.spread if parameters.relative_floor else 1.0)
            for dataset in datasets
        ]
        relative = [floor / scale for floor, scale in zip(self._floors, self._scales, strict=True)]
        self._min_sigma = torch.tensor(relative, dtype=torch.float32)[:, None, None, None]
        firsts = [
            max(parameters.first_floor * dataset.spread, floor) / scale
            for dataset, floor, scale in zip(self.datasets, self._floors, self._scales, strict=True)
        ]
        self._first_sigma = torch.tensor(firsts, dtype=torch.float32)[:, None, None, None]
        held_out = [
            hold_out(len(dataset.positions), seed) & (parameters.patience > 0.0)
            for dataset, seed in zip(datasets, seeds, strict=True)
        ]
        if not all(chosen.any() for chosen in held_out):
            held_out = [np.zeros_like(chosen) for chosen in held_out]
        self.held_out = [int(chosen.sum()) for chosen in held_out]
        self._sampler = self._make_sampler([~chosen for chosen in held_out], parameters)
        self._validation: Batch | None = None
        if self.held_out[0]:
            plain = dataclasses.replace(parameters, batch=VALIDATION_SAMPLES, blending=0.0, even_spread=True)
            self._validation = self._make_sampler(held_out, plain).sample()
        self._network = CnmpNetwork(
            features=self._features.shape[1],
            positions=datasets[0].mean_path.shape[1],
            encoder=parameters.encoder,
            aggregation=parameters.aggregation,
            decoder=parameters.decoder,
            seeds=seeds,
        )
        self._stopped: dict[int, tuple[tuple[Layer, ...], tuple[Layer, ...]]] = {}
        self._active = list(range(count))
        self._optimizer = self._make_optimizer()

    def run(
        self,
        *,
        deadline: float | None,
        progress: Progress | None,
        may_give_up: bool,
        checkpoints: Collection[int] = (),
        on_checkpoint: Callable[[int, int, float], None] | None = None,
    ) -> None:
        """Trains until the plan is done, every loss is below Lt, no loss improves or time is over.

        Args:
            deadline: By `time.perf_counter`; determines the iterations in place of the parameters.
            progress: Called about 200 times.
            may_give_up: Whether to stop at a quarter of the plan if all ignore observations.
            checkpoints: Numbers of iterations after which ``on_checkpoint`` is called.
            on_checkpoint: Takes the index of each learner whose loss is not below Lt, the iterations done,
                and its running mean loss. It may `export` the learner.

        Raises:
            RunError: A loss became NaN or infinite.
        """
        p = self.parameters
        planned = total = p.iterations if deadline is None else self._plan(deadline)
        self.planned = planned
        every, check = max(1, planned // 200), max(1, planned // CHECKS)
        # A mean over about 2,000 points, whatever the batch, since the loss of one query varies.
        memory = max(10.0, 2_000.0 / (p.batch * p.queries))
        if p.loss_threshold is not None:
            memory = max(memory, MIN_MEMORY)
        # From nats per normalized point to nats per point in m.
        unit = self.datasets[0].mean_path.shape[1] * np.log(self._scales)
        running, best, best_at, start = np.zeros(len(unit)), math.inf, 0, time.perf_counter()
        recent = 0.0  # Sum over the iterations since the last check.
        for iteration in range(planned):
            begin, fraction = self._cycle(iteration, total)
            if iteration and iteration == begin:
                self._begin_cycle()
            for group in self._optimizer.param_groups:
                group["lr"] = p.learning_rate * self._learning_rate(fraction)
            nll = self._step(fraction) + unit[self._active]
            if not np.isfinite(nll).all():
                raise RunError(f"training diverged: the loss is {nll.sum()} after {iteration} iterations")
            running[self._active] += (nll - running[self._active]) / min(iteration + 1.0, memory)
            recent += float(nll.mean())
            last = iteration + 1
            self._note(last, running, iteration % every == 0 or last == total)
            if on_checkpoint is not None and last in checkpoints:
                for index in self._active:
                    if index not in self._stopped:
                        on_checkpoint(index, last, float(running[index]))
            if progress is not None and (iteration % every == 0 or last == total):
                progress(last, total, float(running.mean()))
            at_last_floor = p.first_floor == 0.0 or fraction >= p.floor_share
            if p.loss_threshold is not None and iteration > memory and at_last_floor:
                self._stop_below(p.loss_threshold, running, last)
                if len(self._stopped) == len(running):
                    break
            if may_give_up and iteration == planned // 4:
                self.ignores_observations = self._ignores()
                if all(self.ignores_observations):
                    return
            if deadline is not None and iteration % 10 == 9:
                now = time.perf_counter()
                left = int((deadline - now) * last / (now - start))
                if last + left < 0.98 * total:
                    total = last + max(left, 0)
            if p.patience > 0.0 and iteration % check == check - 1:
                checked = recent / check
                if self._validation is not None:
                    checked = float((self._validate(self._validation) + unit).mean())
                recent = 0.0
                if checked < best - MIN_IMPROVEMENT:
                    best, best_at = checked, iteration
                elif iteration - best_at > p.patience * planned:
                    total = min(total, last + int(COOL_DOWN * planned))
                    best_at = planned
            if last >= total:
                break
        self.ignores_observations = self._ignores()

    def export(
        self,
        index: int,
        *,
        confidence_gain: float = 1.0,
        metadata: Mapping[str, Any] | None = None,
        max_variance: float | None = None,
    ) -> CnmpLearner:
        """The learner at ``index`` as it is now.

        Args:
            index: Of the learner.
            confidence_gain: K of eq. (1), in [1/m^2].
            metadata: Of the learner.
            max_variance: Variance of hardly any confidence, in [m^2], which distance from all demonstrations
                adds; default: the variance of the demonstrations.
        """
        p, dataset = self.parameters, self.datasets[index]
        noise = max(p.noise, MIN_NOISE) * dataset.spread
        ood_gain = 0.0
        if p.doubt_within > 0.0:
            ood_gain = (max_variance or dataset.spread**2) / (p.doubt_within * noise) ** 2
        encoder, decoder = self._stopped.get(index) or self._export(index)
        return CnmpLearner(
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
            doubt_gain=ood_gain,
            confidence_gain=confidence_gain,
            metadata=metadata or {},
        )

    def record(self, index: int) -> dict[str, Any]:
        """The training of the learner at ``index``, as a JSON object."""
        return {
            "planned": self.planned,
            "iterations": self.iterations[index],
            "held_out": self.held_out[index],
            "ignores_observations": self.ignores_observations[index],
            "loss": self.losses[index],
            "loss_threshold": self.parameters.loss_threshold,
            "reached_threshold": None if self.parameters.loss_threshold is None else index in self._stopped,
        }

    def _make_optimizer(self) -> torch.optim.Optimizer:
        return torch.optim.AdamW(
            self._network.parameters(),
            lr=self.parameters.learning_rate,
            betas=(0.9, self.parameters.second_moment),
            weight_decay=self.parameters.weight_decay,
            fused=True,
        )

    def _make_sampler(self, chosen: Sequence[NDArray[np.bool_]], parameters: TrainingParameters) -> Sampler:
        tasks = []
        for index, dataset in enumerate(self.datasets):
            weights = dataset.weights[chosen[index]]
            paths = (dataset.positions - self._references[index]) / self._scales[index]
            tasks.append(
                TaskData(
                    paths=paths[chosen[index]],
                    weights=weights / weights.sum(),
                    unit=dataset.spread / self._scales[index],
                    seed=self.seeds[index],
                )
            )
        return Sampler(tasks, self._features, parameters)

    def _step(self, fraction: float) -> NDArray[np.float64]:
        """One iteration; returns each learner's negative log-likelihood per point in normalized units."""
        p = self.parameters
        beta = 0.0 if fraction >= 1.0 - p.plain_share else p.beta
        loss, nll = self._loss(self._sampler.sample(), beta, self._floor(fraction))
        self._optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        self._optimizer.step()
        return nll.double().numpy()

    def _loss(self, batch: Batch, beta: float, floor: Tensor) -> tuple[Tensor, Tensor]:
        mean, spread = self._predict(batch.observations, batch.sample_index, batch.queries)
        return beta_nll(mean, spread + floor, batch.truth, weights=batch.weights, beta=beta)

    def _predict(self, observations: Tensor, sample_index: Tensor, queries: Tensor) -> tuple[Tensor, Tensor]:
        """As the network predicts, with positions scaled by axis if parameters say so."""
        scale = self.parameters.position_scale
        if scale is not None:
            axes = self._axes[self._active][:, None]
            features = observations.shape[-1] - axes.shape[-1]
            time, positions = observations[..., :features], observations[..., features:]
            observations = torch.cat([time, positions * (scale / axes)], dim=-1)
        mean, spread = self._network(observations, sample_index, queries)
        if scale is not None:
            mean = mean * axes[:, None]
        return mean, spread

    def _validate(self, batch: Batch) -> NDArray[np.float64]:
        """Negative log-likelihoods per point of held-out demonstrations, in normalized units."""
        with torch.no_grad():
            return self._loss(batch, 0.0, self._min_sigma)[1].double().numpy()

    def _export(self, index: int) -> tuple[tuple[Layer, ...], tuple[Layer, ...]]:
        """Encoder and decoder of a network, with weights for inputs and outputs that are not scaled."""
        encoder, decoder = self._network.export(self._active.index(index))
        p, count = self.parameters, self._features.shape[1]
        weights, bias = encoder[0]
        if p.time_scale is not None:
            first, first_bias = decoder[0]
            for rows, own_bias in ((weights[:count], bias), (first[-count:], first_bias)):
                own_bias -= p.time_scale * rows.sum(axis=0)
                rows *= 2.0 * p.time_scale
        if p.position_scale is not None:
            axes = self._axes[index].numpy()
            weights[count:] *= (p.position_scale / axes)[:, None]
            last, last_bias = decoder[-1]
            last[:, : len(axes)] *= axes
            last_bias[: len(axes)] *= axes
        return encoder, decoder

    def _note(self, iteration: int, running: NDArray[np.float64], with_loss: bool) -> None:
        for index, loss in enumerate(running.tolist()):
            if index not in self._stopped:
                self.iterations[index] = iteration
                if with_loss:
                    self.losses[index].append([iteration, round(loss, 4)])

    def _stop_below(self, threshold: float, running: NDArray[np.float64], iteration: int) -> None:
        """Keeps the present weights of learners whose loss is low enough; the others go on."""
        for index in np.flatnonzero(running <= threshold).tolist():
            if index not in self._stopped:
                self._stopped[index] = self._export(index)
                if self.losses[index][-1][0] != iteration:
                    self.losses[index].append([iteration, round(float(running[index]), 4)])

    def _cycle(self, iteration: int, total: int) -> tuple[int, float]:
        """When the present cycle began, and its share that is done, if ``total`` iterations are planned."""
        begin, length = 0, self.parameters.cycle or total
        while iteration >= begin + length:
            begin, length = begin + length, 2 * length
        return begin, (iteration - begin) / min(length, total - begin)

    def _begin_cycle(self) -> None:
        """Begins a cycle with those networks whose loss is not yet low enough, and a new optimizer."""
        left = [place for place, index in enumerate(self._active) if index not in self._stopped]
        self._active = [self._active[place] for place in left]
        self._network.keep(left)
        self._sampler.keep(left)
        self._optimizer = self._make_optimizer()

    def _floor(self, fraction: float) -> Tensor:
        """Least standard deviations, normalized, after a fraction of a cycle; (E, 1, 1, 1)."""
        p = self.parameters
        last = self._min_sigma[self._active]
        if p.first_floor == 0.0 or fraction >= p.floor_share:
            return last
        done = fraction / p.floor_share
        return last**done * self._first_sigma[self._active] ** (1.0 - done)

    def _learning_rate(self, fraction: float) -> float:
        """The learning rate, relative to its peak, after a fraction of a cycle."""
        if self.parameters.schedule == "constant":
            return 1.0
        if fraction < WARM_UP:
            return 0.05 + 0.95 * fraction / WARM_UP
        return 0.5 * (1.0 + math.cos(math.pi * (fraction - WARM_UP) / (1.0 - WARM_UP))) + 1e-4

    def _plan(self, deadline: float) -> int:
        """The number of iterations that there is time for, measured on a training that is thrown away."""
        trial = Optimization(self.datasets, self.parameters, self.seeds)
        spent: list[float] = []
        begun = time.perf_counter()
        while len(spent) < 80 and (not spent or time.perf_counter() < begun + 0.05 * (deadline - begun)):
            start = time.perf_counter()
            trial._step(0.0)
            spent.append(time.perf_counter() - start)
        # The first iterations are slow. A plan that is too long is cut; one that is too short wastes time.
        return max(1, int((deadline - time.perf_counter()) / float(np.percentile(spent, 25))))

    def _ignores(self) -> list[bool]:
        """Whether each predicts the same whatever it observes, where its demonstrations lie apart."""
        return [self._ignores_at(index) for index in range(len(self.datasets))]

    def _ignores_at(self, index: int) -> bool:
        dataset = self.datasets[index]
        deviations = np.square(dataset.positions - dataset.mean_path).mean(axis=(0, 2))
        if len(dataset.positions) < 2 or deviations.mean() < (0.01 * dataset.extent) ** 2:
            return False  # The demonstrations are all alike.
        step = int(deviations.argmax())
        learner, grid = self.export(index), dataset.grid
        means = np.stack([learner.predict(grid[[step]], path[[step]], grid)[0] for path in dataset.positions])
        predicted = np.square(means - means.mean(axis=0)).mean()
        return bool(predicted < 0.1 * deviations.mean())


def _axis_scales(dataset: Dataset) -> NDArray[np.float64]:
    """Half the extent of the demonstrations in each coordinate, at least their spread, shape (D,), in [m]."""
    halves: NDArray[np.float64] = np.maximum(0.5 * np.ptp(dataset.positions, axis=(0, 1)), dataset.spread)
    return halves
