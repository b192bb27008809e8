"""The data of a study on disk: one file for each completed step, written once and never changed."""

from __future__ import annotations

import contextlib
import datetime
import itertools
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.common.files import check_writable, created_once
from drake_shared.simulation.log import Trial, read_log, write_log
from drake_shared.study.protocol import open_planned
from drake_shared.study.steps import Step, participants_of, steps_of

DATA = "data"
WITHDRAWN, EXCLUDED = "withdrawn", "excluded"
"""Names of the files that end a participant's part before its last step, with the reason."""


class StudyData:
    """The data of a study, ``data/PARTICIPANT/STEP.parquet`` for trials and ``.json`` for all else.

    A step is complete if its file exists. Files are linked into their place when they are whole: a killed
    process or a full disk leaves no part of one, and no step is written twice.

    Args:
        folder: Of the study, with its protocol.

    Raises:
        InputError: There is no protocol, the study has changed since, or the folder cannot be written to.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.study, self.protocol = open_planned(folder)
        self._hashes = {self.protocol["hash"], *(item["from"] for item in self.protocol["amendments"])}
        self.steps = {name: steps_of(self.study, name) for name in participants_of(self.study)}
        check_writable(folder / DATA)

    def check_kind(self, *, simulated: bool) -> None:
        """Checks that a study has either people or simulated participants.

        Raises:
            InputError: The data are of the other kind.
        """
        for path in sorted((self.folder / DATA).glob("P*/*.json")):
            if bool(self._read(path).get("simulated")) != simulated:
                other = "people" if simulated else "simulated participants"
                raise InputError(path, "", f"holds data of {other}: use another folder for this run")
            return

    def next_step(self, participant: str) -> Step | None:
        """The first step that is not complete; None if there is none, or the participant's part has ended."""
        if self.ended(participant) is not None:
            return None
        done = self._names(participant)
        return next((step for step in self.steps[participant] if step.name not in done), None)

    def completed(self, participant: str) -> list[Step]:
        """The steps that are complete, in order."""
        done = self._names(participant)
        return [step for step in self.steps[participant] if step.name in done]

    def ended(self, participant: str) -> dict[str, Any] | None:
        """Why a participant's part ended early: ``kind`` (withdrawn or excluded) and ``reason``."""
        for kind in (EXCLUDED, WITHDRAWN):
            path = self._path(participant, f"{kind}.json")
            if path.is_file():
                return {"kind": kind, **self._read(path)}
        return None

    def write_trial(
        self, step: Step, trial: Trial, *, simulated: bool = False, measured: Mapping[str, Any] | None = None
    ) -> None:
        """Writes the log of a trial, with the entry ``study`` in its metadata.

        Args:
            step: The trial's.
            trial: Its log.
            simulated: Whether the participant is.
            measured: Further fields of the entry, such as the latency.

        Raises:
            InputError: The step was completed before.
            RunError: The file cannot be written.
        """
        entry = self._entry(step, simulated) | dict(measured or {})
        whole = Trial(columns=trial.columns, metadata={**trial.metadata, "study": entry})
        with created_once(self._path(step.participant, f"{step.name}.parquet")) as temporary:
            write_log(whole, temporary)

    def write_answers(self, step: Step, answers: Mapping[str, Any], *, simulated: bool = False) -> None:
        """Writes the answers of a step that is no trial; see `write_trial`."""
        self._write_json(step.participant, step.name, self._entry(step, simulated) | {"answers": answers})

    def end(self, participant: str, kind: str, reason: str, *, simulated: bool = False) -> None:
        """Ends the part of a participant, who withdraws or is excluded, for a reason."""
        entry = {"participant": participant, "simulated": simulated, "reason": reason}
        self._write_json(participant, kind, entry)

    def note(self, participant: str, text: str, *, simulated: bool = False) -> None:
        """Adds a note of the experimenter."""
        entry = {"participant": participant, "simulated": simulated, "note": text}
        # Numbered, not timed: the clock may be set back, and another process may add a note at once.
        for number in itertools.count(1 + len(self.notes(participant))):
            with contextlib.suppress(InputError):
                self._write_json(participant, f"note_{number:04d}", entry)
                return

    def notes(self, participant: str) -> list[str]:
        """The experimenter's notes, the oldest first."""
        found = sorted(self._path(participant, "").glob("note_*.json"))
        return [self._read(path)["note"] for path in found]

    def trials(self) -> Iterator[tuple[Step, Trial]]:
        """All trials, by participant and step.

        Raises:
            InputError: A log is of another study or step.
        """
        for step, path in self._files("parquet"):
            trial = read_log(path)
            self._check(step, trial.metadata.get("study"), path)
            yield step, trial

    def answers(self) -> Iterator[tuple[Step, dict[str, Any]]]:
        """The answers of all questionnaires, by participant and step; see `trials`."""
        for step, path in self._files("json"):
            entry = self._read(path)
            self._check(step, entry, path)
            if step.questionnaire is not None:
                yield step, entry["answers"]

    def _files(self, suffix: str) -> Iterator[tuple[Step, Path]]:
        known = {(step.participant, step.name): step for steps in self.steps.values() for step in steps}
        ends = (WITHDRAWN, EXCLUDED)
        for path in sorted((self.folder / DATA).glob(f"P*/*.{suffix}")):
            step = known.get((path.parent.name, path.stem))
            if step is not None:
                yield step, path
            elif path.stem not in ends and not path.stem.startswith("note_"):
                raise InputError(path, "", "is not a step of this study: move it out of the folder")

    def _check(self, step: Step, entry: Any, path: Path) -> None:
        if not isinstance(entry, dict) or entry.get("study") != self.study.name:
            raise InputError(path, "study", f"must be {self.study.name!r}: data of another study")
        if (entry.get("participant"), entry.get("step")) != (step.participant, step.name):
            raise InputError(path, "step", f"must be {step.participant} {step.name}: the file was renamed")
        if entry.get("protocol") not in self._hashes:
            raise InputError(path, "protocol", "must be one of this study's: data of another protocol")

    def _entry(self, step: Step, simulated: bool) -> dict[str, Any]:
        return {
            "study": self.study.name,
            "protocol": self.protocol["hash"],
            "participant": step.participant,
            "step": step.name,
            "condition": step.condition,
            "place": step.place,
            "block": step.block,
            "trial": step.trial,
            "route": step.route,
            "simulated": simulated,
        }

    def _names(self, participant: str) -> set[str]:
        return {path.stem for path in self._path(participant, "").glob("*.*") if path.name[0] != "."}

    def _path(self, participant: str, name: str) -> Path:
        return self.folder / DATA / participant / name

    def _write_json(self, participant: str, name: str, entry: Mapping[str, Any]) -> None:
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
        with created_once(self._path(participant, f"{name}.json")) as temporary:
            temporary.write_text(json.dumps({**entry, "time": now}, indent=1) + "\n", encoding="utf-8")

    @staticmethod
    def _read(path: Path) -> dict[str, Any]:
        try:
            found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(path, "", f"cannot be read ({error})") from error
        return found
