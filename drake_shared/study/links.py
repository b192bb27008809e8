"""The secret links of a study's pages, kept beside its data so that they outlive a crash."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
from collections.abc import Mapping
from pathlib import Path

from drake_shared.common.errors import InputError
from drake_shared.common.files import created_once
from drake_shared.study.store import StudyData

EXPERIMENTER = "experimenter"
_FILE = "links.json"


def load_links(data: StudyData) -> Mapping[str, str]:
    """The secret of each participant and of the experimenter, by pseudonym; made when first needed.

    Raises:
        InputError: The file was changed by hand.
    """
    path = Path(data.folder) / _FILE
    wanted = {EXPERIMENTER, *data.steps}
    if not path.is_file():
        # Another server of the study may make them at the same time.
        with contextlib.suppress(InputError), created_once(path) as temporary:
            temporary.touch(mode=0o600)
            temporary.write_text(json.dumps({name: secrets.token_urlsafe(12) for name in sorted(wanted)}))
    try:
        found: dict[str, str] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(path, "", f"cannot be read ({error})") from error
    missing = wanted - set(found)
    if missing:
        raise InputError(
            path, "", f"lacks {', '.join(sorted(missing))}; remove it to make new links", os.fspath(path)
        )
    return found
