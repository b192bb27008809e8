"""Group 5: many trials in lock-step compared with the Drake diagram, and with IR-SIM moving the robot."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from drake_shared.analysis.metrics import metrics
from drake_shared.experiments.benchmark.common import Setup
from drake_shared.experiments.benchmark.results import GroupResult, Ratio
from drake_shared.experiments.benchmark.timing import Task, interleave, spread
from drake_shared.simulation.config import blend_for
from drake_shared.simulation.lockstep.engine import Lockstep
from drake_shared.simulation.trial import Simulation, TrialSettings

ENGINE, DRAKE, WITH_METRICS, DRAKE_WITH_METRICS, IR_SIM = (
    "lock-step",
    "Drake",
    "lock-step with metrics",
    "Drake with metrics",
    "IR-SIM",
)

_METHOD = (
    "Trials to the goal of the two-obstacle task, with the shipped learner: all of them in lock-step, in "
    "blocks, and a few one after the other in the Drake diagram, whose times do not depend on their number. "
    "Times are those of one trial, with and without its metrics; no logs are written. IR-SIM moves the same "
    "robot for all control steps of the task, which are more than those to the goal."
)


def run(setup: Setup) -> GroupResult:
    """Runs the group."""
    scenario, learner = setup.scenario, setup.learner
    count, few, repeats = (20, 3, 1) if setup.quick else (1_000, 12, 5)
    simulation = Simulation(scenario, learner=learner, config=blend_for(learner.preset))
    routes = [route.name for route in scenario.routes]
    settings = [TrialSettings(route=routes[seed % len(routes)], seed=seed) for seed in range(count)]
    engine = Lockstep(simulation)
    # A multiple of the routes: the mean over few trials is that over all.
    contenders: dict[str, Task] = {
        ENGINE: lambda: _ignore(engine.run(settings)),
        DRAKE: lambda: _ignore(map(simulation.run, settings[:few])),
        WITH_METRICS: lambda: _ignore(map(metrics, engine.run(settings))),
        DRAKE_WITH_METRICS: lambda: _ignore(metrics(simulation.run(item)) for item in settings[:few]),
    }
    numbers = {ENGINE: count, DRAKE: few, WITH_METRICS: count, DRAKE_WITH_METRICS: few, IR_SIM: 1}
    absent: dict[str, str] = {}
    try:
        from drake_shared.experiments.benchmark.ir_sim import IrSim

        contenders[IR_SIM] = IrSim(scenario).run
    except ImportError as error:
        absent[IR_SIM] = f"ir-sim is not installed ({error})"
    whole = interleave(contenders, repeats=repeats, block=0.0)
    seconds = {name: values / numbers[name] for name, values in whole.items()}
    ratios = [
        Ratio(
            name=f"{DRAKE} / {ENGINE}, {count} trials",
            spread=spread(seconds[DRAKE] / seconds[ENGINE]),
            aim="at least 15",
        ),
        Ratio(
            name=f"{DRAKE_WITH_METRICS} / {WITH_METRICS}, {count} trials",
            spread=spread(seconds[DRAKE_WITH_METRICS] / seconds[WITH_METRICS]),
            aim="at least 12",
        ),
    ]
    if not absent:
        ratios.append(
            Ratio(
                name=f"{WITH_METRICS} / {IR_SIM}",
                spread=spread(seconds[WITH_METRICS] / seconds[IR_SIM]),
                aim="at most 0.25",
            )
        )
    return GroupResult(
        name="lockstep",
        method=_METHOD,
        ratios=ratios,
        seconds={name: spread(values) for name, values in seconds.items()},
        absent=absent,
        details={"trials": count, "trials in Drake": few},
    )


def _ignore(results: Iterable[Any]) -> None:
    for _ in results:
        pass
