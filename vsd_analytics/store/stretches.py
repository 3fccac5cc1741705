"""Stretches of stored days: days with records, separated where more than a year has none.

A camera whose clock fell back to the year 2000 makes the first stored day 26 years older. No command may spend time,
memory or files on the years between, and the operator must hear of such records.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from vsd_analytics.store.layout import date_of_hour

FAR_DAYS = 366
"""A longer gap in days separates two stretches: comparisons of a year with the year before need the days between, and
a clock that was reset is wrong by many years."""

FAR_OFF_FIX = (
    "if the clock of a camera was wrong then, remove these records as if they had never come: "
    "vsd purge --camera ID --range DAYS"
)


def stretches(days: Collection[int]) -> list[list[int]]:
    """Return day numbers in order, split where two successive ones are more than FAR_DAYS apart."""
    split: list[list[int]] = []
    for day in sorted(set(days)):
        if split and day - split[-1][-1] <= FAR_DAYS:
            split[-1].append(day)
        else:
            split.append([day])
    return split


def far_off(days: Collection[int]) -> list[list[int]]:
    """Return all stretches but the main one: the stretch with most days, and of equal ones the last."""
    every = stretches(days)
    main = max(every, key=lambda s: (len(s), s[-1]), default=None)
    return [s for s in every if s is not main]


def day_range(stretch: Collection[int]) -> str:
    """Return the UTC days a stretch of day numbers spans as text, such as "2026-11-09 to 2026-11-15"."""
    first, last = (date_of_hour(day * 24).isoformat() for day in (min(stretch), max(stretch)))
    return first if first == last else f"{first} to {last}"


def far_off_notes(days: Mapping[int, int], *, among: Collection[int]) -> list[str]:
    """Return a warning for each stretch of a source's days that is far from most others, here or stored."""
    notes = []
    for stretch in far_off(among):
        if n := sum(days.get(day, 0) for day in stretch):
            counted = f"{n:,} record{'' if n == 1 else 's'}"
            notes.append(
                f"W213: {counted} of {day_range(stretch)} (UTC), more than a year from the others; {FAR_OFF_FIX}"
            )
    return notes
