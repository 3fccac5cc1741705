"""What the live page tells of how many people are somewhere: a band, never a number, and the same for a quarter-hour.

A page that is renewed every minute tells most where it changes. So it speaks of the last quarter-hour that is over, the
mean number of people in it, and only in which of some ranges that number lies. Each range is at least `mask_below`
people wide, and the lowest holds all that fewer people than that make: no page, and no row of pages, tells the time of
fewer than five people.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from vsd_analytics.figures.share.counts import Mask, rough

Crowd = Literal["few", "below", "within", "above"]
"""Fewer people than may be given; fewer than usual; as usual; more than usual."""


@dataclass(frozen=True, slots=True)
class Band:
    """How many people are somewhere, as far as readers may know it.

    Attributes:
        crowd: Where the number lies beside what is usual, or beside a limit; None where neither is known.
        about: The number in steps of ten, where neither is known.
        lo, hi: Ends of what is usual, as the band has them; None = there is no such end.
        below: Numbers below this are "few"; 0 = no number is too small.
    """

    crowd: Crowd | None
    about: int | None
    lo: float | None
    hi: float | None
    below: int


def beside_usual(n: float, lo: float, hi: float, mask: Mask) -> Band:
    """Return where a number of people lies beside its usual range, whose ends are moved until no band is narrow.

    Ends are whole numbers. The lower one is left out where it is below `mask_below`; "few" takes its place. The upper
    one is at least `mask_below` above the lower one.

    Args:
        n: Mean number of people.
        lo: Lower end of the usual range.
        hi: Its upper end.
        mask: What is small.
    """
    least = _least(mask)
    low = float(round(lo)) if round(lo) >= max(least, 1) else None
    high = float(max(round(hi), round(low or least) + least))
    crowd: Crowd = "above" if n > high else "within"
    if n < (low or least):
        crowd = "few" if low is None else "below"
    return Band(crowd, None, low, high, least)


def beside_limit(n: float, limit: float, mask: Mask) -> Band:
    """Return whether a number of people is above a limit, which counts as `mask_below` where it is less.

    Args:
        n: Mean number of people.
        limit: Number that should not be exceeded.
        mask: What is small.
    """
    high = max(limit, float(_least(mask)))
    return Band("above" if n > high else "within", None, None, high, _least(mask))


def in_steps(n: float, mask: Mask) -> Band:
    """Return a number of people in steps of twice `mask_below`: "few", or about so many."""
    least = _least(mask)
    about = rough(round(n), below=mask.below)
    is_few = n < least or about is None
    return Band("few" if is_few else None, None if is_few else about, None, None, least)


def _least(mask: Mask) -> int:
    """Return the least number of people of whom a number is given; 0 where nothing is hidden."""
    return mask.below if mask.is_on else 0
