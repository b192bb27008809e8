"""Names the system from another package that raised an exception while a diagram ran."""

from __future__ import annotations

from typing import NoReturn

from pydrake.systems.framework import LeafSystem

from drake_shared.common.errors import DrakeSharedError, RunError


def reraise(error: Exception, time: float, system: LeafSystem | None = None) -> NoReturn:
    """Raises an exception again; one of a system from outside this package with its name and the time.

    Args:
        error: As caught: the system is that of the innermost frame of its traceback that has one.
        time: In [s].
        system: The one that caught it, if a system did; named if no frame below it has one.

    Raises:
        RunError: The exception of a system from outside. Errors that say what is wrong, and those of this
            package's own systems, are raised as they are.
    """
    try:
        if isinstance(error, DrakeSharedError):
            raise error
        system = _innermost_system(error) or system
        if system is None or type(system).__module__.startswith("drake_shared."):
            raise error
        name = f"{system.get_name()} ({type(system).__name__})"
        raise RunError(f"{name} raised {error!r}, at t = {time:.3f} s") from error
    finally:
        # The traceback holds this frame. If the frame held the exception too, both would stay in memory, with
        # the contexts of all frames between them, until Python looks for cycles.
        del error


def _innermost_system(error: Exception) -> LeafSystem | None:
    """The system of the innermost frame below the one that caught an exception."""
    assert error.__traceback__ is not None
    # Its own frame holds the exception, and would keep it in the dict that f_locals makes.
    system, traceback = None, error.__traceback__.tb_next
    while traceback is not None:
        for value in traceback.tb_frame.f_locals.values():
            system = value if isinstance(value, LeafSystem) else system
        traceback = traceback.tb_next
    return system
