"""How numbers, dates and ranges are written on the page: the only place where they become text.

Integers from 10 up, one decimal below, two significant digits below 1; thousands comma; a true minus sign; local times.
Templates call these as filters and do no arithmetic of their own.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable
from datetime import date, datetime
from typing import TYPE_CHECKING, Final

from vsd_analytics.errors import CONTROL
from vsd_analytics.geometry.scale_bar import M_PER_FT
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import days, months, separated

if TYPE_CHECKING:
    from vsd_analytics.figures.week.model_estimate import Estimate

MINUS: Final = "\u2212"
MISSING: Final = "\u2013"
MAIL_WIDTH: Final = 72
"""Characters in a line of a plain mail."""


def number(value: float | None) -> str:
    """Write a figure: 1,234; 121; 4.2; 0.42; 0; an en dash when missing.

    Example:
        >>> number(1234.4), number(9.96), number(4.21), number(0.4167), number(0), number(None)
        ('1,234', '10', '4.2', '0.42', '0', '–')
    """
    if value is None or not math.isfinite(value):
        return MISSING
    size = abs(value)
    if size == 0 or size >= 9.95:
        text = separated(f"{size:,.0f}")
    elif size >= 0.995:
        text = separated(f"{size:.1f}")
    elif size >= 0.0005:
        text = separated(f"{size:.2g}")
    else:
        text = say("format.tiny")
    return (MINUS if value < 0 and text != "0" else "") + text


def decimals(value: float) -> int:
    """Return with how many decimals `number` writes a figure: 0 from 10 up, 1 from 1 up, else 2."""
    size = abs(value)
    return 0 if size == 0 or size >= 9.95 else 1 if size >= 0.995 else 2


def fixed(value: float, decimals: int) -> str:
    """Write a figure with so many decimals: 1,234; 12.3; a true minus sign.

    Example:
        >>> fixed(1234.4, 0), fixed(-0.04, 1), fixed(-12.34, 1)
        ('1,234', '0.0', '−12.3')
    """
    text = separated(f"{abs(value):,.{decimals}f}")
    is_none = round(abs(value) * 10**decimals) == 0
    return text if value >= 0 or is_none else f"{MINUS}{text}"


def signed_fixed(value: float, decimals: int) -> str:
    """Write a difference with its sign and so many decimals: −28, +0.6, 0."""
    if round(abs(value) * 10**decimals) == 0:
        return number(0.0)
    return f"{'+' if value > 0 else ''}{fixed(value, decimals)}"


def plain(value: float) -> str:
    """Write a number as it is, with as few digits as it needs: 2, 1.83."""
    return separated(f"{value:g}")


def count(value: float | None) -> str:
    """Write a whole number with a thousands comma; an en dash when missing."""
    return MISSING if value is None else separated(f"{round(value):,}").replace("-", MINUS)


def _points(percent: int) -> str:
    return separated(f"{percent:,}%")


def percent(share: float | None) -> str:
    """Write a share as whole percent; what is not quite all or none never looks like it.

    Example:
        >>> percent(0.927), percent(0.998), percent(0.001), percent(1), percent(0)
        ('93%', 'over 99%', 'under 1%', '100%', '0%')
    """
    if share is None or not math.isfinite(share * 100):
        return MISSING
    text = separated(f"{share * 100:,.0f}%")
    if text == "0%" and share > 0:
        return say("format.nearly_none", percent="1%")
    return say("format.nearly_all", percent="99%") if text == "100%" and share < 1 else text


def percent_short(share: float | None) -> str:
    """Write a share as in `percent`, short enough for a narrow column: >99%, <1%."""
    if share is not None and 0 < share < 0.005:
        return "<1%"
    return ">99%" if share is not None and 0.995 <= share < 1 else percent(share)


def signed(change: float | None) -> str:
    """Write a relative change with its sign: −43%, +8%, 0%."""
    if change is None or not math.isfinite(change * 100):
        return MISSING
    points = round(change * 100)
    return f"{'+' if points > 0 else MINUS if points < 0 else ''}{_points(abs(points))}"


def fewer_more(change: float | None) -> str:
    """Write a relative change in words: 14% fewer, 8% more, about the same."""
    if change is None or not math.isfinite(change * 100):
        return MISSING
    points = round(change * 100)
    if points == 0:
        return say("format.same")
    return say("format.fewer" if points < 0 else "format.more", percent=_points(abs(points)))


def less_more(change: float | None) -> str:
    """Write a relative change of something that is not counted: 14% less, 8% more, about the same."""
    if change is None or not math.isfinite(change * 100) or round(change * 100) >= 0:
        return fewer_more(change)
    return say("format.less", percent=_points(-round(change * 100)))


def likely_change(estimate: Estimate, *, is_counted: bool = True) -> str:
    """Write the interval of a change: likely between 10% and 18% fewer; empty when there is none.

    Args:
        estimate: The change.
        is_counted: False for an amount: likely between 10% and 18% less.
    """
    lo, hi = estimate.change_lo, estimate.change_hi
    if lo is None or hi is None or not math.isfinite(lo * 100) or not math.isfinite(hi * 100):
        return ""
    low, high = round(lo * 100), round(hi * 100)
    change_words = fewer_more if is_counted else less_more
    if low == high:
        return say("format.likely", change=say("format.no_change") if low == 0 else change_words(lo))
    if lo < 0 and hi < 0:  # "under 1%" where an end is almost no change: the range leaves it out
        return say("format.likely_fewer" if is_counted else "format.likely_less", low=percent(-hi), high=percent(-lo))
    if lo > 0 and hi > 0:
        return say("format.likely_more", low=percent(lo), high=percent(hi))
    ends = [say("format.no_change") if round(v * 100) == 0 else change_words(v) for v in (lo, hi)]
    return say("format.likely_between", low=ends[0], high=ends[1])


def likely_signed(estimate: Estimate) -> str:
    """Write the interval of a change shortly: likely −49% to −37%; empty when there is none."""
    return likely_between(estimate.change_lo, estimate.change_hi)


def likely_between(low: float | None, high: float | None) -> str:
    """Write the ends of the interval of a change: likely −49% to −37%; empty when one is missing."""
    return "" if low is None or high is None else say("format.likely_signed", low=_end(low), high=_end(high))


def _end(change: float) -> str:
    """Write an end of a range with its sign, and with decimals where it is near 0 and is not 0: −0.4%."""
    if round(change * 100) or not change:
        return signed(change)
    return f"{'+' if change > 0 else MINUS}{separated(f'{abs(change) * 100:.1g}')}%"


def range_signed(estimate: Estimate) -> str:
    """Write the interval of a change for a table whose heading says what it is: −49% to −37%; empty without one."""
    if estimate.change_lo is None or estimate.change_hi is None:
        return ""
    return say("format.range_signed", low=_end(estimate.change_lo), high=_end(estimate.change_hi))


def likely_level(estimate: Estimate, *, written: Callable[[float | None], str] | None = None) -> str:
    """Write the interval of a level: likely between 116 and 126; empty when there is none.

    Args:
        estimate: The level.
        written: How its values are written; None = `number`.
    """
    if estimate.lo is None or estimate.hi is None:
        return ""
    low, high = ((written or number)(v) for v in (estimate.lo, estimate.hi))
    return say("format.likely_between", low=low, high=high)


def one_in(rate: float) -> str:
    """Write a small rate as one in so many: 0.035 is "1 in 28"."""
    return say("format.one_in", n=separated(f"{math.floor(1 / rate):,}")) if 0 < rate <= 0.5 else number(rate)


def metres(value: float) -> str:
    """Write a distance to the centimetre: 2 m, 1.83 m (six feet), 5 m."""
    return say("format.metres", n=plain(round(value, 2)))


def distance(value_m: float, unit: str = "m") -> str:
    """Write a distance in the site's unit: 2 m; in feet to a tenth: 6 ft, 1.6 ft.

    Example:
        >>> distance(2.0), distance(1.8288, "ft"), distance(0.5, "ft")
        ('2 m', '6 ft', '1.6 ft')
    """
    return metres(value_m) if unit == "m" else say("format.feet", n=plain(round(value_m / M_PER_FT, 1)))


def metres_unbroken(value: float) -> str:
    """Write a distance that stays on one line, for running text."""
    return metres(value).replace(" ", "\u00a0")


def distance_unbroken(value_m: float, unit: str = "m") -> str:
    """Write a distance in the site's unit that stays on one line."""
    return distance(value_m, unit).replace(" ", "\u00a0")


