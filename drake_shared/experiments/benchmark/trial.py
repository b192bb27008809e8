"""Group 2: a trial of shared control compared with IR-SIM moving the same robot."""

from __future__ import annotations

from functools import partial

from drake_shared.experiments.benchmark.common import Setup
from drake_shared.experiments.benchmark.results import GroupResult, Ratio, make_ratio
from drake_shared.experiments.benchmark.timing import Task, interleave, spread
from drake_shared.learners import Learner
from drake_shared.scenario import Scenario
from drake_shared.simulation.config import blend_for
from drake_shared.simulation.trial import Simulation, TrialSettings

SHARED, HUMAN, IR_SIM = "drake_shared", "drake_shared, human alone", "IR-SIM"

_METHOD = (
    "A trial of all control steps of the two-obstacle task, in a fresh Context of a diagram built in "
    "advance, with a log and without a page: shared control, and the operator alone without a learner. "
    "IR-SIM (built in advance and reset) moves the same robot for as many steps past the same obstacles "
    "with collision checking, under given commands."
)


def whole_trials(scenario: Scenario, learner: Learner | None) -> Simulation:
    """Trials that last for the whole duration, so that all have the same number of steps."""
    preset = None if learner is None else learner.preset
    return Simulation(scenario, learner=learner, config=blend_for(preset, end="duration"))


def run(setup: Setup) -> GroupResult:
    """Runs the group."""
    scenario, learner = setup.scenario, setup.learner
    route = scenario.routes[0].name
    settings = TrialSettings(route=route)
    contenders: dict[str, Task] = {
        SHARED: partial(whole_trials(scenario, learner).run, settings),
        HUMAN: partial(whole_trials(scenario, None).run, settings),
    }
    absent: dict[str, str] = {}
    try:
        from drake_shared.experiments.benchmark.ir_sim import IrSim

        contenders[IR_SIM] = IrSim(scenario).run
    except ImportError as error:
        absent[IR_SIM] = f"ir-sim is not installed ({error})"
    seconds = interleave(contenders, repeats=setup.repeats, block=0.0)
    ratios = []
    if not absent:
        aims = {SHARED: "at most 1.5", HUMAN: ""}
        ratios += [make_ratio(seconds, name, IR_SIM, aim=aim) for name, aim in aims.items()]
    real_time = spread(scenario.duration / seconds[SHARED])
    ratios.append(Ratio(name="times real time", spread=real_time, aim="at least 150"))
    return GroupResult(
        name="trial",
        method=_METHOD,
        ratios=ratios,
        seconds={name: spread(values) for name, values in seconds.items()},
        absent=absent,
        details={"steps": scenario.steps, "learner": learner.name},
    )
