"""How much memory this machine has to give."""

from __future__ import annotations

from pathlib import Path

_SYSTEM = Path("/proc/meminfo")
_LIMIT, _USED = Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current")


def available_memory() -> int | None:
    """Memory that programs can still have without swapping, in bytes, within the limit of a container.

    None where the system does not tell, as on macOS.
    """
    try:
        lines = _SYSTEM.read_text(encoding="ascii").splitlines()
        free = next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, StopIteration):
        return None
    try:
        return min(free, int(_LIMIT.read_text(encoding="ascii")) - int(_USED.read_text(encoding="ascii")))
    except (OSError, ValueError):
        return free
