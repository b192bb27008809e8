"""One training of learners side by side."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from drake_shared.common.errors import RunError
from drake_shared.learners.cnmp.layers import time_features
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.loss import Objective
from drake_shared.learners.cnmp.network import CnmpNetworks
from drake_shared.learners.cnmp.normalized import Layers, NormalizedTask
from drake_shared.learners.cnmp.parameters import TrainingParameters
from drake_shared.learners.cnmp.sampling import Batch, Sampler, TaskData
from drake_shared.learners.cnmp.schedule import Schedule
from drake_shared.learners.dataset import Dataset

Progress = Callable[[int, int, float], None]
"""Takes the iterations done, those planned, and the running mean loss in nats per point."""

MIN_MEMORY = 100.0
"""Iterations that the running mean loss, compared with Lt, extends over: with fewer the mean of a few lucky
samples would end the training."""
MAX_UNREAD = 10
"""Losses are read after so many iterations, or sooner: a GPU waits for whoever reads one."""
VALIDATION_SAMPLES = 256
"""Samples of held-out demonstrations, if there are any, to check the loss for improvement."""


class Optimization:
    """Trains networks of one shape side by side, in one batched computation and by one plan.

    Each learner has its own demonstrations, seed and loss.

    Attributes:
        objective: What is minimized, of those networks that are still trained.
        planned: Iterations at the beginning of the run; with a loss threshold their limit.
        iterations: Done so far by each learner; one whose loss fell below Lt has stopped.
        losses: Of each learner, running mean losses by iteration, in nats per point with positions in m.
        ignores_observations: Whether each was found to predict the same whatever it observes.

    Args:
        datasets: Of each learner, on grids of one length. A tenth of the demonstrations is held out if there
            are enough.
        parameters: Of the training.
        seeds: Of the initial weights and the samples of each learner.
        device: "cpu" or "cuda".
    """

    def __init__(
        self,
        datasets: Sequence[Dataset],
        parameters: TrainingParameters,
        seeds: Sequence[int],
        device: str = "cpu",
    ) -> None:
        shapes = {dataset.mean_path.shape for dataset in datasets}
        if len(shapes) != 1 or len(seeds) != len(datasets):
            raise ValueError(f"needs datasets of one shape and as many seeds, got {shapes}, {len(seeds)}")
        self.parameters, self._arguments = parameters, (datasets, parameters, seeds, device)
        self._seeds, self._device = seeds, torch.device(device)
        self._tasks = [
            NormalizedTask(dataset, parameters, seed) for dataset, seed in zip(datasets, seeds, strict=True)
        ]
        if not all(task.held_out.any() for task in self._tasks):
            for task in self._tasks:
                task.held_out[:] = False
        count = len(datasets)
        self.planned = 0
        self.iterations = [0] * count
        self.losses: list[dict[int, float]] = [{} for _ in range(count)]
        self.ignores_observations = [False] * count
        grid = datasets[0].grid
        features = time_features(grid, float(grid[-1]), parameters.harmonics)
        if parameters.time_scale is not None:
            features = parameters.time_scale * (2.0 * features - 1.0)
        self._features = self._tensor(features)
        self._sampler = self._make_sampler(parameters, held_out=False)
        self._validation: Batch | None = None
        if self._tasks[0].held_out.any():
            plain = dataclasses.replace(parameters, batch=VALIDATION_SAMPLES, blending=0.0, even_spread=True)
            self._validation = self._make_sampler(plain, held_out=True).sample()
        networks = CnmpNetworks(
            features=self._features.shape[1],
            positions=datasets[0].mean_path.shape[1],
            encoder=parameters.encoder,
            aggregation=parameters.aggregation,
            decoder=parameters.decoder,
            seeds=seeds,
        )
        self._stopped: dict[int, tuple[Layers, Layers]] = {}
        self._active = list(range(count))
        self._prepare(networks)

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
        planned = p.iterations if deadline is None else self._affordable(deadline)
        self.planned = planned
        schedule = Schedule(p, planned=planned, deadline=deadline)
        every = max(1, planned // 200)
        # A mean over about 2,000 points, whatever the batch, since the loss of one query varies.
        memory = max(10.0, 2_000.0 / (p.batch * p.queries))
        if p.loss_threshold is not None:
            memory = max(memory, MIN_MEMORY)
        running = torch.zeros_like(self._units)
        recent, checked = torch.zeros_like(self._units[0]), 0  # Sum since the last check, and when that was.
        for iteration in range(planned):
            begins, fraction = schedule.cycle(iteration)
            if begins:
                running = running[self._begin_cycle()]
            done, fallen = iteration + 1, schedule.floor_fallen(fraction)
            nll = self.step(schedule.learning_rate(fraction), schedule.beta(fraction), fallen)
            nll += self._units
            running += (nll - running) / min(float(done), memory)
            recent += nll.mean()
            noted = iteration % every == 0 or done >= schedule.total
            due = noted or done % MAX_UNREAD == 0
            asked = may_give_up and iteration == planned // 4
            if due or asked or done in checkpoints or schedule.is_check(done):
                losses = self._read(running, done, noted)
                if on_checkpoint is not None and done in checkpoints:
                    for index, loss in losses.items():
                        on_checkpoint(index, done, loss)
                if progress is not None and noted:
                    progress(done, schedule.total, float(running.mean()))
                if p.loss_threshold is not None and due and done > memory and fallen == 1.0:
                    self._stop_below(p.loss_threshold, losses, done)
                    if len(self._stopped) == len(self._tasks):
                        break
            if asked:
                self.ignores_observations = self._ignores()
                if all(self.ignores_observations):
                    return
            if done % MAX_UNREAD == 0:
                schedule.keep_time(done)
            if schedule.is_check(done):
                mean = recent / (done - checked)
                if self._validation is not None:
                    mean = self._validate(self._validation) + self._units
                schedule.check(done, float(mean.mean()))
                recent, checked = torch.zeros_like(recent), done
            if done >= schedule.total:
                break
        self.ignores_observations = self._ignores()

    def step(self, learning_rate: float, beta: float, floor_fallen: float) -> Tensor:
        """One iteration.

        Args:
            learning_rate: Of the optimizer.
            beta: Of the loss.
            floor_fallen: See `Schedule.floor_fallen`.

        Returns:
            Each learner's negative log-likelihood per point in normalized units, float64, shape (E,).
        """
        for group in self._optimizer.param_groups:
            group["lr"] = learning_rate
        floor = self._last_sigma**floor_fallen * self._first_sigma ** (1.0 - floor_fallen)
        loss, nll = self.objective(*self._sampler.sample(), floor, self._beta(beta))
        self._optimizer.zero_grad(set_to_none=True)
        loss.backward()
        self._optimizer.step()
        losses: Tensor = nll.detach().double()
        return losses

    def export(
        self,
        index: int,
        *,
        confidence_gain: float = 1.0,
        metadata: Mapping[str, Any] | None = None,
        max_variance: float | None = None,
    ) -> CnmpLearner:
        """The learner at ``index`` as it is now; arguments as of `NormalizedTask.learner`."""
        return self._tasks[index].learner(
            *self._layers(index),
            confidence_gain=confidence_gain,
            metadata=metadata,
            max_variance=max_variance,
        )

    def record(self, index: int) -> dict[str, Any]:
        """The training of the learner at ``index``, as a JSON object."""
        threshold = self.parameters.loss_threshold
        return {
            "device": self._device.type,
            "planned": self.planned,
            "iterations": self.iterations[index],
            "held_out": int(self._tasks[index].held_out.sum()),
            "ignores_observations": self.ignores_observations[index],
            "loss": [[done, loss] for done, loss in self.losses[index].items()],
            "loss_threshold": threshold,
            "reached_threshold": None if threshold is None else index in self._stopped,
        }

    def _tensor(self, values: Any, dtype: torch.dtype = torch.float32) -> Tensor:
        return torch.tensor(np.asarray(values), dtype=dtype, device=self._device)

    def _beta(self, beta: float) -> float | Tensor:
        # What is captured in a graph must be a tensor to have another value later.
        return beta if self._device.type == "cpu" else torch.full((), beta, device=self._device)

    def _prepare(self, networks: CnmpNetworks) -> None:
        """Makes objective and optimizer of the networks of those learners that are still trained."""
        tasks = [self._tasks[index] for index in self._active]
        self._units = self._tensor([task.nats for task in tasks], torch.float64)
        self._first_sigma, self._last_sigma = (
            self._tensor(floors)[:, None, None, None]
            for floors in ([task.first_sigma for task in tasks], [task.sigma_floor for task in tasks])
        )
        axes = self._tensor([task.axes for task in tasks])
        self.objective = Objective(networks, axes, self.parameters.position_scale).to(self._device)
        self._optimizer = torch.optim.AdamW(
            self.objective.parameters(),
            lr=self.parameters.learning_rate,
            betas=(0.9, self.parameters.second_moment),
            weight_decay=self.parameters.weight_decay,
            fused=True,
        )
        if self._device.type == "cuda":
            # A graph launches all kernels of an iteration at once; launching them one by one takes longer
            # than such small networks compute. In evaluation mode the module runs without it.
            sample = (*self._sampler.sample(), self._last_sigma, torch.zeros((), device=self._device))
            torch.cuda.make_graphed_callables(self.objective, sample)

    def _make_sampler(self, parameters: TrainingParameters, *, held_out: bool) -> Sampler:
        tasks = []
        for task, seed in zip(self._tasks, self._seeds, strict=True):
            chosen = task.held_out == held_out
            weights = task.weights[chosen]
            tasks.append(
                TaskData(paths=task.paths[chosen], weights=weights / weights.sum(), unit=task.unit, seed=seed)
            )
        # A GPU needs equal shapes for its graph, and the order of sums over padding is always the same; a
        # processor would only compute more.
        return Sampler(tasks, self._features, parameters, padded=self._device.type != "cpu")

    def _layers(self, index: int) -> tuple[Layers, Layers]:
        """Encoder and decoder of the learner at ``index``."""
        if index in self._stopped:
            return self._stopped[index]
        return self._tasks[index].unscaled(*self.objective.networks.export(self._active.index(index)))

    def _validate(self, batch: Batch) -> Tensor:
        """Negative log-likelihoods per point of held-out demonstrations, in normalized units."""
        self.objective.eval()
        with torch.no_grad():
            nll: Tensor = self.objective(*batch, self._last_sigma, 0.0)[1].double()
        self.objective.train()
        return nll

    def _read(self, running: Tensor, done: int, noted: bool) -> dict[int, float]:
        """Running mean losses of the learners that are still trained; keeps them if ``noted``."""
        losses = {
            index: loss
            for index, loss in zip(self._active, running.tolist(), strict=True)
            if index not in self._stopped
        }
        if not all(map(math.isfinite, losses.values())):
            raise RunError(f"training diverged: the loss is {sum(losses.values())} after {done} iterations")
        for index, loss in losses.items():
            self.iterations[index] = done
            if noted:
                self.losses[index][done] = round(loss, 4)
        return losses

    def _stop_below(self, threshold: float, losses: Mapping[int, float], done: int) -> None:
        """Keeps the present weights of learners whose loss is low enough; the others go on."""
        for index, loss in losses.items():
            if loss <= threshold:
                self._stopped[index] = self._layers(index)
                self.losses[index][done] = round(loss, 4)

    def _begin_cycle(self) -> list[int]:
        """Goes on with those networks whose loss is not yet low enough, and a new optimizer.

        Returns:
            Their places among those trained until now.
        """
        left = [place for place, index in enumerate(self._active) if index not in self._stopped]
        self._active = [self._active[place] for place in left]
        self._sampler.keep(left)
        self.objective.networks.keep(left)
        self._prepare(self.objective.networks)
        return left

    def _affordable(self, deadline: float) -> int:
        """The number of iterations that there is time for, measured on a training that is thrown away."""
        trial = Optimization(*self._arguments)
        spent: list[float] = []
        begun = time.perf_counter()
        while len(spent) < 80 and (not spent or time.perf_counter() < begun + 0.05 * (deadline - begun)):
            start = time.perf_counter()
            trial.step(self.parameters.learning_rate, self.parameters.beta, 0.0).tolist()
            spent.append(time.perf_counter() - start)
        # The first iterations are slow. A plan that is too long is cut; one that is too short wastes time.
        return max(1, int((deadline - time.perf_counter()) / float(np.percentile(spent, 25))))

    def _ignores(self) -> list[bool]:
        """Whether each predicts the same whatever it observes, where its demonstrations lie apart."""
        return [task.is_ignored_by(self.export(index)) for index, task in enumerate(self._tasks)]
