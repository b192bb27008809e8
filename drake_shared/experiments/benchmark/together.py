"""Training many learners in groups, compared with all in one product and with one after the other."""

from __future__ import annotations

from drake_shared.experiments.benchmark.common import Setup
from drake_shared.experiments.benchmark.results import GroupResult, Ratio
from drake_shared.experiments.benchmark.timing import Task, interleave, spread
from drake_shared.learners.cnmp.parameters import find_parameters
from drake_shared.learners.dataset import Dataset, make_dataset

IN_GROUPS, IN_ONE, ALONE = "in groups", "in one product", "one after the other"

_METHOD = (
    "CPU time on one thread of an iteration of the preset default, for each learner, without the preparation "
    "and the end of a training. Learners in groups are trained as by train_together."
)


def run(setup: Setup) -> GroupResult:
    """Runs the group."""
    from drake_shared.learners.cnmp.training import MAX_TOGETHER, fast_training

    count, iterations, repeats = (30, 2, 2) if setup.quick else (100, 6, 5)
    dataset = make_dataset(setup.route_demonstrations)
    sizes = {IN_GROUPS: MAX_TOGETHER, IN_ONE: count, ALONE: 1}
    tasks = {name: _iterations(dataset, size, iterations) for name, size in sizes.items()}
    with fast_training():
        whole = interleave(tasks, repeats=repeats, block=0.0)
    seconds = {name: values / (iterations * sizes[name]) for name, values in whole.items()}
    return GroupResult(
        name="together",
        method=_METHOD,
        ratios=[
            Ratio(
                name=f"{IN_ONE} / {IN_GROUPS}, {count} learners",
                spread=spread(seconds[IN_ONE] / seconds[IN_GROUPS]),
                aim="at least 1.2",
            ),
            Ratio(name=f"{ALONE} / {IN_GROUPS}", spread=spread(seconds[ALONE] / seconds[IN_GROUPS])),
        ],
        seconds={name: spread(values) for name, values in seconds.items()},
        details={"learners": count, "in a group": MAX_TOGETHER},
    )


def _iterations(dataset: Dataset, size: int, iterations: int) -> Task:
    """A task that runs iterations of ``size`` learners side by side, the same for all calls."""
    from drake_shared.learners.cnmp.optimization import Optimization

    parameters = find_parameters("default")
    training = Optimization([dataset] * size, parameters, list(range(size)))

    def run() -> None:
        for _ in range(iterations):
            training.step(1e-3, parameters.beta, 1.0)

    return run
