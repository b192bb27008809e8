"""Suggestions for misspelt names, in error messages."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The end of a message about an unknown name: the most similar known one, or all of them.

    Args:
        name: What was given.
        known: The names that exist.
    """
    names = list(known)
    # Case is the commonest mistake, and counts as much as any other letter in difflib.
    lower = {item.lower(): item for item in reversed(names)}
    close = difflib.get_close_matches(name.lower(), lower, n=1)
    if close:
        return f" (did you mean {lower[close[0]]!r}?)"
    return f"; known are {', '.join(names)}" if names else ""