def seconds(value: float) -> str:
    """Write a duration: 3 seconds, 1 second, 2.5 seconds."""
    return say("format.seconds", plural=value, n=plain(value))


def hours(value: float) -> str:
    """Write a number of hours with its word: 10 hours, 1 hour, 2.5 hours, under an hour."""
    if 0 < value < 0.95:
        return say("format.under_an_hour")
    text = separated(f"{value:,.1f}".removesuffix(".0") if value < 10 else f"{value:,.0f}")
    return say("format.hours", plural=1 if text == "1" else 2, n=text)


def ended(text: str) -> str:
    """Return a sentence somebody wrote with a stop at its end."""
    text = text.strip()
    return text if text[-1:] in {".", "!", "?", ""} else f"{text}."


def weekday(day: date) -> str:
    """Write the day's name: Monday."""
    return days()[day.weekday()]


def day_short(day: date) -> str:
    """Write the day's name in three letters: Mon."""
    return days()[day.weekday()][:3]


def date_short(day: date) -> str:
    """Write a date shortly: Mon 9 Nov."""
    return say("format.day_date", day=day_short(day), date=day.day, month=months()[day.month - 1][:3])


def date_long(day: date) -> str:
    """Write a date in full: Monday 9 November 2026."""
    return say("format.date_long", day=weekday(day), date=day.day, month=months()[day.month - 1], year=day.year)


