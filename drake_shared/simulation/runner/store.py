"""A folder of results: what run they are of, and one file for each task that is done."""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from drake_shared.common.errors import DrakeSharedError, InputError, RunError
from drake_shared.common.files import check_writable, replacing
from drake_shared.simulation.runner.identity import difference, first_difference, identity
from drake_shared.simulation.runner.tasks import Task, as_json, canonical

FORMAT = "drake_shared run"
FORMAT_VERSION = 1
RUN = "run.json"
RESULTS = "results"
KEPT = "what is complete is kept, and --resume goes on from it"

# What replacing() leaves of a file when its process is killed has a name like .run.json.k3v9x2ab.
_OUR_RUN = re.compile(r"run\.json|\.run\.json\.\w+")
_OUR_RESULT = re.compile(r"[0-9a-f]{24}\.json|\.[0-9a-f]{24}\.json\.\w+")


class Store:
    """The results of one run in a folder; made by `open`.

    ``run.json`` says what the run is and which code made it; ``results/KEY.json`` holds function, arguments
    and value of the task with that key. Every file is whole or not there.

    Attributes:
        folder: Where they are.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        self._results = self.folder / RESULTS

    @classmethod
    def open(
        cls,
        folder: str | os.PathLike[str],
        description: dict[str, Any],
        *,
        resume: bool = False,
        force: bool = False,
    ) -> Store:
        """Begins a run in an empty or new folder, or goes on with the one that is there.

        Args:
            folder: Made if it is not there.
            description: What decides the results, of what JSON can say: settings, seeds, digests of files.
            resume: Go on with the same run, if one was begun.
            force: Begin anew where there is something already; of that, only what a store wrote is removed.

        Raises:
            InputError: The folder holds something and neither was asked for, holds another run or results of
                other code, or cannot be written to; or both were asked for.
            RunError: The disk is full.
        """
        if resume and force:
            raise InputError(folder, "", "must be resumed or begun anew (--resume or --force), not both")
        store = cls(folder)
        check_writable(folder)
        described = {"description": json.loads(as_json(description)), "package": identity()}
        try:
            if force:
                store._clear()
            occupied = not force and store._content()
        except OSError as error:
            raise InputError(folder, "", f"must be a folder to read and write ({error.strerror})") from error
        if occupied:
            if not resume:
                ways = "--force to begin a run beside what is there"
                if (store.folder / RUN).exists():
                    ways = "--resume to go on with the run that is there, --force to begin anew in its place"
                raise InputError(folder, "", f"must be empty: give {ways}, or another folder")
            store._check(described)
            return store
        head = {"format": FORMAT, "format_version": FORMAT_VERSION, **described}
        with replacing(store.folder / RUN) as temporary:
            temporary.write_text(json.dumps(head, indent=2) + "\n", encoding="utf-8")
        return store

    def read(self, task: Task) -> Any:
        """The value of a task that is done.

        Raises:
            KeyError: It is not, or its file does not hold it (a machine that lost its power may leave that).
        """
        try:
            record = json.loads(self._path(task).read_text(encoding="utf-8"))
            if canonical([record["function"], record["arguments"]]) == canonical(
                [task.function, task.arguments]
            ):
                return record["value"]
        except (OSError, ValueError, KeyError, TypeError):
            pass
        raise KeyError(task.key)

    def write(self, task: Task, text: str) -> Any:
        """Keeps the value of a task, given as JSON, and returns what will be read.

        Raises:
            RunError: The disk is full, or the folder is gone or no longer to be written to.
        """
        head = f'"function":{canonical(task.function)},"arguments":{canonical(task.arguments)}'
        with self.writing(), replacing(self._path(task)) as temporary:
            temporary.write_text(f'{{{head},"value":{text}}}\n', encoding="utf-8")
        return json.loads(text)

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Has what its body writes to the folder fail as a run does; where no run is any more, nothing is.

        Raises:
            RunError: The disk is full, or the folder is gone or no longer to be written to.
        """
        if not (self.folder / RUN).is_file():
            raise RunError(f"{self.folder}: {RUN} was removed while the run was on")
        try:
            yield
        except DrakeSharedError as error:
            raise RunError(f"{error}; {KEPT}") from error

    def _path(self, task: Task) -> Path:
        return self._results / f"{task.key}.json"

    def _content(self) -> bool:
        """Whether anything but the remains of a file half written is there."""
        return any(path.name == RUN or not _OUR_RUN.fullmatch(path.name) for path in self.folder.iterdir())

    def _check(self, described: dict[str, Any]) -> None:
        run = self.folder / RUN
        anew = "give --force to begin anew, or another folder"
        try:
            there = json.loads(run.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise InputError(self.folder, "", f"must hold a run to be resumed; {anew}") from None
        except (OSError, ValueError) as error:
            raise InputError(run, "", f"must be readable ({type(error).__name__}); {anew}") from error
        if not isinstance(there, dict) or (there.get("format"), there.get("format_version")) != (
            FORMAT,
            FORMAT_VERSION,
        ):
            raise InputError(run, "format", f"must be {FORMAT!r} version {FORMAT_VERSION}; {anew}")
        if canonical(there.get("description")) != canonical(described["description"]):
            differs = first_difference(there.get("description"), described["description"])
            raise InputError(self.folder, "", f"must hold the same run to be resumed: {differs}; {anew}")
        if differs := difference(there.get("package"), described["package"]):
            raise InputError(
                self.folder, "", f"must hold results of the same code to be resumed: {differs}; {anew}"
            )

    def _clear(self) -> None:
        ours = [path for path in self.folder.iterdir() if _OUR_RUN.fullmatch(path.name)]
        # Without its description a result cannot be taken for one of the next run, if we are killed here.
        for path in ours:
            path.unlink()
        if not self._results.is_dir():
            return
        for path in self._results.iterdir():
            if _OUR_RESULT.fullmatch(path.name):
                path.unlink()
        if not any(self._results.iterdir()):
            self._results.rmdir()
