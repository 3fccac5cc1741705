"""Which counts a report must hold back: small ones, and others that would give small ones away."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)

GIVES_AWAY = "held back, as it would tell a count that is too small to print"


@dataclass(frozen=True, slots=True)
class HeldBack(Generic[K]):
    """What must not be printed of counts whose total is known.

    Attributes:
        small: Counts from 1 to just under the limit.
        others: Counts that are not small but would let a reader work out a small one.
        is_total_safe: False when even so the total tells a small count, so that it must go too.
    """

    small: frozenset[K]
    others: frozenset[K]
    is_total_safe: bool

    def __contains__(self, key: K) -> bool:
        return key in self.small or key in self.others


def is_small(n: float, *, below: int) -> bool:
    """Tell whether a count may not be printed: 1 to `below` - 1."""
    return 0 < n < below


def too_few(below: int) -> str:
    """Return in words why a small count is not printed."""
    return f"fewer than {below} violations were counted"


def held_back(counts: Mapping[K, int], *, below: int, give: Sequence[K], n_others: int = 0) -> HeldBack[K]:
    """Return which counts of a partition to hold back when a reader may know their sum.

    The reader knows the sum s of what is held back, too. With k small counts in it and e others (at least `below`
    each) one small count can be anything from 1 up to min(below - 1, s - (k - 1) - e below), and without others it is
    at least s - (k - 1)(below - 1). Others are added, in the order of `give`, until each small count can be two
    numbers at least.

    Args:
        counts: Count by part.
        below: Counts from 1 to `below` - 1 are small.
        give: Parts in the order in which they are given up.
        n_others: Others to hold back at least, where the sum a reader knows is itself a small count off.
    """
    small = frozenset(k for k, n in counts.items() if is_small(n, below=below))
    if (not small and not n_others) or below <= 2:  # "<2" says 1 by itself
        return HeldBack(small, frozenset(), is_total_safe=True)
    k, s = len(small), sum(counts[key] for key in small)
    others: list[K] = []
    spare = [key for key in give if counts[key] >= max(below, 1)]
    while len(others) < n_others or not _is_open(k, len(others), s, below):
        if not spare:
            return HeldBack(small, frozenset(others), is_total_safe=False)
        others.append(spare.pop(0))
        s += counts[others[-1]]
    return HeldBack(small, frozenset(others), is_total_safe=True)


def _is_open(n_small: int, n_others: int, total: int, below: int) -> bool:
    """Tell whether each small count can still be two numbers at least."""
    if not n_small:
        return True
    highest = min(below - 1, total - (n_small - 1) - n_others * below)
    lowest = 1 if n_others else max(1, total - (n_small - 1) * (below - 1))
    return highest > lowest
