"""Whether a learner was trained to the loss threshold Lt of Alg. 1, from its training record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def loss_threshold(metadata: Mapping[str, Any]) -> dict[str, Any] | None:
    """How the training of a learner ended, of files of version 0.1.0 too.

    Args:
        metadata: Of the learner.

    Returns:
        ``threshold``, Lt in nats per point with positions in m; ``loss``, the last running mean loss; and
        ``reached``, whether it is below Lt. Of an ensemble or a mixture the worst of its networks. None if
        training had no threshold.
    """
    record = metadata.get("training")
    if not isinstance(record, Mapping):
        return None
    threshold = record.get("parameters", {}).get("loss_threshold")
    parts = record.get("members") or record.get("ways") or [record]
    losses = [part["loss"][-1][1] for part in parts if part.get("loss")]
    if threshold is None or not losses:
        return None
    return {"threshold": threshold, "loss": max(losses), "reached": max(losses) <= threshold}


def early_stop(metadata: Mapping[str, Any]) -> str | None:
    """One sentence about a training that ended before its loss threshold; None for any other."""
    found = loss_threshold(metadata)
    if found is None or found["reached"]:
        return None
    return (
        f"Training stopped early, at a loss of {found['loss']:.2f} nats per point: "
        f"its threshold is {found['threshold']:g}."
    )
