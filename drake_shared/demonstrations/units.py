"""Whether demonstrations are in seconds and metres, by the size of the task that they are of."""

from __future__ import annotations

from collections.abc import Mapping

from drake_shared.common.errors import InputError
from drake_shared.demonstrations.trajectories import Demonstrations

_TIME = {"ms": 1e3, "us": 1e6, "ns": 1e9}
_LENGTH = {"cm": 1e2, "mm": 1e3}
# A demonstration that takes or extends this many times as much as the task is in another unit.
_SLOW, _LARGE = 30.0, 10.0


def check_units(demonstrations: Demonstrations, *, duration: float, extent: float) -> None:
    """Refuses demonstrations whose times or positions are in smaller units than s and m.

    Args:
        demonstrations: Of the task.
        duration: Of the task, in [s].
        extent: Longest side of its workspace, in [m].

    Raises:
        InputError: A demonstration lasts 30 times as long as the task, or they extend 10 times as far as the
            workspace. Names the unit that is suspected.
    """
    longest = max(demonstrations, key=lambda item: float(item.times[-1] - item.times[0]))
    length = float(longest.times[-1] - longest.times[0])
    if length > _SLOW * duration:
        expected = f"must be in s: the task takes {duration:g} s, and this is probably in"
        raise InputError(
            longest.source, "t", f"{expected} {_nearest(_TIME, length / duration)}", f"{length:g}"
        )
    if demonstrations.extent > _LARGE * extent:
        names = ", ".join(demonstrations.position_names)
        expected = f"must be in m: the workspace extends over {extent:g} m, and this is probably in"
        unit = _nearest(_LENGTH, demonstrations.extent / extent)
        raise InputError(demonstrations.source, names, f"{expected} {unit}", f"{demonstrations.extent:g}")


def _nearest(units: Mapping[str, float], ratio: float) -> str:
    return min(units, key=lambda unit: max(ratio / units[unit], units[unit] / ratio))
