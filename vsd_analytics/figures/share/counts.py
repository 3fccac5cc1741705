"""Which counts a report must hold back: small ones, and others that would give small ones away.

The rule: a reader who knows every number that is shown, in any output of any week, must find at least two possible
values for each count that is held back for being small. docs/privacy.md says what the rule covers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from vsd_analytics.answer import Reason
from vsd_analytics.site.model import Site

K = TypeVar("K", bound=Hashable)
Count = int | Mapping[str, int]
"""A count, or a count by camera."""

LEAST_BELOW: Final = 2
"""Of counts from 1 to just under this, only 1 is hidden, and "<2" says so by itself."""

GIVES_AWAY = Reason("hidden.gives_away")


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


@dataclass(frozen=True, slots=True)
class Mask:
    """What a site's `mask_below` hides: what every other module asks before it gives a number.

    Attributes:
        below: Counts from 1 to `below` - 1 are small; 0 or 1 = none is.
    """

    below: int

    @property
    def is_on(self) -> bool:
        """Tell whether anything is hidden at all: a limit of 0 or 1 hides no count."""
        return self.below > 1

    def hides(self, *counts: float | None) -> bool:
        """Tell whether any of some counts is small."""
        return any(n is not None and is_small(n, below=self.below) for n in counts)

    @property
    def why(self) -> Reason:
        """Return why a small count is not given."""
        return too_few(self.below)

    def least(self, n: int) -> int:
        """Return the least number of people or events of which something is given, `n` or more."""
        return max(n, self.below)

    @property
    def middle(self) -> float:
        """Return the middle of the small counts, for means that may tell nothing more of one."""
        return self.below / 2

    def held_back(self, counts: Mapping[K, Count], *, give: Sequence[K]) -> HeldBack[K]:
        """Return `held_back` of a partition."""
        return held_back(counts, below=self.below, give=give)

    def why_held_back(self, held: HeldBack[K], key: K) -> Reason | None:
        """Return why a count of a partition is held back; None where it is not."""
        return self.why if key in held.small else GIVES_AWAY if key in held.others else None


def mask_of(site: Site) -> Mask:
    """Return the mask of a site."""
    return Mask(int(site.settings.mask_below))


def is_small(n: float, *, below: int) -> bool:
    """Tell whether a count may not be printed: 1 to `below` - 1."""
    return 0 < n < below


def rough(n: int, *, below: int) -> int | None:
    """Return a count as a card gives it: 0, None for a small one, else to steps of twice `below`, at least one."""
    if n == 0 or below <= 1:
        return n
    return None if is_small(n, below=below) else max(1, math.floor(n / (2 * below) + 0.5)) * 2 * below


def too_few(below: int) -> Reason:
    """Return why a small count is not printed."""
    return Reason("hidden.few", least=below)


def in_week_before(why: Reason) -> Reason:
    """Return why a count of the week before is not printed."""
    return Reason("hidden.week_before", reason=why)


def held_back(
    counts: Mapping[K, Count],
    *,
    below: int,
    give: Sequence[K],
    n_others: int = 0,
    unready: Iterable[K] = (),
    is_unseen: Callable[[K, K], bool] | None = None,
) -> HeldBack[K]:
    """Return which counts of a partition to hold back when a reader may know their sum, by camera where that is given.

    The reader knows which counts held back are small and which are not, and what all of them sum up to for each camera:
    rates add up violations over recorded hours, and these differ from camera to camera. Others are added, in the order
    of `give`, until each small count could be one more or one less, with one less or one more of the same camera in
    another count held back.

    Args:
        counts: Count by part; by camera, the cameras that count in the part at all, those with 0 too.
        below: Counts from 1 to `below` - 1 are small.
        give: Parts in the order in which they are given up.
        n_others: Others to hold back at least, where the sum a reader knows is itself a small count off.
        unready: Parts that do not leave yet: they are held back like small ones, whatever their count.
        is_unseen: Tells whether one more in the first part and one less in the second leaves all other sums as a
            reader knows them; None = they know no other sums.
    """
    parts = {key: dict(n) if isinstance(n, Mapping) else {"": n} for key, n in counts.items()}
    sums = {key: sum(part.values()) for key, part in parts.items()}
    small = frozenset(k for k, n in sums.items() if is_small(n, below=below))
    waiting = [key for key in unready if key not in small]
    if (not small and not waiting and not n_others) or below <= LEAST_BELOW:
        return HeldBack(small, frozenset(), is_total_safe=True)
    others: list[K] = []
    spare = [key for key in give if sums[key] >= max(below, 1) and key not in waiting]
    closed = [key for key in parts if key in small or key in waiting]
    while True:
        closed = [
            key for key in closed if not _can_differ(key, [*small, *waiting, *others], parts, sums, below, is_unseen)
        ]
        if not closed and len(others) >= n_others:
            return HeldBack(small, frozenset((*waiting, *others)), is_total_safe=True)
        if not spare:
            return HeldBack(small, frozenset((*waiting, *others)), is_total_safe=False)
        others.append(spare.pop(0))


def _can_differ(
    key: K,
    hidden: Iterable[K],
    parts: Mapping[K, Mapping[str, int]],
    sums: Mapping[K, int],
    below: int,
    is_unseen: Callable[[K, K], bool] | None,
) -> bool:
    """Tell whether a small count could be one more or less, if another that is held back is one less or more."""

    def fits(part: K, n: int) -> bool:
        return 0 < n < below if 0 < sums[part] < below else n >= below

    return any(
        fits(more, sums[more] + 1)
        and fits(less, sums[less] - 1)
        and any(camera in parts[more] for camera, n in parts[less].items() if n > 0)
        and (is_unseen is None or is_unseen(more, less))
        for other in hidden
        if other != key
        for more, less in ((key, other), (other, key))
    )
