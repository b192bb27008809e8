"""``drake-shared lineage``: the training data of a learner, and the learners before it."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

import tyro

from drake_shared.analysis.lineage import DataFile, Generation, driver_of
from drake_shared.cli.command import Command
from drake_shared.cli.common import print_json


@dataclasses.dataclass(kw_only=True)
class Lineage(Command):
    """Prints the training data of a learner and the learners that took part in recording it; to roll back,
    give one of these to --model."""

    model: Annotated[Path, tyro.conf.Positional]
    """Learner."""
    models: tuple[Path, ...] = ()
    """Folders to search for earlier learners; default: the learner's own and that of the shipped ones."""
    json: bool = False
    """Print everything as one JSON object."""

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.analysis.lineage import lineage
        from drake_shared.common.files import models_directory

        shipped = models_directory() / "learners"
        default = [self.model.parent, *([shipped] if shipped.is_dir() else [])]
        found = lineage(self.model, self.models or (default if self.model.is_file() else ()))
        if self.json:
            print_json(dataclasses.asdict(found))
        else:
            print("\n".join(_lines(found)))


def _lines(one: Generation) -> list[str]:
    if one.file is None:
        return [f"learner {one.id}: missing"]
    kind = ", ".join(str(value) for value in one.description.values() if value)
    head = f"learner {one.id} ({kind}): {one.file}"
    if one.told:
        return [f"{head} (listed above)"]
    if one.drivers is None:
        return [head, "  its file does not hold the provenance of its demonstrations"]
    counts = ", ".join(f"{count} {driver}" for driver, count in one.drivers.items())
    share = "" if one.autonomy is None else f"; {one.autonomy:.0%} due to autonomy"
    lines = [head, f"  demonstrations: {counts}{share}"]
    lines += [f"    {_describe(file)}" for file in one.data]
    if one.parents:
        lines.append("  recorded with:")
    for parent in one.parents:
        lines += [f"    {line}" for line in _lines(parent)]
    return lines


def _describe(data: DataFile) -> str:
    states = {
        "unchanged": "",
        "changed": " - CHANGED since the training",
        "missing": " - missing",
    }
    if data.file is None:
        return f"{len(data.sources)} not from a file"
    drives = [f"{driver_of(item)} {item.get('route') or ''}".strip() for item in data.sources]
    return f"{data.file}: {', '.join(drives)}{states[data.state]}"
