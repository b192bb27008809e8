"""The rows of a trial under way, kept within half a second, whatever ends the process.

A journal lies beside the log that it becomes: an Arrow IPC stream, to which rows are appended. The one who
writes it holds a lock on it, so that `recover_trials` knows a journal that nobody writes any more.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import queue
import threading
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from drake_shared.common.errors import RunError
from drake_shared.common.files import check_writable, numbered
from drake_shared.demonstrations import METADATA_KEY
from drake_shared.simulation.log import Trial, write_log

INTERRUPTED = "interrupted"
"""Status of a trial during which the program was asked to end, or ended."""

_SUFFIX = ".journal"
_CHECKSUM = b"crc32"

Columns = Mapping[str, NDArray[Any]]


class Journal:
    """Keeps the rows of one trial, and becomes its log.

    A thread of its own writes, since a disk may take longer than a control step. What is written survives the
    end of the process; a second thread makes it survive a power failure, which on a slow disk takes longer.
    What cannot be written, on a full disk for example, is left to :meth:`finish`, which reports it.

    Args:
        folder: Of the log; created if it does not exist.
        name: Of the log, without suffix; a number is appended if there is a log or journal of that name.
        metadata: Of the trial so far.

    Raises:
        InputError: The folder cannot be written to.
        RunError: The file cannot be created.
    """

    def __init__(self, folder: Path, name: str, metadata: Mapping[str, Any]) -> None:
        check_writable(folder)
        self._metadata = dict(metadata)
        self._file, self._path = _reserve(folder, name)
        self.log_path = self._path.with_suffix(".parquet")
        """Where :meth:`finish` writes the log."""
        self._rows: queue.SimpleQueue[Columns | None] = queue.SimpleQueue()
        self._written = threading.Event()
        self._closed = False
        self._threads = [
            threading.Thread(target=work, name="journal", daemon=True) for work in (self._write, self._sync)
        ]
        for thread in self._threads:
            thread.start()

    def append(self, rows: Columns) -> None:
        """Adds rows: of every column the values since those of the last call. Does not wait for the disk."""
        self._rows.put(rows)

    def finish(self, trial: Trial) -> Path:
        """Writes the log, durably, and removes the journal.

        Raises:
            InputError: The folder cannot be written to.
            RunError: The log cannot be written; the journal stays.
        """
        self.close()
        write_log(trial, self.log_path, durable=True)
        self._path.unlink(missing_ok=True)
        return self.log_path

    def discard(self) -> None:
        """Removes the journal, because the trial is kept in another file."""
        self.close()
        self._path.unlink(missing_ok=True)

    def close(self) -> None:
        """Ends the writing; the next `recover_trials` makes a log of a journal that is still there."""
        self._rows.put(None)
        for thread in self._threads:
            thread.join()
        with contextlib.suppress(OSError):  # What is left in the buffer may not fit on the disk.
            self._file.close()

    def _sync(self) -> None:
        while self._written.wait() and not self._closed:
            self._written.clear()
            with contextlib.suppress(OSError):  # Writing fails too then.
                os.fsync(self._file.fileno())

    def _write(self) -> None:
        stream: pa.ipc.RecordBatchStreamWriter | None = None
        failed = False
        while (rows := self._rows.get()) is not None:
            if failed:
                continue
            try:
                batch = pa.RecordBatch.from_pydict(dict(rows))
                if stream is None:
                    described = {METADATA_KEY: json.dumps(self._metadata)}
                    stream = pa.ipc.new_stream(self._file, batch.schema.with_metadata(described))
                stream.write_batch(batch, custom_metadata={_CHECKSUM: str(_checksum(batch))})
                self._file.flush()
                self._written.set()
            except (OSError, pa.ArrowException):
                failed = True
        self._closed = True
        self._written.set()


def load_writer() -> None:
    """Loads what writing needs, so that the first rows of the first trial do not wait for it.

    pyarrow imports pandas, where that is installed, at its first conversion of an array.
    """
    pa.RecordBatch.from_pydict({"t": np.zeros(1)})


def recover_trials(folder: Path) -> list[Path]:
    """Makes logs of the journals that ended processes left in a folder, with the status "interrupted".

    Returns:
        The logs. A journal without rows is removed.

    Raises:
        RunError: A log cannot be written; its journal stays.
    """
    logs = []
    for path in sorted(folder.glob(f"*{_SUFFIX}")):
        with contextlib.suppress(FileNotFoundError), open(path, "rb") as file:
            if not _lock(file):
                continue  # Its trial is under way, in another process.
            log = path.with_suffix(".parquet")
            trial = _read(file)
            if trial is not None and not log.exists():
                write_log(trial, log, durable=True)
                logs.append(log)
            path.unlink(missing_ok=True)
    return logs


def _reserve(folder: Path, name: str) -> tuple[BinaryIO, Path]:
    """Creates a journal, locked, of whose name there is neither a log nor a journal."""
    for own in numbered(name):
        path = folder / f"{own}{_SUFFIX}"
        try:
            file = open(path, "xb")  # noqa: SIM115 (Journal.close closes it)
        except FileExistsError:
            continue
        except OSError as error:
            raise RunError(f"{path}: cannot be written ({os.strerror(error.errno or 0)})") from error
        # A process that recovers journals may have seen the file before it was locked, and removed it.
        if _lock(file) and os.fstat(file.fileno()).st_nlink:
            if not path.with_suffix(".parquet").exists():
                return file, path
            path.unlink()
        file.close()
    raise AssertionError("the names do not end")


def _lock(file: BinaryIO) -> bool:
    """Locks a file until it is closed or the process ends; False if another process has locked it."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _checksum(batch: pa.RecordBatch) -> int:
    return zlib.crc32(b"".join(column.to_numpy(zero_copy_only=False).tobytes() for column in batch.columns))


def _read(file: BinaryIO) -> Trial | None:
    """The trial of a journal as far as it was written; None without a row."""
    batches: list[pa.RecordBatch] = []
    metadata: Any = None
    # The end of the file may be cut off anywhere, or consist of zeros after a power failure.
    with contextlib.suppress(pa.ArrowException, OSError, ValueError, StopIteration):
        stream = pa.ipc.open_stream(file)
        metadata = json.loads((stream.schema.metadata or {}).get(METADATA_KEY, b"null"))
        while True:
            batch, described = stream.read_next_batch_with_custom_metadata()
            if described is None or described.get(_CHECKSUM) != str(_checksum(batch)).encode():
                break
            batches.append(batch)
    if not batches or metadata is None:
        return None
    table = pa.Table.from_batches(batches)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    return Trial(columns=columns, metadata={**metadata, "status": INTERRUPTED, "recovered": True})
