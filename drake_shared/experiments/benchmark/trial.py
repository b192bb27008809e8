"""Group 2: a trial of shared control against IR-SIM moving the robot alone, and where the time goes."""

from __future__ import annotations

import time
from functools import partial

import numpy as np

from drake_shared.experiments.benchmark.results import GroupResult, Ratio
from drake_shared.experiments.benchmark.system_times import LEARNER, SYSTEMS, SystemTimes, TimedLearner
from drake_shared.experiments.benchmark.test_tasks import Setting
from drake_shared.experiments.benchmark.timing import Task, interleave, ratio, spread
from drake_shared.learners import Learner
from drake_shared.simulation.trial import Simulation, TrialSettings

OURS = "drake_shared"
CONSTANT = "drake_shared, constant learner"
ALONE = "drake_shared, human alone"
IR_SIM = "IR-SIM"
IR_SIM_DASH = "IR-SIM, its own behaviour"

_METHOD = (
    "A trial of every control step of the two-obstacle task, in a fresh Context of a diagram built "
    "before, with a log and no page: shared control, the same with a learner that always answers the "
    "same, and the operator alone without a learner. IR-SIM (built before and reset) moves the same robot "
    "for as many steps beside the same obstacles, collisions checked, by given commands or by its own "
    "behaviour 'dash'. Where our time goes: the Python callbacks of each system are timed from within, "
    "each without what it asks others for; what is left over is Drake's own (Simulator, cache, crossing "
    "from C++ to Python, log). Setting up the Context and reading out the log are timed apart."
)


class ConstantLearner:
    """Answers what another learner answers at the start, whatever it is shown. A `Learner`."""

    name = "constant"

    def __init__(self, learner: Learner) -> None:
        self.preset = learner.preset
        self.confidence_gain = learner.confidence_gain
        self.grid, self.duration = learner.grid, learner.duration
        self.demonstrations, self.metadata = learner.demonstrations, learner.metadata
        positions = np.zeros((1, 2)) if learner.demonstrations is None else learner.demonstrations[0, :1]
        self._mean, self._variance = learner.predict(learner.grid[:1], positions, learner.grid)

    def predict(self, times, positions, query_times):
        """The last rows of the one answer, as many as there are queries."""
        first = len(self.grid) - len(query_times)
        return self._mean[first:].copy(), self._variance[first:].copy()


def run(setting: Setting) -> GroupResult:
    """Measures it."""
    scenario, learner = setting.scenario, setting.learner
    route = scenario.routes[0].name
    shared = TrialSettings(route=route, end="duration")
    alone = TrialSettings(route=route, end="duration", mode="human")
    ours = Simulation(scenario, learner=learner)
    constant = Simulation(scenario, learner=ConstantLearner(learner))
    nobody = Simulation(scenario)
    contenders: dict[str, Task] = {
        OURS: partial(ours.run, shared),
        CONSTANT: partial(constant.run, shared),
        ALONE: partial(nobody.run, alone),
    }
    absent: dict[str, str] = {}
    try:
        from drake_shared.experiments.benchmark.ir_sim import IrSim

        contenders[IR_SIM] = IrSim(scenario).run
        contenders[IR_SIM_DASH] = IrSim(scenario, dash=True).run
    except ImportError as error:
        absent[IR_SIM] = f"ir-sim is not installed ({error})"
    seconds = interleave(contenders, repeats=setting.repeats, block=0.0)
    ratios = []
    for other, aim in ((IR_SIM, "at most 1.5"), (IR_SIM_DASH, "")):
        for name in (OURS, CONSTANT, ALONE) if other in seconds else ():
            compared = ratio(seconds[name], seconds[other])
            ratios.append(Ratio(name=f"{name} / {other}", spread=compared, aim=aim if name == OURS else ""))
    real_time = spread(scenario.duration / seconds[OURS])
    ratios.append(Ratio(name="times real time", spread=real_time, aim="at least 150"))
    return GroupResult(
        name="trial",
        method=_METHOD,
        ratios=ratios,
        seconds={name: spread(values) for name, values in seconds.items()},
        absent=absent,
        details={
            "steps": scenario.steps,
            "learner": learner.name,
            "time_goes": where_time_goes(setting, per_step=float(np.median(seconds[OURS])) / scenario.steps),
        },
    )


def where_time_goes(setting: Setting, *, per_step: float) -> dict[str, dict[str, float]]:
    """The share of each part of a shared trial, and the CPU time a step that follows, in [us].

    Args:
        setting: Of the benchmark.
        per_step: CPU time of a trial that is not timed from within, by its number of steps, in [s].
    """
    times = SystemTimes()
    with times.in_systems():
        simulation = Simulation(setting.scenario, learner=TimedLearner(setting.learner, times))
    settings = TrialSettings(route=setting.scenario.routes[0].name, end="duration")
    simulation.run(settings)
    shares: dict[str, list[float]] = {}
    for _ in range(setting.repeats):
        times.clear()
        begun = time.perf_counter()
        running = simulation.begin(settings)
        began = time.perf_counter()
        first = sum(times.seconds.values())
        running.advance(setting.scenario.duration)
        advanced = time.perf_counter()
        inside = sum(times.seconds.values()) - first
        running.finish()
        ended = time.perf_counter()
        parts = {system.__name__: times.seconds[system.__name__] for system in SYSTEMS}
        parts[LEARNER] = times.seconds[LEARNER]
        parts["Drake and the log"] = advanced - began - inside
        parts["Context made ready"] = began - begun - first
        parts["log read out"] = ended - advanced
        for name, spent in parts.items():
            shares.setdefault(name, []).append(spent / (ended - begun))
    medians = {name: float(np.median(values)) for name, values in shares.items()}
    return {
        name: {"share": share, "microseconds_per_step": 1e6 * share * per_step}
        for name, share in sorted(medians.items(), key=lambda item: -item[1])
    }
