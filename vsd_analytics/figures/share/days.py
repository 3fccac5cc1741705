"""What of a day leaves: days that are over, their counts as rough numbers, and nothing of their hours.

A card is made every day, or every hour. Exact counts of days would tell what the weekly page hides of an hour, so a day
is given to a step of twice `mask_below`; `weeks` hides hours so that this tells nothing. All else that a card says of
violations is computed from such rough numbers, those of earlier days too: the usual range, and where the day lies. A
day that changed since its week left is not among them: its two numbers would tell of what the change was added to.
"""

from __future__ import annotations

from dataclasses import replace

from vsd_analytics.answer import Reason
from vsd_analytics.figures.share.counts import Mask, mask_of, rough
from vsd_analytics.figures.share.earlier import changed_days
from vsd_analytics.figures.special_days import HOLIDAY
from vsd_analytics.figures.today import DayLevel, Today
from vsd_analytics.site.model import Site
from vsd_analytics.stats.usual import MIN_WEEKS, UsualRange, usual_range


def closed_days(today: Today, site: Site) -> Today:
    """Return a card for readers: yesterday's violations as a rough number, and how many people to expect.

    It has no hours of today so far, no unusual hours, and no violations of single hours, counted or expected: these are
    computed from exact hours. The people to expect are those of hours in which enough people were.

    Args:
        today: The operator's card.
        site: The site; where it hides nothing, the card is the operator's.
    """
    mask = mask_of(site)
    if not mask.is_on:
        return today
    hours = tuple(
        replace(h, violations=None, estimate=None, usual=None, lo=None, hi=None, seen=None) for h in today.hours
    )
    hours = tuple(
        replace(h, people=h.for_readers[0], people_lo=h.for_readers[1], people_hi=h.for_readers[2]) for h in hours
    )
    yesterday = today.yesterday
    if yesterday is not None and yesterday.whole_days is not None:
        changed = changed_days(site, yesterday.whole_days, floor_id=today.floor_id)
        whole_days = {day: n for day, n in yesterday.whole_days.items() if day not in changed}
        yesterday = replace(yesterday, whole_days=whole_days)
    yesterday = _rough(yesterday, mask, confidence=float(site.settings.confidence))
    return replace(today, yesterday=yesterday, so_far=None, hours=hours, is_of_closed_days=True)


def _rough(level: DayLevel | None, mask: Mask, *, confidence: float) -> DayLevel | None:
    """Return a day as a rough number, beside the rough numbers of earlier days if all cameras recorded all of it."""
    if level is None or level.violations is None:
        return level
    n = rough(round(level.violations), below=mask.below)
    usual, reason = _usual(level, mask, confidence=confidence)
    return replace(
        level,
        violations=n,
        estimate=n,
        usual=usual,
        n_days=0 if level.whole_days is None else len(level.whole_days),
        state="not_enough_data" if usual is None else "ok",
        reason=reason,
        whole_days=None,
        is_rough=True,
        masked_below=0 if n is not None else mask.below,
    )


def _usual(level: DayLevel, mask: Mask, *, confidence: float) -> tuple[UsualRange | None, Reason | None]:
    """Return the usual range by rough numbers, a step wider at both ends: half for its days, half for the day's own."""
    if level.reason is not None and level.reason.code == HOLIDAY:
        return None, level.reason
    if level.whole_days is None:
        return None, Reason("today.not_whole")
    few = len(level.whole_days) < MIN_WEEKS
    days = [rough(round(n), below=mask.below) for n in level.whole_days.values()]
    usual = usual_range([mask.middle if n is None else n for n in days], confidence=confidence)
    if usual is None:
        has = len(level.whole_days)
        return None, Reason("today.whole_days", least=MIN_WEEKS, has=has) if few else Reason("today.quiet_days")
    step = 2 * mask.below
    return replace(usual, lo=max(0.0, usual.lo - step), hi=usual.hi + step), None
