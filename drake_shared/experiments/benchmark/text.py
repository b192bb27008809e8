"""The benchmark as a table, for people."""

from __future__ import annotations

from collections.abc import Iterator

from drake_shared.experiments.benchmark.groups import Report
from drake_shared.experiments.benchmark.results import GroupResult

_SIGNS = {"at least": ">=", "at most": "<=", "": ""}


def describe(report: Report) -> Iterator[str]:
    """The lines of the table."""
    machine = report.machine
    yield (
        f"{machine['processor']}, {machine['cores']} cores, load {machine['load_before']} before and "
        f"{machine['load_after']} after, {report.seconds:.0f} s{', quick' if report.quick else ''}"
    )
    for group in report.groups:
        yield ""
        yield f"{group.name}: median (10 to 90% of repeats)"
        yield from _describe_group(group)


def _describe_group(group: GroupResult) -> Iterator[str]:
    for item in group.ratios:
        spread = item.spread
        value = f"{_SIGNS[item.bound]}{spread.median:.3g}"
        aim = f"  aim: {item.aim}" if item.aim else ""
        yield f"  {item.name:58s} {value:>8s}  ({spread.low:.3g} to {spread.high:.3g}){aim}"
    for curve in group.curves:
        name = f"{curve.name}, by {curve.size} {curve.sizes[0]:,} to {curve.sizes[-1]:,}"
        yield (
            f"  {name:65s} {curve.seconds[0].median:.3g} to {curve.seconds[-1].median:.3g}  "
            f"exponent {curve.exponent:.2f}, at the end {curve.last_exponent:.2f}"
        )
    for name, part in group.details.get("time_goes", {}).items():
        yield f"  {name:58s} {part['microseconds_per_step']:8.1f} us a step, {100 * part['share']:.0f}%"
    for workers, rate in group.details.get("trials_per_second", {}).items():
        name = f"trials per second, {workers} worker{'' if workers == '1' else 's'}"
        yield f"  {name:58s} {rate.median:8.3g}  ({rate.low:.3g} to {rate.high:.3g})"
    if "memory" in group.details:
        memory = group.details["memory"]
        name = f"growth of memory, trials {memory['trials'][0]:,} to {memory['trials'][-1]:,}"
        yield f"  {name:58s} {memory['growth']:8.2f} MB  aim: {memory['aim']}"
    for name, reason in group.absent.items():
        yield f"  absent: {name}: {reason}"
