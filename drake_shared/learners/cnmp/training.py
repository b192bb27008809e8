"""Alg. 1 of Amirshirzad et al. 2022: training CNMPs on weighted demonstrations, in torch."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal, TypedDict, Unpack, get_args

import numpy as np
import torch

from drake_shared.common.errors import InputError
from drake_shared.common.threads import single_threaded
from drake_shared.demonstrations import Demonstrations, align
from drake_shared.learners.calibration import CALIBRATIONS, LEAST_CONFIDENCE, Calibration, calibrate
from drake_shared.learners.cnmp.learner import CnmpLearner
from drake_shared.learners.cnmp.optimization import Optimization, Progress
from drake_shared.learners.cnmp.parameters import TrainingParameters, find_parameters
from drake_shared.learners.dataset import Dataset, data_record, make_dataset
from drake_shared.learners.heap import kept_memory

RESERVED = 0.05
"""Share of the seconds given that is reserved for what is not iterations: data, calibration."""
MAX_TOGETHER = 20
"""Networks trained in one batched computation on a processor: what they compute with stays in its cache."""
SEED_STEP = 7919
"""Between the seeds of successive attempts, so that those of neighbouring seeds differ."""

Device = Literal["cpu", "cuda", "auto"]
OnCheckpoint = Callable[[int, int, float, CnmpLearner], None]
"""Takes the index of a learner, the iterations done, the running mean loss in nats per point with positions
in m, and the learner as it is then, with its own K."""

Trained = tuple[Optimization, int, int]
"""A training, the index of a network there, and how often it restarted."""


class Options(TypedDict, total=False):
    """Options of trainings of CNMPs.

    Attributes:
        preset: "default" or "paper".
        seconds: Limits the time and determines the iterations.
        iterations: In place of the preset's; at most so many.
        progress: Called about 200 times.
        duration: T, in [s]; default: that of the longest demonstration.
        parameters: In place of the preset's.
        score_width: In place of the preset's.
        calibration: How K is found; see `calibrate`.
        device: "cpu"; "cuda", a GPU; or "auto", a GPU if there is one. Each gives the same bits every time,
            but not those of the other.
        begun: When the seconds began to count, by `time.perf_counter`; default: now.
    """

    preset: str
    seconds: float | None
    iterations: int | None
    progress: Progress | None
    duration: float | None
    parameters: TrainingParameters | None
    score_width: float | None
    calibration: Calibration
    device: Device
    begun: float


def train(
    demonstrations: Demonstrations, *, weighted: bool = True, seed: int = 0, **options: Unpack[Options]
) -> CnmpLearner:
    """Trains a CNMP.

    The same demonstrations, parameters, seed and number of iterations give the same bits on the same kind of
    processor. With ``seconds`` the number of iterations depends on the speed of the machine; the training
    record holds it.

    Args:
        demonstrations: At least one.
        weighted: Whether scores, where all demonstrations have one, weight them.
        seed: Of the network's initial weights and of all samples.
        options: See `Options`.

    Raises:
        InputError: An option or a score is invalid.
        RunError: The loss became NaN or infinite.
    """
    (learner,) = train_together([demonstrations], [seed], weighted=weighted, **options)
    return learner


def train_together(
    tasks: Sequence[Demonstrations],
    seeds: Sequence[int],
    *,
    weighted: bool | Sequence[bool] = True,
    checkpoints: Sequence[int] = (),
    on_checkpoint: OnCheckpoint | None = None,
    **options: Unpack[Options],
) -> list[CnmpLearner]:
    """Trains a CNMP on each of several sets of demonstrations, in one batched computation.

    The result of one does not depend on the others, except for rounding in batched products and for when
    training is cut short because no loss improves, which is decided for all.

    Args:
        tasks: Demonstrations of each learner; under a time limit all of one duration.
        seeds: Of each learner.
        weighted: As for `train`, for all or of each.
        checkpoints: Numbers of iterations after which ``on_checkpoint`` is called, with each learner that is
            still trained. It is called again if a learner's training restarts.
        on_checkpoint: See `OnCheckpoint`. It does not change the result.
        options: See `Options`; as for `train`, which also lists the errors.
    """
    plan = Plan.make(seed=min(seeds), **options)
    each = [weighted] * len(tasks) if isinstance(weighted, bool) else list(weighted)
    tasks = [align(task) if plan.parameters.clock == "progress" else task for task in tasks]
    datasets = [
        make_dataset(
            demonstrations,
            weighted=own,
            duration=options.get("duration"),
            score_width=plan.parameters.score_width,
        )
        for demonstrations, own in zip(tasks, each, strict=True)
    ]

    def make(index: int, trained: Trained) -> CnmpLearner:
        run, place, restarts = trained
        metadata = training_metadata(tasks[index], datasets[index], plan.parameters)
        record = metadata["training"]
        record |= run.record(place)
        record |= {
            "weighted": each[index],
            "seed": seeds[index],
            "restarts": restarts,
            "seconds_allowed": plan.seconds,
            "trained_together": len(tasks),
            "calibration": plan.calibration,
        }
        learner = run.export(place)
        # Where routes part at once, the variance along demonstrations is the floor's nearly everywhere.
        resolution = max(0.5 * plan.parameters.noise * datasets[index].spread, learner.sigma_floor)
        gain = calibrate(learner, tasks[index], resolution=resolution, calibration=plan.calibration)
        record["seconds"] = plan.spent()
        max_variance = 1.0 / (LEAST_CONFIDENCE * gain)
        return run.export(place, confidence_gain=gain, metadata=metadata, max_variance=max_variance)

    def report(index: int, trained: Trained, step: int, loss: float) -> None:
        if on_checkpoint is not None:
            on_checkpoint(index, step, loss, make(index, trained))

    with fast_training():
        trained = fit(datasets, plan, seeds, checkpoints=checkpoints, on_checkpoint=report)
        return list(map(make, range(len(trained)), trained))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan:
    """How long training lasts and how often it restarts.

    Attributes:
        parameters: Of the training.
        begun: When it began, by `time.perf_counter`.
        seconds: Its limit, if any.
        progress: See `Options`.
        calibration: See `Options`.
        device: "cpu" or "cuda".
    """

    parameters: TrainingParameters
    begun: float
    seconds: float | None
    progress: Progress | None
    calibration: Calibration
    device: str

    @classmethod
    def make(cls, *, seed: int, **options: Unpack[Options]) -> Plan:
        """The plan that options describe.

        Raises:
            InputError: One is invalid.
        """
        unknown = set(options) - set(Options.__annotations__)
        if unknown:
            raise InputError("train", min(unknown), f"must be one of {', '.join(Options.__annotations__)}")
        begun = options.get("begun", time.perf_counter())
        parameters = options.get("parameters") or find_parameters(options.get("preset", "default"))
        iterations, seconds = options.get("iterations"), options.get("seconds")
        if iterations is not None:
            parameters = dataclasses.replace(parameters, iterations=iterations)
        if (score_width := options.get("score_width")) is not None:
            parameters = dataclasses.replace(parameters, score_width=score_width)
        if parameters.iterations < 1:
            raise InputError("train", "iterations", "must be at least 1", parameters.iterations)
        if seconds is not None and not (np.isfinite(seconds) and seconds > 0.0):
            raise InputError("train", "seconds", "must be positive and finite", seconds)
        if seed < 0:
            raise InputError("train", "seed", "must be 0 or more", seed)
        calibration = options.get("calibration", "percentile")
        if calibration not in CALIBRATIONS:
            raise InputError("train", "calibration", f"must be one of {', '.join(CALIBRATIONS)}", calibration)
        return cls(
            parameters=parameters,
            begun=begun,
            seconds=seconds,
            progress=options.get("progress"),
            calibration=calibration,
            device=find_device(options.get("device", "cpu")),
        )

    @property
    def deadline(self) -> float | None:
        """Of the iterations, by `time.perf_counter`."""
        return None if self.seconds is None else self.begun + self.seconds * (1.0 - RESERVED)

    def spent(self) -> float:
        """Seconds since the beginning."""
        return round(time.perf_counter() - self.begun, 3)


def fit(
    datasets: Sequence[Dataset],
    plan: Plan,
    seeds: Sequence[int],
    *,
    checkpoints: Sequence[int] = (),
    on_checkpoint: Callable[[int, Trained, int, float], None] | None = None,
) -> list[Trained]:
    """Trains a network on each dataset; those that ignore observations are trained again from other seeds.

    Args:
        datasets: Of each network.
        plan: Of the training.
        seeds: Of each network.
        checkpoints: Numbers of iterations.
        on_checkpoint: Is called after as many, for each network, with the index of its dataset, what is
            returned of it, the iterations, and the running mean loss.
    """
    groups = _groups(datasets, plan)
    found: dict[int, Trained] = {}

    def progress(done: int, planned: int, loss: float) -> None:
        if plan.progress is not None:
            plan.progress(number * planned + done, len(groups) * planned, loss)

    def report(place: int, step: int, loss: float) -> None:
        if on_checkpoint is not None:
            on_checkpoint(waiting[place], found[waiting[place]], step, loss)

    for number in range(len(groups)):
        waiting = groups[number]
        for restarts in range(plan.parameters.restarts + 1):
            run = Optimization(
                [datasets[index] for index in waiting],
                plan.parameters,
                [seeds[index] + SEED_STEP * restarts for index in waiting],
                plan.device,
            )
            found |= {index: (run, place, restarts) for place, index in enumerate(waiting)}
            run.run(
                deadline=plan.deadline,
                progress=progress,
                may_give_up=restarts < plan.parameters.restarts,
                checkpoints=checkpoints,
                on_checkpoint=report,
            )
            waiting = [index for place, index in enumerate(waiting) if run.ignores_observations[place]]
            if not waiting:
                break
    return [found[index] for index in range(len(datasets))]


def _groups(datasets: Sequence[Dataset], plan: Plan) -> list[list[int]]:
    """Indices of the datasets that are trained side by side: those on one grid, on a CPU not too many."""
    if plan.seconds is not None:
        # Groups would have to share the time.
        return [list(range(len(datasets)))]
    alike: dict[int, list[int]] = {}
    for index, dataset in enumerate(datasets):
        alike.setdefault(len(dataset.grid), []).append(index)
    most = len(datasets) if plan.device == "cuda" else MAX_TOGETHER
    groups = []
    for indices in alike.values():
        count = math.ceil(len(indices) / most)
        groups += [indices[begin::count] for begin in range(count)]
    return groups


def find_device(name: str) -> str:
    """The device that "cpu", "cuda" or "auto" stands for.

    Raises:
        InputError: It is another name, or there is no such device.
    """
    if name not in get_args(Device):
        raise InputError("train", "device", f"must be one of {', '.join(get_args(Device))}", repr(name))
    available = torch.cuda.is_available()
    if name == "cuda" and not available:
        raise InputError("train", "device", "must be cpu or auto: this machine has no CUDA GPU", name)
    return "cuda" if available and name != "cpu" else "cpu"


@contextlib.contextmanager
def fast_training() -> Iterator[None]:
    """Settings under which small networks train fast, and with the same bits every time.

    A second thread makes training slower and changes the bits. Inactive units leave the optimizer with
    moments that decay to denormal numbers, on which a processor is a hundred times slower: they are flushed
    to zero.
    """
    torch.set_flush_denormal(True)
    try:
        with single_threaded(), kept_memory():
            yield
    finally:
        torch.set_flush_denormal(False)


def training_metadata(
    demonstrations: Demonstrations, dataset: Dataset, parameters: TrainingParameters
) -> dict[str, Any]:
    """Metadata of a learner: scenario, clock, evidence and training record."""
    record = {
        "parameters": parameters.to_json(),
        **data_record(demonstrations, dataset),
        "versions": {
            "torch": torch.__version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
    }
    return {
        "scenario": demonstrations.scenario,
        "clock": parameters.clock,
        "evidence": parameters.evidence,
        "training": record,
    }
