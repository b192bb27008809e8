"""The pages of the documentation and the code blocks in them.

A comment in front of a fenced block states what the tests do with it:

- nothing: a ``python`` block runs in the namespace of its page; each ``drake-shared`` or ``python`` line of a
  ``sh`` block runs; a ``yaml`` or ``toml`` block is parsed.
- ``<!-- file: NAME -->``: the block is written to this file, relative to the folder in which the page runs.
- ``<!-- example: NAME -->``: the same, and the block is the text of ``examples/NAME``.
- ``<!-- extra: OPTIONS -->``: runs with these options besides those shown, to be quicker.
- ``<!-- parse: REASON -->``: the options of each ``drake-shared`` line are parsed, the command is not run.
- ``<!-- skip: REASON -->``: the block is not run.
"""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CODE = ("python", "sh", "yaml", "toml")
ILLUSTRATION = ("text", "bibtex", "json")
"""Languages of blocks that show output or data."""

_BLOCK = re.compile(
    r"(?:^[ ]*<!--\s*(?P<action>\w+):\s*(?P<detail>.*?)\s*-->\s*\n)?"
    r"^(?P<indent>[ ]*)(?P<fence>```+)(?P<language>[\w{}-]*)[^\n]*\n(?P<code>.*?)^[ ]*(?P=fence)[ ]*$",
    re.MULTILINE | re.DOTALL,
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Block:
    """A fenced block of a page.

    Attributes:
        line: Of the page, from 1.
        language: After the fence; a directive of Sphinx stands in braces.
        action: Of the comment in front: file, example, extra, parse, skip or empty.
        detail: Of the comment.
        code: Its text.
    """

    line: int
    language: str
    action: str
    detail: str
    code: str


def pages() -> list[Path]:
    """README, CONTRIBUTING and every page of the site."""
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(page: Path) -> list[Block]:
    """The code blocks of a page; directives of Sphinx are none."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in _BLOCK.finditer(text):
        if match["language"].startswith("{"):
            continue
        indent = match["indent"]
        code = re.sub(rf"^{indent}", "", match["code"], flags=re.MULTILINE)
        found.append(
            Block(
                line=text.count("\n", 0, match.start("fence")) + 1,
                language=match["language"],
                action=match["action"] or "",
                detail=match["detail"] or "",
                code=code,
            )
        )
    return found
