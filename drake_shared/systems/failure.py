"""Names the system from another package that raised an exception while a diagram ran."""

from __future__ import annotations

from typing import NoReturn

from pydrake.systems.framework import LeafSystem

from drake_shared.common.errors import DrakeSharedError, RunError


def reraise(error: Exception, time: float) -> NoReturn:
    """Raises an exception again; one of a system from outside this package with its name and the time.

    Args:
        error: As caught: the system is that of the innermost frame of its traceback that has one.
        time: In [s].

    Raises:
        RunError: The exception of a system from outside. Errors that say what is wrong, and those of this
            package's own systems, are raised as they are.
    """
    if isinstance(error, DrakeSharedError):
        raise error
    system, traceback = None, error.__traceback__
    while traceback is not None:
        for value in traceback.tb_frame.f_locals.values():
            system = value if isinstance(value, LeafSystem) else system
        traceback = traceback.tb_next
    kind = type(system)
    if system is None or kind.__module__.startswith("drake_shared."):
        raise error
    name = f"{system.get_name()} ({kind.__name__})"
    raise RunError(f"{name} raised {error!r}, at t = {time:.3f} s") from error
