"""Which days may leave the operator's hands: one ISO week, once its last site day is over.

Figures of a week that goes on, of a day, or of any other range would be compared with those of the week: a page made
after each hour tells how many that hour added, and two ranges tell what lies between them.
"""

from __future__ import annotations

from datetime import date, datetime, timedelta

from vsd_analytics.errors import UsageError
from vsd_analytics.figures.share.counts import mask_of
from vsd_analytics.site.model import Site


def last_closed_day(site: Site, clock: datetime) -> date:
    """Return the last local day whose site day is over."""
    return (clock.astimezone(site.zone) - timedelta(minutes=site.day_starts_min)).date() - timedelta(days=1)


def is_over(site: Site, last: date, *, clock: datetime | None) -> bool:
    """Tell whether the site day of a local day is over; without a clock, every one is."""
    return clock is None or last_closed_day(site, clock) >= last


def check_operator(site: Site, what: str) -> None:
    """Check that something may be made that no other reader gets.

    Args:
        site: The project; nothing is checked where it hides nothing.
        what: What is made, at the beginning of a sentence.

    Raises:
        UsageError: E105, `--exact` was not given.
    """
    if mask_of(site).is_on:
        raise UsageError(
            f"{what} is for the operator",
            code="E105",
            why="its counts of single hours and places would tell what the weekly report hides",
            fix="add --exact, for your own eyes",
        )


def check_days(site: Site, first: date, last: date, *, clock: datetime | None) -> None:
    """Check that figures of some days may leave.

    Args:
        site: The project; nothing is checked where it hides nothing.
        first: First local day.
        last: Last local day.
        clock: The present; None = all days are over.

    Raises:
        UsageError: E105, they are no ISO week, or it is not over.
    """
    if not mask_of(site).is_on:
        return
    if first.weekday() or last - first != timedelta(days=6):
        raise UsageError(
            f"{first} to {last} is no week from Monday to Sunday",
            code="E105",
            why="only figures of whole weeks are shared: two ranges would tell the small counts between them",
            fix="--week last; or add --exact, for your own eyes",
        )
    if not is_over(site, last, clock=clock):
        raise not_yet(first)


def not_yet(monday: date) -> UsageError:
    """Return why nothing of a week leaves."""
    return UsageError(
        f"too few days of the week {monday:%G-W%V} are over to share it",
        code="E105",
        why="day by day its pages would tell what each day added; a day leaves when enough came after it",
        fix="--week last; or add --exact, for your own eyes",
    )
