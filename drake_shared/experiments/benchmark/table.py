"""The benchmark's report as a table of text."""

from __future__ import annotations

from collections.abc import Iterator

from drake_shared.experiments.benchmark.results import GroupResult, Report
from drake_shared.experiments.benchmark.timing import Spread

SIGNS = {"at least": "≥", "at most": "≤", "": ""}


def describe(report: Report) -> Iterator[str]:
    """The lines of the table."""
    machine = report.machine
    yield (
        f"{machine['processor']}, {machine['cores']} cores, load {machine['load_before']} before and "
        f"{machine['load_after']} after, {report.seconds:.0f} s{', quick' if report.quick else ''}"
    )
    for name, group in report.groups.items():
        yield f"\n{name}: median (10 to 90% of repeats)"
        for label, value, note in _rows(group):
            yield f"  {label:66s} {value:>9s}  {note}".rstrip()


def _rows(group: GroupResult) -> Iterator[tuple[str, str, str]]:
    for item in group.ratios:
        aim = f"  aim: {item.aim}" if item.aim else ""
        value = f"{SIGNS[item.bound]}{item.spread.median:.3g}"
        yield item.name, value, f"{_range(item.spread)}{aim}"
    for curve in group.curves:
        first, last = curve.seconds[0].median, curve.seconds[-1].median
        label = f"{curve.name}, {curve.sizes[0]:,} to {curve.sizes[-1]:,} {curve.size}"
        note = f"exponent {curve.exponent:.2f}, at the end {curve.last_exponent:.2f}"
        yield label, f"{first:.2g}..{last:.2g}", note
    for workers, rate in group.details.get("trials_per_second", {}).items():
        yield f"trials per second, workers: {workers}", f"{rate.median:.3g}", _range(rate)
    if memory := group.details.get("memory"):
        label = f"growth of memory, trials {memory['trials'][0]:,} to {memory['trials'][-1]:,}"
        yield label, f"{memory['growth']:.2f} MB", f"aim: {memory['aim']}"
    for name, reason in group.absent.items():
        yield f"absent: {name}", "", reason


def _range(spread: Spread) -> str:
    return f"({spread.low:.3g} to {spread.high:.3g})"
