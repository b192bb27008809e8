"""Kills the writer of a study's data at random moments, and counts what is lost: kills.py [KILLS [SEED]]

A process takes 24 simulated participants through a study whose trials were simulated before, and is killed by
SIGKILL after a random time, again and again. Every step must then be there once, whole, and those that the
writer had finished before a kill must have been there after it.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

import yaml
from conftest import STUDY

from drake_shared.simulation.log import Trial
from drake_shared.study.protocol import plan
from drake_shared.study.simulated import run_steps, simulated_behaviours, simulation_of
from drake_shared.study.steps import Step
from drake_shared.study.store import StudyData

PARTICIPANTS = 24


def write_all(folder: Path, trials: dict[Step, Trial], finished: int) -> None:
    """Completes all steps; tells each finished one through the pipe."""
    data = StudyData(folder)
    for name in data.steps:
        while (step := data.next_step(name)) is not None:
            if step.kind == "trial":
                data.write_trial(step, trials[step], simulated=True)
            else:
                data.write_answers(step, {}, simulated=True)
            os.write(finished, f"{name}/{step.name}\n".encode())


def main() -> None:
    given = [int(text) for text in sys.argv[1:]]
    kills, seed = [*given, *(200, 1)[len(given) :]]
    draw = random.Random(seed)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "study.yaml").write_text(yaml.safe_dump(STUDY | {"participants": PARTICIPANTS}))
        plan(folder)
        data = StudyData(folder)
        steps = [step for own in data.steps.values() for step in own if step.kind == "trial"]
        behaviours = simulated_behaviours(PARTICIPANTS, seed=1)
        each = [behaviours[int(step.participant[1:]) - 1] for step in steps]
        trials = dict(zip(steps, run_steps(simulation_of(data.study, "plain"), steps, each), strict=True))
        reported: list[str] = []
        for count in range(kills + 1):
            reader, writer = os.pipe()
            child = os.fork()
            if child == 0:
                write_all(folder, trials, writer)
                os._exit(0)
            os.close(writer)
            if count < kills:
                time.sleep(draw.expovariate(20.0))
                os.kill(child, signal.SIGKILL)
            with os.fdopen(reader) as pipe:
                reported += pipe.read().split()
            os.waitpid(child, 0)
            there = {f"{path.parent.name}/{path.stem}" for path in folder.glob("data/*/[!.]*.*")}
            lost = set(reported) - there
            if lost:
                sys.exit(f"lost: {sorted(lost)}")
        assert len(reported) == len(set(reported)), "a step was written twice"
        wanted = {f"{step.participant}/{step.name}" for own in data.steps.values() for step in own}
        assert there == wanted, "steps are missing"
        assert len(list(data.trials())) == len(steps)
        print(f"{kills} kills: all {len(wanted)} steps are there once, {len(steps)} trials are whole")


if __name__ == "__main__":
    main()
