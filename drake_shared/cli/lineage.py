"""``drake-shared lineage``: what a learner was taught by, and the learners before it."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

import tyro

from drake_shared.analysis.lineage import DataFile, Generation
from drake_shared.cli.common import print_json


@dataclasses.dataclass(kw_only=True)
class Lineage:
    """Tells what a learner was taught by, and which learners took part in it; to roll back, take one of these
    by --model."""

    model: Annotated[Path, tyro.conf.Positional]
    """Learner."""
    models: tuple[Path, ...] = ()
    """Folders in which earlier learners are looked for; default: the learner's own and the shipped ones."""
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
        return [f"{head} (told of above)"]
    if one.counts is None:
        return [head, "  its file does not tell its data"]
    counts = ", ".join(f"{count} {kind}" for kind, count in one.counts.items() if count)
    share = "" if one.autonomy is None else f"; autonomy made {one.autonomy:.0%} of them"
    lines = [head, f"  demonstrations: {counts}{share}"]
    lines += [f"    {_describe(file)}" for file in one.data]
    if one.parents:
        lines.append("  taught by drives with:")
    for parent in one.parents:
        lines += [f"    {line}" for line in _lines(parent)]
    return lines


def _describe(data: DataFile) -> str:
    states = {
        "unchanged": "",
        "changed": " - CHANGED since it was taught",
        "missing": " - missing",
    }
    if data.file is None:
        return f"{len(data.sources)} from no file"
    told = [
        " ".join(str(item[name]) for name in ("mode", "route") if name in item) or "unknown"
        for item in data.sources
    ]
    return f"{data.file}: {', '.join(told)}{states[data.state]}"
