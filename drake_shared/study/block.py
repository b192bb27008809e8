"""The trials of a block, driven by a participant on the page, in a process of their own."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.framework import LeafSystem

from drake_shared.cockpit.drive import open_session
from drake_shared.cockpit.driver_lock import DriverLock
from drake_shared.cockpit.messages import Setup
from drake_shared.cockpit.trial_choices import TrialChoices
from drake_shared.common.errors import InputError
from drake_shared.learners import load_learner
from drake_shared.simulation.trial import Trial
from drake_shared.study.design import SHOWN
from drake_shared.study.steps import PRACTICE, Step, end_of_trials
from drake_shared.study.store import StudyData
from drake_shared.systems.mouse_input import MouseInput, MouseSample

COMPLETE = ("reached", "timed_out")
"""Status of trials that count; one that ended otherwise is driven again."""


class TimedSource:
    """A source of samples that records how old each is when it is first read for a command.

    Args:
        source: The driver lock.
        clock: That of the samples, in [s].
    """

    def __init__(self, source: DriverLock, clock: Callable[[], float] = time.monotonic) -> None:
        self._source = source
        self._clock = clock
        self._last = -np.inf
        self.ages: list[float] = []

    def latest(self) -> MouseSample:
        """The newest sample."""
        sample = self._source.latest()
        if sample.engaged and sample.arrival > self._last:
            self._last = sample.arrival
            self.ages.append(self._clock() - sample.arrival)
        return sample


class BlockChoices(TrialChoices):
    """What the protocol says of each trial: nothing can be chosen on the page."""

    def __init__(self, data: StudyData, step: Step) -> None:
        study, name = data.study, str(step.condition)
        file = study.learner_of(name)
        learner = None if file is None else load_learner(file)
        super().__init__(study.load_scenario(), learner, study.conditions[name].config, route=str(step.route))
        self._data = data
        self._participant = step.participant

    def choose(self, setup: Setup) -> bool:
        """Nothing can be chosen."""
        return False

    def next_trial(self) -> None:
        """Takes the route of the next trial."""
        following = self._data.next_step(self._participant)
        self.route = None if following is None else following.route


def run_block(
    folder: str,
    participant: str,
    *,
    host: str,
    port: int,
    proxy: str | None,
    simulated: bool,
    ping: float,
    back: str,
    pipe: Connection,
) -> None:
    """Serves the page for the trials of the participant's next block, and returns after the last.

    Args:
        folder: Of the study.
        participant: Whose next step is a trial.
        host, port, proxy: See `drake_shared.cockpit.drive.drive`.
        simulated: Whether the participant is.
        ping: Round-trip time of the participant's machine, in [s].
        back: Address of the participant's page, to which the page returns.
        pipe: Receives the address of the page; when its other end is closed, the session ends.
    """
    data = StudyData(Path(folder))
    first = data.next_step(participant)
    if first is None or first.kind != "trial":
        raise InputError(folder, participant, "must have a trial as the next step")
    end = end_of_trials(data.steps[participant], first)
    # Ctrl-C reaches every process of a terminal; the server ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    interrupted = threading.Event()
    threading.Thread(target=_wait_for_end, args=(pipe, interrupted), daemon=True).start()
    timed: list[TimedSource] = []

    def make_mouse(lock: DriverLock) -> LeafSystem:
        timed.append(TimedSource(lock))
        return MouseInput(robot=choices.scenario.robot, source=timed[0])

    def on_trial(trial: Trial) -> bool:
        step, ages = data.next_step(participant), list(timed[0].ages)
        timed[0].ages.clear()  # A trial that cannot be written is driven again.
        if step is not None and trial.status in COMPLETE:
            measured = _timing(trial, ages, ping)
            data.write_trial(step, trial, simulated=simulated, measured=measured)
        else:
            text = f"a trial ended as {trial.status} and is driven again"
            data.note(participant, text, simulated=simulated)
        following = data.next_step(participant)
        over = following is None or following.index >= end
        session.server.publish("study", _announcement(data, following, back if over else None))
        return over

    choices = BlockChoices(data, first)
    with open_session(
        choices.scenario,
        choices.learner,
        operator=make_mouse,
        config=choices.config,
        host=host,
        port=port,
        proxy=proxy,
        interrupted=interrupted,
        report=lambda _: None,
        choices=choices,
        on_trial=on_trial,
    ) as session:
        session.server.publish("study", _announcement(data, first, None))
        with contextlib.suppress(OSError):  # The server has ended meanwhile.
            pipe.send(session.server.address)
        session.run()


def _announcement(data: StudyData, step: Step | None, back: str | None) -> dict[str, Any]:
    """What the page shows of the study: the trial, what is hidden, and where to go when the block is over."""
    if step is None or step.kind != "trial":
        return {"text": "", "hidden": [], "back": back}
    condition = data.study.conditions[str(step.condition)]
    # Who drives alone has no agent to see.
    alone = condition.config.driver == "human"
    hidden = [name for name in SHOWN if alone or not condition.page.get(name, True)]
    count = data.study.practice if step.block == PRACTICE else data.study.trials
    what = "Practice" if step.block == PRACTICE else f"Block {step.block}"
    text = f"{what}, trial {step.trial} of {count}: drive along the route that is drawn."
    return {"text": text, "hidden": hidden, "back": back}


def _timing(trial: Trial, ages: list[float], ping: float) -> dict[str, float | None]:
    """Latency from the event to the command, in [s], as half the round trip and the wait of the sample."""
    steps = max(1, len(trial["t"]) - 1)
    late = trial.metadata["real_time"]["late_steps"] / steps
    if not ages:
        return {"latency_p50": None, "latency_p99": None, "late_share": late, "ping": ping}
    p50, p99 = (float(np.percentile(ages, share)) + ping / 2.0 for share in (50, 99))
    return {"latency_p50": p50, "latency_p99": p99, "late_share": late, "ping": ping}


def _wait_for_end(pipe: Connection, interrupted: threading.Event) -> None:
    with contextlib.suppress(EOFError, OSError):
        pipe.recv()
    interrupted.set()
