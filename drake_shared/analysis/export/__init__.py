"""Logs for other tools: CSV tables, MCAP files and LeRobot datasets."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from drake_shared.common.errors import InputError, RunError
from drake_shared.common.files import check_writable
from drake_shared.simulation.log import Trial

Exporter = Callable[[Sequence[tuple[str, Trial]], Path], None]


def export(logs: Sequence[tuple[str, Trial]], out: Path, write: Exporter) -> None:
    """Writes trials to a new folder, which appears when it is complete.

    Args:
        logs: Trials with unique names.
        out: The folder; empty or new.
        write: Of one of the modules of this package.

    Raises:
        InputError: There are no trials, two have one name, or the folder is not empty or not writable.
        RunError: Writing failed, because the disk is full, for example.
    """
    if not logs:
        raise InputError("export", "logs", "must be at least one")
    names = [name for name, _ in logs]
    if len(set(names)) < len(names):
        double = next(name for name in names if names.count(name) > 1)
        raise InputError("export", "logs", "must have names that differ", double)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(out, "", "must be an empty or new folder")
    check_writable(out.resolve().parent)
    with _whole(out) as temporary:
        write(logs, temporary)


@contextlib.contextmanager
def _whole(out: Path) -> Iterator[Path]:
    temporary = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.resolve().parent))
    try:
        yield temporary
        temporary.chmod(0o755)
        if out.exists():
            out.rmdir()
        temporary.rename(out)
    except OSError as error:
        raise RunError(f"{out}: cannot be written ({error.strerror or error})") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
