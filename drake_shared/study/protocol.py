"""The protocol of a study: hashed and dated before the first participant; later changes are logged."""

from __future__ import annotations

import dataclasses
import datetime
import hashlib
import importlib.metadata
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from drake_shared.common.errors import InputError
from drake_shared.common.files import replacing
from drake_shared.learners.storage import learner_id
from drake_shared.simulation.runner.tasks import canonical
from drake_shared.study.design import Study, load_study
from drake_shared.study.steps import participants_of

FORMAT, FORMAT_VERSION = "drake_shared study protocol", 1
STUDY_FILE, PROTOCOL_FILE = "study.yaml", "protocol.json"


def content_of(study: Study) -> dict[str, Any]:
    """All that determines a study: its fields, scenario, learners, questionnaires, and every order."""
    learners = {name: study.learner_of(name) for name in study.conditions}
    names = list(study.conditions)
    found: dict[str, Any] = {
        "study": study.to_json(),
        "scenario": dataclasses.asdict(study.load_scenario()),
        "learners": {name: file and learner_id(file) for name, file in learners.items()},
        "questionnaires": {
            name: {"form": asked.form, "scores": {k: dataclasses.asdict(v) for k, v in asked.scores.items()}}
            for name, asked in study.load_questionnaires().items()
        },
        "orders": {
            participant: [names[index] for index in order]
            for participant, order in zip(participants_of(study), study.orders(), strict=True)
        },
    }
    # The place of the robot's model differs from machine to machine.
    found["scenario"]["robot"]["model"] = Path(found["scenario"]["robot"]["model"]).name
    plain: dict[str, Any] = json.loads(canonical(found))
    return plain


def hash_of(content: Mapping[str, Any]) -> str:
    """SHA-256 of the content of a protocol, in hexadecimal."""
    return hashlib.sha256(canonical(content).encode()).hexdigest()


def changes_between(before: Any, after: Any, path: str = "") -> list[str]:
    """What differs, one line for each field."""
    if isinstance(before, dict) and isinstance(after, dict):
        found = []
        for name in sorted({*before, *after}):
            where = f"{path}.{name}" if path else name
            found += changes_between(before.get(name), after.get(name), where)
        return found
    if before == after:
        return []
    return [f"{path}: {_short(before)} -> {_short(after)}"]


def plan(folder: Path, *, amend: str | None = None) -> tuple[dict[str, Any], list[str]]:
    """Writes the protocol of the study in a folder, or the changes to it.

    Args:
        folder: With `STUDY_FILE`.
        amend: Why the protocol is changed although participants have begun.

    Returns:
        The protocol, and what has changed since the last one.

    Raises:
        InputError: The study is invalid; or it has changed since the first participant began and ``amend`` is
            None or empty.
    """
    content = content_of(load_study(folder / STUDY_FILE))
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    path = folder / PROTOCOL_FILE
    protocol: dict[str, Any] = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "created": now,
        "software": importlib.metadata.version("drake_shared"),
        "hash": hash_of(content),
        "amendments": [],
        "content": content,
    }
    changes: list[str] = []
    if path.is_file():
        last = read_protocol(folder)
        changes = changes_between(last["content"], content)
        if not changes:
            return last, []
        if has_begun(folder):
            if not (amend or "").strip():
                expected = "must not change once a participant has begun, unless --amend gives the reason"
                raise InputError(folder / STUDY_FILE, changes[0].partition(":")[0], expected, changes[0])
            amendment = {"date": now, "reason": amend, "from": last["hash"], "changes": changes}
            protocol |= {"created": last["created"], "amendments": [*last["amendments"], amendment]}
    with replacing(path, durable=True) as temporary:
        temporary.write_text(json.dumps(protocol, indent=1) + "\n", encoding="utf-8")
    return protocol, changes


def read_protocol(folder: Path) -> dict[str, Any]:
    """The protocol in a folder.

    Raises:
        InputError: There is none, or its hash is not that of its content.
    """
    path = folder / PROTOCOL_FILE
    try:
        protocol: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        valid = protocol["format"] == FORMAT and protocol["hash"] == hash_of(protocol["content"])
    except FileNotFoundError as error:
        raise InputError(path, "", "must exist: make it with `drake-shared study plan`") from error
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(path, "", f"cannot be read as a protocol ({error})") from error
    if not valid:
        raise InputError(path, "hash", "must be that of the content: the file was changed by hand")
    return protocol


def open_planned(folder: Path) -> tuple[Study, dict[str, Any]]:
    """The study in a folder with its protocol.

    Raises:
        InputError: There is no protocol, or the study has changed since.
    """
    protocol = read_protocol(folder)
    study = load_study(folder / STUDY_FILE)
    changes = changes_between(protocol["content"], content_of(study))
    if changes:
        expected = (
            f"must be as in {PROTOCOL_FILE} ({changes[0]}); see all changes with `drake-shared study plan`"
        )
        raise InputError(folder / STUDY_FILE, changes[0].partition(":")[0], expected)
    return study, protocol


def has_begun(folder: Path) -> bool:
    """Whether a participant has completed a step."""
    return any(folder.glob("data/P*/*.json"))


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
