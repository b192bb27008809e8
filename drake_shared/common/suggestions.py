"""Suggestions for misspelt names, in error messages."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def suggestion(name: str, known: Iterable[str]) -> str:
    """The most similar known name in parentheses, to end a message with; empty if none is similar.

    Args:
        name: What was given.
        known: The names that exist.
    """
    # Case is the commonest mistake, and counts as much as any other letter in difflib.
    lower = {item.lower(): item for item in known}
    close = difflib.get_close_matches(name.lower(), lower, n=1)
    return f" (did you mean {lower[close[0]]!r}?)" if close else ""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The end of a message about an unknown name: the most similar known one, or all of them."""
    names = list(known)
    return suggestion(name, names) or (f"; known are {', '.join(names)}" if names else "")
