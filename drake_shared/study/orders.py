"""Orders of conditions: counterbalanced, all permutations, or random."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from drake_shared.common.errors import InputError

Order = tuple[int, ...]
MOST_PERMUTED = 6
"""Most conditions of which all permutations are used."""


def williams_square(count: int) -> list[Order]:
    """The rows of a Williams Latin square (Williams 1949).

    Each condition is in each place equally often, and directly before each other one equally often.

    Args:
        count: Number of conditions k, at least 1.

    Returns:
        k orders if k is even, otherwise 2 k.
    """
    first = [0]
    for step in range(1, count):
        first.append((step + 1) // 2 if step % 2 else count - step // 2)
    rows = [tuple((item + shift) % count for item in first) for shift in range(count)]
    return rows if count % 2 == 0 or count == 1 else rows + [row[::-1] for row in rows]


def rows_of(order: str, conditions: int) -> list[Order] | None:
    """The orders that must each be used equally often for balance; None for random orders.

    Args:
        order: "williams", "permutations" or "random".
        conditions: Their number.

    Raises:
        InputError: There are too many conditions for all permutations.
    """
    if order == "random":
        return None
    if order == "williams":
        return williams_square(conditions)
    if conditions > MOST_PERMUTED:
        expected = f"must not be permutations with more than {MOST_PERMUTED} conditions; use williams"
        raise InputError("study", "order", expected)
    return list(itertools.permutations(range(conditions)))


def assign_orders(order: str, conditions: int, participants: int, seed: int) -> list[Order]:
    """The order of each participant.

    The rows are shuffled by the seed within each full set of them, so that any full sets are balanced.

    Args:
        order: "williams", "permutations" or "random".
        conditions, participants: Their numbers.
        seed: Of the assignment.

    Raises:
        InputError: The orders cannot be balanced with so many participants.
    """
    random = np.random.default_rng([seed, conditions])
    rows = rows_of(order, conditions)
    if rows is None:
        return [tuple(random.permutation(conditions).tolist()) for _ in range(participants)]
    _check_multiple(participants, len(rows), f"{len(rows)} orders of {conditions} conditions ({order})")
    assigned: list[Order] = []
    for _ in range(participants // len(rows)):
        assigned += [rows[index] for index in random.permutation(len(rows))]
    return assigned


def assign_groups(conditions: int, participants: int, seed: int) -> list[Order]:
    """The only condition of each participant, in groups of equal size; see `assign_orders`."""
    random = np.random.default_rng([seed, conditions])
    _check_multiple(participants, conditions, f"{conditions} groups")
    assigned: list[Order] = []
    for _ in range(participants // conditions):
        assigned += [(index,) for index in random.permutation(conditions).tolist()]
    return assigned


def imbalance(orders: Sequence[Order]) -> tuple[int, int]:
    """How unbalanced orders are.

    Returns:
        The largest difference between how often conditions are in a place, and between how often one is
        directly before another and after it. Both are 0 in balanced orders.
    """
    conditions = sorted({item for order in orders for item in order})
    places = Counter((place, item) for order in orders for place, item in enumerate(order))
    before = Counter(pair for order in orders for pair in itertools.pairwise(order))
    by_place = [
        [places[place, item] for item in conditions] for place in range(max(map(len, orders), default=0))
    ]
    pairs = [abs(before[pair] - before[pair[::-1]]) for pair in itertools.combinations(conditions, 2)]
    return max((max(row) - min(row) for row in by_place), default=0), max(pairs, default=0)


def _check_multiple(participants: int, size: int, what: str) -> None:
    if participants % size:
        below, above = participants // size * size, math.ceil(participants / size) * size
        possible = f"{below} or {above}" if below else f"{above}"
        expected = f"must be a multiple of {size} to balance {what}, such as {possible}"
        raise InputError("study", "participants", expected, participants)
