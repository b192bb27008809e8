"""How often the 95% intervals of fitted operators contain the truth. Usage: fit_coverage.py [FITS [SEED]]

Each fit is from ten trials of the same known operator in shared control, with seeds of its own.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy import stats
from tqdm import tqdm

from drake_shared.analysis.operator_fit import fit_operator
from drake_shared.common.threads import limit_threads
from drake_shared.learners import load_learner
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import load_scenario
from drake_shared.simulation.lockstep.engine import Lockstep
from drake_shared.simulation.trial import Simulation, TrialSettings

TRIALS = 10
TRUTH = Behaviour(skill=0.6, delay=0.137, noise=0.3, noise_time=0.5, yielding=0.5)
PARAMETERS = ("skill", "delay", "noise", "noise_time", "yielding")


def main() -> None:
    limit_threads()
    given = [int(text) for text in sys.argv[1:]]
    count, seed = [*given, *(200, 1)[len(given) :]]
    simulation = Simulation(load_scenario("two_obstacles"), learner=load_learner("two_obstacles"))
    routes = [route.name for route in simulation.scenario.routes]
    found: dict[str, list[tuple[float, bool]]] = {name: [] for name in PARAMETERS}
    for number in tqdm(range(count), unit="fit", disable=None):
        settings = [
            TrialSettings(
                seed=1_000_000 * seed + 1000 * number + index,
                route=routes[index % len(routes)],
                behaviour=TRUTH,
            )
            for index in range(TRIALS)
        ]
        fit = fit_operator(list(Lockstep(simulation).run(settings)))
        for name, values in found.items():
            estimate = getattr(fit, name)
            values.append((estimate.value, estimate.low <= getattr(TRUTH, name) <= estimate.high))
    for name, values in found.items():
        estimates, covered = np.array(values).T
        low, high = stats.binomtest(int(covered.sum()), count).proportion_ci(0.95)
        error = estimates - getattr(TRUTH, name)
        print(
            f"{name:10s}  covered {covered.mean():.1%} [{low:.1%}, {high:.1%}]"
            f"  bias {error.mean():+.4f}  standard deviation {error.std(ddof=1):.4f}"
        )


if __name__ == "__main__":
    main()
