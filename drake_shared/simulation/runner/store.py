"""Stores of results: a description of the run, and one JSON file for each completed task."""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

from drake_shared.common.errors import DrakeSharedError, InputError, RunError
from drake_shared.common.files import check_writable, replacing
from drake_shared.simulation.runner.identity import first_difference, identity
from drake_shared.simulation.runner.tasks import Task, as_json, canonical

FORMAT = "drake_shared run"
FORMAT_VERSION = 1
RUN = "run.json"
RESULTS = "results"
KEPT = "completed results are kept, and --resume continues from them"
OVERWRITE = "use --force to overwrite, or another folder"

# Temporary files of replacing(), which a killed process leaves, are called .run.json.k3v9x2ab and the like.
_OUR_RUN = re.compile(r"run\.json|\.run\.json\.\w+")
_OUR_RESULT = re.compile(r"[0-9a-f]{24}\.json|\.[0-9a-f]{24}\.json\.\w+")


class ResultStore(Protocol):
    """Keeps the values of completed tasks."""

    def read(self, task: Task) -> Any:
        """The value of a completed task.

        Raises:
            KeyError: It is not completed, or its file is damaged.
            InputError: Its file belongs to another run.
        """

    def write(self, task: Task, text: str) -> Any:
        """Keeps the value of a task, given as JSON, and returns what `read` will return.

        Raises:
            RunError: It cannot be written.
        """


class JsonStore:
    """The results of one run in a folder; made by `open`.

    ``run.json`` describes the run and the code that computes it; ``results/KEY.json`` holds function,
    arguments and value of the task with that key. Every file is written atomically.

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
    ) -> JsonStore:
        """Starts a run in an empty or new folder, or resumes the one in it.

        Args:
            folder: Created if it does not exist.
            description: JSON-serializable description of all that determines the results: settings, seeds,
                digests of files.
            resume: Resume the same run, if there is one.
            force: Overwrite the run in the folder; only files that a store wrote are removed.

        Raises:
            InputError: The folder is not empty and neither ``resume`` nor ``force`` is set, it holds another
                run or results of other code, or it cannot be written to; or both are set.
            RunError: The disk is full.
        """
        check_resume_or_force(folder, resume=resume, force=force)
        store = cls(folder)
        check_writable(folder)
        described = {"description": json.loads(as_json(description)), "package": identity()}
        with accessing(folder):
            if force:
                store._clear()
            occupied = not force and store._is_occupied()
        if occupied:
            if not resume:
                choice = "use --force to start a run beside its files"
                if (store.folder / RUN).exists():
                    choice = "use --resume to resume the run in it, --force to overwrite that run"
                raise InputError(folder, "", f"must be empty: {choice}, or another folder")
            store._check(described)
            return store
        head = {"format": FORMAT, "format_version": FORMAT_VERSION, **described}
        with replacing(store.folder / RUN) as temporary:
            temporary.write_text(json.dumps(head, indent=2) + "\n", encoding="utf-8")
        return store

    def read(self, task: Task) -> Any:
        """See `ResultStore.read`."""
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
        """See `ResultStore.write`."""
        head = f'"function":{canonical(task.function)},"arguments":{canonical(task.arguments)}'
        with self.writing(), replacing(self._path(task)) as temporary:
            temporary.write_text(f'{{{head},"value":{text}}}\n', encoding="utf-8")
        return json.loads(text)

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Reports errors of writing to the folder as failures of the run.

        Raises:
            RunError: The disk is full, or the folder was removed or can no longer be written to.
        """
        if not (self.folder / RUN).is_file():
            raise RunError(f"{self.folder}: {RUN} was removed during the run")
        try:
            yield
        except DrakeSharedError as error:
            raise RunError(f"{error}; {KEPT}") from error

    def _path(self, task: Task) -> Path:
        return self._results / f"{task.key}.json"

    def _is_occupied(self) -> bool:
        """Whether the folder holds more than temporary files of a killed process."""
        return any(path.name == RUN or not _OUR_RUN.fullmatch(path.name) for path in self.folder.iterdir())

    def _check(self, described: dict[str, Any]) -> None:
        run = self.folder / RUN
        try:
            there = json.loads(run.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise InputError(self.folder, "", f"must hold a run to be resumed; {OVERWRITE}") from None
        except (OSError, ValueError) as error:
            raise InputError(run, "", f"must be readable ({type(error).__name__}); {OVERWRITE}") from error
        if not isinstance(there, dict) or (there.get("format"), there.get("format_version")) != (
            FORMAT,
            FORMAT_VERSION,
        ):
            raise InputError(run, "format", f"must be {FORMAT!r} version {FORMAT_VERSION}; {OVERWRITE}")
        for name, what in (("description", "the same run"), ("package", "results of the same code")):
            if canonical(there.get(name)) != canonical(described[name]):
                differs = first_difference(there.get(name), described[name])
                raise InputError(self.folder, "", f"must hold {what} to be resumed: {differs}; {OVERWRITE}")

    def _clear(self) -> None:
        # First the description: if the process is killed here, no result is taken for one of the next run.
        for path in [path for path in self.folder.iterdir() if _OUR_RUN.fullmatch(path.name)]:
            path.unlink()
        if not self._results.is_dir():
            return
        for path in self._results.iterdir():
            if _OUR_RESULT.fullmatch(path.name):
                path.unlink()
        if not any(self._results.iterdir()):
            self._results.rmdir()


def check_resume_or_force(folder: str | os.PathLike[str], *, resume: bool, force: bool) -> None:
    """Refuses both options together.

    Raises:
        InputError: Both are set.
    """
    if resume and force:
        raise InputError(folder, "", "must be resumed or overwritten (--resume or --force), not both")


@contextlib.contextmanager
def accessing(folder: str | os.PathLike[str]) -> Iterator[None]:
    """Reports an OSError as bad input that names the folder.

    Raises:
        InputError: The body raised an OSError.
    """
    try:
        yield
    except OSError as error:
        raise InputError(folder, "", f"must be a folder to read and write ({error.strerror})") from error