def date_span(first: date, last: date) -> tuple[str, str]:
    """Write two dates without repeating what they share: Monday 9, Sunday 15 November 2026."""
    head = f"{weekday(first)} {first.day}"
    if (first.month, first.year) != (last.month, last.year):
        head += f" {months()[first.month - 1]}"
    if first.year != last.year:
        head += f" {first.year}"
    return head, date_long(last)


def days_span(first: date, last: date) -> str:
    """Write days in a row: Monday 9 November 2026; 9\u201322 November 2026; 26 October \u2013 8 November 2026."""
    if first == last:
        return date_long(first)
    head = [str(first.day)]
    if (first.month, first.year) != (last.month, last.year):
        head.append(months()[first.month - 1])
    if first.year != last.year:
        head.append(str(first.year))
    dash = "\u2013" if len(head) == 1 else " \u2013 "
    return f"{' '.join(head)}{dash}{last.day} {months()[last.month - 1]} {last.year}"


def days_span_short(first: date, last: date) -> str:
    """Write days in a row shortly: Mon 9 Nov; 9\u201322 Nov; 26 Oct \u2013 8 Nov."""
    if first == last:
        return date_short(first)
    is_one_month = (first.month, first.year) == (last.month, last.year)
    head = str(first.day) if is_one_month else f"{first.day} {months()[first.month - 1][:3]} "
    return f"{head}\u2013{'' if is_one_month else ' '}{last.day} {months()[last.month - 1][:3]}"


def n_days(n: int) -> str:
    """Write a number of days: one day, 14 days."""
    return say("format.days", plural=n, n=n)


def clock(at: datetime) -> str:
    """Write the local time: 17:00."""
    return f"{at.hour:02d}:{at.minute:02d}"


def hour_label(hour: int) -> str:
    """Write an hour of the day: 08:00."""
    return f"{hour:02d}:00"


def instant_short(at: datetime) -> str:
    """Write an instant shortly: Wed 11 Nov, 12:00."""
    return say("format.instant", date=date_short(at.date()), clock=clock(at))


def instant_long(at: datetime) -> str:
    """Write an instant in full: Monday 16 November 2026, 06:00."""
    return say("format.instant", date=date_long(at.date()), clock=clock(at))


def masked(mask_below: int) -> str:
    """Write a count that is held back: <5."""
    return f"<{mask_below}"


def plain_lines(text: str, first: str = "", rest: str = "") -> str:
    """Return text as lines of a plain mail; line ends of the text itself become spaces."""
    plain = " ".join(CONTROL.sub(" ", str(text)).replace("\u00a0", " ").split())
    return textwrap.fill(
        plain, MAIL_WIDTH, initial_indent=first, subsequent_indent=rest, break_long_words=False, break_on_hyphens=False
    )


_FILTERS: Final = (
    *(number, count, percent, percent_short, signed, fewer_more, likely_change, likely_signed, likely_level),
    *(metres, metres_unbroken, distance, distance_unbroken, seconds),
    *(hours, ended, weekday, day_short, date_short, date_long, clock, hour_label),
    *(instant_short, instant_long, masked),
)
FILTERS: Final = {f.__name__: f for f in _FILTERS}
