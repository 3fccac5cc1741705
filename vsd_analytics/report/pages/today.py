"""The card of the day: its words, and the page that shows them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from email.message import EmailMessage
from typing import Final

from markupsafe import Markup

from vsd_analytics.figures.forecast import HISTORY_WEEKS
from vsd_analytics.figures.today import (
    HALF,
    DayLevel,
    SilentCamera,
    Today,
    TodayHour,
)
from vsd_analytics.report.draw.day_hours import day_hours
from vsd_analytics.report.pages import mail
from vsd_analytics.report.pages.week import policy_hash, rendered, shipped_style
from vsd_analytics.site.model import Site
from vsd_analytics.stats.unusual import Unusual
from vsd_analytics.stats.usual import Position
from vsd_analytics.version import VERSION
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

UNUSUAL_SHOWN: Final = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class DayWords:
    """A day.

    Attributes:
        title: Yesterday, Friday 13 November.
        value: Its violations, or a dash.
        unit: Their word; empty without a value.
        position: Where it lies beside its usual range; None = not known.
        judged: That in words; empty within the range.
        notes: The range and how much was recorded, as sentences.
    """

    title: str
    value: str
    unit: str
    position: Position | None
    judged: str
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class TodayWords:
    """The card.

    Attributes:
        site, floor: Names; the floor is empty where the site has only one.
        as_of: Day and clock.
        headline: One sentence, without a full stop.
        days: Yesterday and, on the operator's card, today.
        unusual: Sentences on hours far from usual, at least one; none on the card of readers.
        silent: Sentences on cameras without data.
        ahead: Sentences on what to expect, at least one.
        notes: How to read the card.
        made_by: The program.
    """

    site: str
    floor: str
    as_of: str
    headline: str
    days: tuple[DayWords, ...]
    unusual: tuple[str, ...]
    silent: tuple[str, ...]
    ahead: tuple[str, ...]
    notes: tuple[str, ...]
    made_by: str


def today_words(today: Today, site: Site) -> TodayWords:
    """Return the card in words, in the language in force.

    Args:
        today: The numbers.
        site: The site.
    """
    floors = {f.floor_id: f.name for f in site.floors}
    title = say("today.yesterday", day=fmt.date_short(today.at.date() - timedelta(days=1)))
    yesterday = _day(today.yesterday, title=title)
    days: tuple[DayWords, ...] = (yesterday,)
    until = None if today.so_far is None else today.so_far.until_hour
    title = say("today.today") if until is None else say("today.so_far", clock=fmt.hour_label(until))
    if not today.is_of_closed_days:
        days = yesterday, _day(today.so_far, title=title)
    closed = [say("today.closed_days")] if today.is_of_closed_days else []
    chance = [say("today.chance")] if any(d.position for d in days) else []
    return TodayWords(
        site=site.name,
        floor=floors.get(today.floor_id or "", "") if len(floors) > 1 else "",
        as_of=say("today.as_of", day=fmt.date_long(today.at.date()), clock=fmt.clock(today.at)),
        headline=_headline(today, days, site),
        days=days,
        unusual=() if today.is_of_closed_days else _unusual(today),
        silent=_silent(today, site),
        ahead=_ahead(today),
        notes=(say("today.as_usual", n=HISTORY_WEEKS), *chance, *closed),
        made_by=say("today.made_by", version=VERSION),
    )


def hour_words(hour: TodayHour | Unusual) -> str:
    """Write day and hour: Saturday 17:00."""
    return f"{fmt.weekday(hour.day)} {fmt.hour_label(hour.hour)}"


def _headline(today: Today, days: tuple[DayWords, ...], site: Site) -> str:
    """Name what matters most: no data, an unusual hour, a day outside its range; else that all is as usual."""
    if today.silent and len(today.silent) == today.n_cameras:
        return say("today.h_all_silent")
    if today.silent:
        return say("today.h_silent", plural=len(today.silent), cameras=_names(today.silent, site))
    if today.unusual.rows and not today.is_of_closed_days:
        return say("today.h_unusual", hour=hour_words(today.unusual.rows[0]))
    for day, when in reversed([*zip(days, ("today.on_yesterday", "today.on_today"), strict=False)]):
        if day.position in ("above", "below"):
            return say(f"today.h_{day.position}", when=say(when))
    if today.yesterday is None and today.so_far is None:
        return say("today.h_closed")
    return say("today.h_within" if any(day.position for day in days) else "today.h_unknown")


def _day(level: DayLevel | None, *, title: str) -> DayWords:
    if level is None:
        return DayWords(title=title, value=fmt.MISSING, unit="", position=None, judged="", notes=(say("today.closed"),))
    notes, position = [], level.position
    if level.usual is not None and (position is not None or level.masked_below):
        notes.append(
            say(
                "today.usual" if level.is_over else "today.usual_hours",
                low=fmt.number(level.usual.lo),
                high=fmt.number(level.usual.hi),
                weekday=fmt.weekday(level.day),
            )
        )
    else:
        notes.append(say("today.unknown", reason=reason_text(level.reason)))
    if not level.is_rough and 0 < level.recorded_hours < level.open_hours:
        notes.append(say("today.partly", n=level.recorded_hours, of=level.open_hours))
    if level.estimate is not None and level.violations is not None and abs(level.estimate - level.violations) >= HALF:
        notes.append(say("today.estimated", n=fmt.count(round(level.estimate))))
    return DayWords(
        title=title,
        value=_value(level),
        unit="" if level.violations is None and not level.masked_below else say("today.unit"),
        position=position,
        judged=say(f"today.{position}") if position in ("above", "below") else "",
        notes=tuple(notes),
    )


def _value(level: DayLevel) -> str:
    if level.masked_below:
        return fmt.masked(level.masked_below)
    if level.violations is None:
        return fmt.MISSING
    n = fmt.count(round(level.violations))
    return say("today.about", n=n) if level.is_rough and level.violations else n


def _unusual(today: Today) -> tuple[str, ...]:
    if today.unusual.state != "ok":
        return (say("today.unusual_unknown", reason=reason_text(today.unusual.reason)),)
    if not today.unusual.rows:
        return (say("today.unusual_none", plural=today.unusual.n_tested, n=today.unusual.n_tested),)
    return tuple(_unusual_hour(row) for row in today.unusual.rows[:UNUSUAL_SHOWN])


def _unusual_hour(row: Unusual) -> str:
    low, high = fmt.number(row.lo), fmt.number(row.hi)
    return fmt.ended(say("when.unusual_row", hour=hour_words(row), n=fmt.count(row.violations), low=low, high=high))


def _silent(today: Today, site: Site) -> tuple[str, ...]:
    together: dict[tuple[date | None, int | None], list[SilentCamera]] = {}
    for camera in today.silent:
        together.setdefault((camera.last_day, camera.last_hour), []).append(camera)
    lines = [_silent_since(cameras, site) for cameras in together.values()]
    return (*lines, say("today.silent_why")) if lines else ()


def _silent_since(cameras: Sequence[SilentCamera], site: Site) -> str:
    """Name cameras that stopped in the same hour."""
    names, first = _names(cameras, site), cameras[0]
    if first.last_day is None or first.last_hour is None:
        return say("today.silent_never", cameras=names, n=HISTORY_WEEKS)
    return say(
        "today.silent_since",
        cameras=names,
        day=fmt.date_short(first.last_day),
        clock=fmt.hour_label((first.last_hour + 1) % 24),
        hours=fmt.hours(first.open_hours),
    )


def _ahead(today: Today) -> tuple[str, ...]:
    """Name the fullest hours until tomorrow night; the hours of one day are compared with each other only there."""
    if all(h.is_over for h in today.hours):
        return (say("today.ahead_closed"),)
    if today.forecast_state != "ok":
        return (say("today.ahead_none", reason=reason_text(today.forecast_reason)),)
    if not today.ahead:
        return (say("today.ahead_none", reason=say("today.ahead_unknown")),)
    fullest = max(today.ahead, key=lambda h: (h.people or 0.0, -h.day.toordinal(), -h.hour))
    lines = [_expected("today.ahead_people", fullest, fullest.people, fullest.people_lo, fullest.people_hi)]
    counted = [h for h in today.ahead if h.usual is not None]
    if counted:
        worst = max(counted, key=lambda h: (h.usual or 0.0, -h.day.toordinal(), -h.hour))
        lines.append(_expected("today.ahead_violations", worst, worst.usual, worst.lo, worst.hi))
    day = fmt.weekday(fullest.day)
    return (*lines, say("today.ahead_plan", day=day, clock=fmt.hour_label(fullest.hour)))


def _expected(key: str, hour: TodayHour, value: float | None, lo: float | None, hi: float | None) -> str:
    return say(key, hour=hour_words(hour), n=fmt.number(value), low=fmt.number(lo), high=fmt.number(hi))


def _names(cameras: Sequence[SilentCamera], site: Site) -> str:
    """Write cameras as the beginning of a sentence: Camera “Aisles”; “Aisles” and “Entrance”."""
    names = {c.camera_id: c.name for c in site.cameras}
    if len(cameras) == 1:
        return terms.capital(terms.camera_name(names[cameras[0].camera_id]))
    return terms.joined(f"“{names[c.camera_id]}”" for c in cameras)


@dataclass(frozen=True, slots=True, kw_only=True)
class TodayPage:
    """Everything the templates may use.

    Attributes:
        card: The words.
        title: Title of the window.
        at: The clock, for machines.
        style, style_hash: The page's only style, and its hash for the content security policy.
        chart: The hours as a drawing; empty without an open hour, and on the card of readers.
        has_missing, has_unusual: Marks of the chart to explain.
        is_made_up: The data are those of `vsd demo`.
        is_exact: It is the operator's.
    """

    card: TodayWords
    title: str
    at: datetime
    style: Markup
    style_hash: str
    chart: Markup
    has_missing: bool
    has_unusual: bool
    is_made_up: bool
    is_exact: bool


def make_today_page(today: Today, site: Site, *, is_made_up: bool = False) -> TodayPage:
    """Return what the templates show, in the language in force; see `TodayPage`.

    Args:
        today: The numbers.
        site: The site.
        is_made_up: The data are those of `vsd demo`.
    """
    card = today_words(today, site)
    style = shipped_style("report.css") + shipped_style("today.css")
    days = {
        today.at.date() + timedelta(days=k): say(f"today.day_{name}") for k, name in enumerate(("today", "tomorrow"))
    }
    days[today.at.date() - timedelta(days=1)] = say("today.day_yesterday")
    unusual = {(row.day, row.hour) for row in today.unusual.rows}
    return TodayPage(
        card=card,
        title=say("today.title", site=site.name, day=fmt.date_short(today.at.date()), headline=card.headline),
        at=today.at,
        style=Markup(style),
        style_hash=policy_hash(style),
        chart=Markup()
        if today.is_of_closed_days
        else day_hours(today.hours, names=days, unusual=unusual, label=say("today.chart_label")),
        has_missing=any(h.is_over and h.violations is None for h in today.hours),
        has_unusual=bool(unusual),
        is_made_up=is_made_up,
        is_exact=not today.is_of_closed_days,
    )


def today_html(page: TodayPage) -> str:
    """Return the card as one self-contained HTML file."""
    return re.sub(r"\n\s*\n+", "\n", rendered("today.html.j2", page))


def today_mail(
    page: TodayPage, *, sender: str | None = None, to: Sequence[str] = (), date: datetime | None = None
) -> EmailMessage:
    """Return the card as a mail: text, and the same words as HTML with inline styles.

    Args:
        page: The card.
        sender: Address it comes from; None = a draft.
        to: Addresses it goes to.
        date: Aware instant of its `Date`; None = the clock of the card.
    """
    return mail.message(
        name=page.at.date().isoformat(),
        subject=page.title,
        text=mail.filled("today_mail.txt.j2", page),
        html=mail.filled("today_mail.html.j2", page),
        sender=sender,
        to=to,
        date=date or page.at,
    )
