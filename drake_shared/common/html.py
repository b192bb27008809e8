"""Data inside HTML pages."""

from __future__ import annotations


def script_safe(text: str) -> str:
    r"""JSON text for a script element: the same value, without "</script" and "<!--".

    JSON has "<" in its strings only, where "\u003c" is the same character.
    """
    return text.replace("<", "\\u003c")
