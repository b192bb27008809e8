"""Names the system from another package that raised an exception while a diagram ran."""

from __future__ import annotations

from pydrake.systems.framework import LeafSystem

from drake_shared.common.errors import DrakeSharedError, RunError


def failure_of(error: Exception, time: float) -> RunError | None:
    """An exception of a system from outside this package, as an error that names the system and the time.

    Args:
        error: As caught: the system is that of the innermost frame of its traceback that has one.
        time: In [s].

    Returns:
        None for errors that say what is wrong, and for those of this package's own systems.
    """
    if isinstance(error, DrakeSharedError):
        return None
    system, traceback = None, error.__traceback__
    while traceback is not None:
        for value in traceback.tb_frame.f_locals.values():
            system = value if isinstance(value, LeafSystem) else system
        traceback = traceback.tb_next
    kind = type(system)
    if system is None or kind.__module__.startswith("drake_shared."):
        return None
    return RunError(f"{system.get_name()} ({kind.__name__}) raised {error!r}, at t = {time:.3f} s")
