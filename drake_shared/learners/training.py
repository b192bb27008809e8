"""Alg. 1 of Amirshirzad et al. 2022: training a CNMP on weighted demonstrations, in torch."""

from __future__ import annotations

import dataclasses
import platform
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from threadpoolctl import threadpool_limits
from torch import Tensor

from drake_shared.demonstrations import Demonstrations
from drake_shared.errors import InputError, RunError
from drake_shared.learners.calibration import calibrate
from drake_shared.learners.cnmp import CnmpLearner, CnmpModel
from drake_shared.learners.dataset import Dataset, make_dataset
from drake_shared.learners.features import time_features
from drake_shared.learners.network import CnmpNetwork
from drake_shared.learners.parameters import TrainingParameters, find_parameters

Progress = Callable[[int, int, float], None]
"""Takes the iterations done, those planned, and the running mean loss in nats per point."""

RESERVED = 0.08
"""Share of the seconds given that is kept for what is not iterations: planning, calibration."""


def train(
    demonstrations: Demonstrations,
    *,
    preset: str = "default",
    weighted: bool = True,
    seed: int = 0,
    seconds: float | None = None,
    iterations: int | None = None,
    progress: Progress | None = None,
    duration: float | None = None,
    parameters: TrainingParameters | None = None,
) -> CnmpLearner:
    """Trains a CNMP.

    The same demonstrations, parameters, seed and number of iterations give the same bits on the same kind of
    processor. ``seconds`` decides how many iterations there are, so that the result depends on the machine's
    speed; the training record says how many there were.

    Args:
        demonstrations: At least one.
        preset: "default" or "paper".
        weighted: Whether scores, where all have one, decide which demonstrations are leant to.
        seed: Of the network's first weights and of all that is drawn.
        seconds: Bounds the time and plans the iterations.
        iterations: In place of the preset's.
        progress: Called now and then.
        duration: T, in [s]; default: that of the longest demonstration.
        parameters: In place of the preset's.

    Raises:
        InputError: An argument or a score is not what it must be.
        RunError: The loss became NaN or infinite.
    """
    begun = time.perf_counter()
    chosen = parameters or find_parameters(preset)
    if iterations is not None:
        chosen = dataclasses.replace(chosen, iterations=iterations)
    if chosen.iterations < 1:
        raise InputError("train", "iterations", "must be at least 1", chosen.iterations)
    if seconds is not None and not (np.isfinite(seconds) and seconds > 0.0):
        raise InputError("train", "seconds", "must be positive and finite", seconds)
    if seed < 0:
        raise InputError("train", "seed", "must be 0 or more", seed)
    dataset = make_dataset(demonstrations, weighted=weighted, duration=duration)
    deadline = None if seconds is None else begun + seconds * (1.0 - RESERVED)
    threads = torch.get_num_threads()
    # The arrays are small: a second thread makes it slower, and changes the bits.
    torch.set_num_threads(1)
    try:
        run = _train(dataset, chosen, seed, deadline, progress)
    finally:
        torch.set_num_threads(threads)
    record = {
        "parameters": chosen.to_json(),
        "weighted": weighted,
        "seed": seed,
        "seconds": round(time.perf_counter() - begun, 3),
        "seconds_allowed": seconds,
        "iterations": run.iterations,
        "restarts": run.restarts,
        "ignores_observations": run.ignores,
        "loss": run.losses,
        "data_sha256": dataset.digest,
        "demonstrations": len(demonstrations),
        "versions": {
            "torch": torch.__version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
    }
    metadata = {"scenario": demonstrations.scenario, "clock": chosen.clock, "training": record}
    with threadpool_limits(1, user_api="blas"):
        gain = calibrate(
            run.export(confidence_gain=1.0, metadata=metadata),
            demonstrations,
            resolution=chosen.noise * dataset.spread,
        )
    return run.export(confidence_gain=gain, metadata=metadata)


def _train(
    dataset: Dataset,
    parameters: TrainingParameters,
    seed: int,
    deadline: float | None,
    progress: Progress | None,
) -> _Run:
    for attempt in range(parameters.restarts + 1):
        run = _Run(dataset, parameters, seed + 7919 * attempt)
        run.restarts = attempt
        run.optimise(deadline, progress, last=attempt == parameters.restarts)
        if not run.ignores:
            break
    return run


class _Run:
    """One training from one seed."""

    def __init__(self, dataset: Dataset, parameters: TrainingParameters, seed: int) -> None:
        self.dataset, self.parameters, self.seed = dataset, parameters, seed
        if parameters.centred:
            self.scale, self.reference = dataset.spread, dataset.mean_path
        else:
            corners = dataset.positions.reshape(-1, 2)
            middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
            self.scale = 0.5 * dataset.extent or 1.0
            self.reference = np.broadcast_to(middle, dataset.mean_path.shape).copy()
        unit = dataset.spread if parameters.relative_floor else 1.0
        self.floor = parameters.sigma_floor * unit
        self.paths = torch.tensor((dataset.positions - self.reference) / self.scale, dtype=torch.float32)
        features = time_features(dataset.grid, float(dataset.grid[-1]), parameters.harmonics)
        self.features = torch.tensor(features, dtype=torch.float32)
        weights = dataset.weights * len(dataset.weights)
        self.weights = torch.tensor(weights, dtype=torch.float32)
        self.noise = parameters.noise * dataset.spread / self.scale
        self.iterations = 0
        self.restarts = 0
        self.ignores = False
        self.losses: list[list[float]] = []
        self._begin()

    def _begin(self) -> None:
        self.generator = torch.Generator().manual_seed(self.seed)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self.seed)
            self.network = CnmpNetwork(
                features=self.features.shape[1],
                encoder=self.parameters.encoder,
                decoder=self.parameters.decoder,
            )
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(),
            lr=self.parameters.learning_rate,
            weight_decay=self.parameters.weight_decay,
            foreach=True,
        )

    def optimise(self, deadline: float | None, progress: Progress | None, *, last: bool) -> None:
        """Trains until the plan is done, the loss is low enough, or the learner is found to be stuck."""
        planned = self.parameters.iterations if deadline is None else self._plan(deadline)
        unit = 2.0 * float(np.log(self.scale))
        threshold = self.parameters.loss_threshold
        running, begun = 0.0, time.perf_counter()
        report = max(1, planned // 200)
        total = planned
        for iteration in range(planned):
            fraction = iteration / total
            for group in self.optimiser.param_groups:
                group["lr"] = self.parameters.learning_rate * self._rate(fraction)
            loss, nll = self._loss(fraction)
            self.optimiser.zero_grad(set_to_none=True)
            loss.backward()
            self.optimiser.step()
            value = float(nll) + unit
            if not np.isfinite(value):
                raise RunError(f"training diverged: the loss is {value} after {iteration} iterations")
            # An average over some 200 samples, whatever the batch: one query's loss says little.
            share = 1.0 / min(iteration + 1, max(10, 200 // self.parameters.batch))
            running += share * (value - running)
            self.iterations = iteration + 1
            if iteration % report == 0 or iteration == planned - 1:
                self.losses.append([iteration + 1, round(running, 4)])
                if progress is not None:
                    progress(iteration + 1, total, running)
            if threshold is not None and iteration > 200 and running <= threshold:
                break
            if not last and iteration == planned // 4 and self._ignores_observations():
                self.ignores = True
                return
            if deadline is not None and iteration % 20 == 19:
                now = time.perf_counter()
                pace = (now - begun) / (iteration + 1)
                if iteration + 1 + (deadline - now) / pace < total * 0.97:
                    total = iteration + 1 + int((deadline - now) / pace)
                if iteration + 1 >= total or now > deadline:
                    break
        self.ignores = self._ignores_observations()

    def _plan(self, deadline: float) -> int:
        """How many iterations there is time for, found on a network that is then thrown away."""
        trial = _Run(self.dataset, self.parameters, self.seed)
        spent: list[float] = []
        begun = time.perf_counter()
        while len(spent) < 30 and time.perf_counter() < begun + 0.05 * (deadline - begun):
            start = time.perf_counter()
            loss, _ = trial._loss(0.0)
            trial.optimiser.zero_grad(set_to_none=True)
            loss.backward()
            trial.optimiser.step()
            spent.append(time.perf_counter() - start)
        if not spent:
            return 1
        return max(1, int((deadline - time.perf_counter()) / float(np.median(spent))))

    def _rate(self, fraction: float) -> float:
        """The learning rate, relative, after a fraction of the plan."""
        if self.parameters.schedule == "constant":
            return 1.0
        rise = 0.1
        if fraction < rise:
            return 0.05 + 0.95 * fraction / rise
        return 0.5 * (1.0 + float(np.cos(np.pi * (fraction - rise) / (1.0 - rise)))) + 1e-4

    def _loss(self, fraction: float) -> tuple[Tensor, Tensor]:
        """What is minimised, and the negative log-likelihood per point in normalised units."""
        p = self.parameters
        draw = self.generator
        count, steps = self.paths.shape[:2]
        if p.even_spread:
            demos = torch.randint(count, (p.batch,), generator=draw)
            lean = self.weights[demos][:, None, None]
        else:
            demos = torch.multinomial(self.weights, p.batch, replacement=True, generator=draw)
            lean = torch.ones(1)
        number = torch.randint(1, p.observations + 1, (p.batch,), generator=draw)
        number[: int(p.single_share * p.batch)] = 1
        most = int(number.max())
        when = torch.randint(steps, (p.batch, most), generator=draw)
        seen = self.paths[demos[:, None], when]
        if self.noise > 0.0:
            seen = seen + self.noise * torch.randn(seen.shape, generator=draw)
        observations = torch.cat([self.features[when], seen], dim=-1)
        mask = (torch.arange(most) < number[:, None]).float()
        if p.queries:
            asked = torch.randint(steps, (p.queries,), generator=draw)
            queries, truth = self.features[asked], self.paths[demos][:, asked]
        else:
            queries, truth = self.features, self.paths[demos]
        mean, spread = self.network(observations, mask, queries)
        sigma = spread + self.floor / self.scale
        fixed = sigma.detach()
        beta = 0.0 if fraction >= 1.0 - p.plain_share else p.beta
        scale = fixed ** (2.0 * beta)
        error = truth - mean
        of_mean = lean * 0.5 * (error / fixed).square()
        of_sigma = sigma.log() + 0.5 * (error.detach() / sigma).square()
        constant = 0.5 * float(np.log(2.0 * np.pi))
        nll = (sigma.detach().log() + 0.5 * (error.detach() / fixed).square() + constant).sum(-1).mean()
        return ((of_mean + of_sigma) * scale).sum(-1).mean(), nll

    def _ignores_observations(self) -> bool:
        """Whether it predicts the same whatever it is shown, where the demonstrations tell routes apart."""
        dataset = self.dataset
        apart = np.square(dataset.positions - dataset.mean_path).mean(axis=(0, 2))
        step = int(apart.argmax())
        shown = self.paths[:, step]
        features = self.features[step].expand(len(shown), -1)
        observations = torch.cat([features, shown], dim=-1)[:, None, :]
        with torch.no_grad():
            mean, _ = self.network(observations, torch.ones(len(shown), 1), self.features)
        asked = (self.paths - self.paths.mean(dim=0)).square().mean()
        if float(asked) * self.scale**2 < (0.01 * dataset.extent) ** 2:
            return False
        return float((mean - mean.mean(dim=0)).square().mean() / asked) < 0.1

    def export(self, *, confidence_gain: float, metadata: Mapping[str, Any]) -> CnmpLearner:
        """The learner as it is now."""
        p, dataset = self.parameters, self.dataset
        encoder, decoder = self.network.export()
        noise = self.noise * self.scale
        model = CnmpModel(
            preset=p.preset,
            encoder=encoder,
            decoder=decoder,
            harmonics=p.harmonics,
            grid=dataset.grid,
            reference=self.reference,
            scale=self.scale,
            sigma_floor=self.floor,
            demonstrations=dataset.positions,
            weights=dataset.weights,
            doubt_reach=3.0 * noise or 1.0,
            doubt_gain=p.distance_gain,
            confidence_gain=confidence_gain,
            metadata=metadata,
        )
        return CnmpLearner(model)
