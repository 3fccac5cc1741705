"""What of a day leaves: days that are over, their counts as rough numbers, and nothing of their hours.

A card is made every day, or every hour. Exact counts of days would tell what the weekly page hides of an hour, so a day
is given to a step of twice `mask_below`; `weeks` hides hours so that this tells nothing.
"""

from __future__ import annotations

from dataclasses import replace

from vsd_analytics.figures.share.counts import Mask, rough
from vsd_analytics.figures.today import DayLevel, Today


def closed_days(today: Today, mask: Mask) -> Today:
    """Return a card for readers: yesterday's violations as a rough number, and the hours to come.

    It has no hours of today so far, no counts of single hours, and no unusual hours.

    Args:
        today: The operator's card.
        mask: The site's.
    """
    if mask.below <= 1:
        return today
    hours = tuple(replace(h, violations=None, estimate=None, seen=None) for h in today.hours)
    return replace(today, yesterday=_rough(today.yesterday, mask), so_far=None, hours=hours, is_of_closed_days=True)


def _rough(level: DayLevel | None, mask: Mask) -> DayLevel | None:
    if level is None or level.violations is None:
        return level
    n = rough(round(level.violations), below=mask.below)
    is_whole = level.estimate is None or round(level.estimate) == round(level.violations)
    estimate = None if level.estimate is None else rough(round(level.estimate), below=mask.below)
    known = n if is_whole else estimate
    return replace(level, violations=n, estimate=known, is_rough=True, masked_below=0 if n is not None else mask.below)
