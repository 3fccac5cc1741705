"""The page of alarms: what rang, where and when, and what would make a rule that rings too often useful."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime
from typing import Any, Final

from markupsafe import Markup

from vsd_analytics.answer import Answers, Row, value_of
from vsd_analytics.figures.alarms import OFTEN_PER_DAY
from vsd_analytics.report.pages.tables import (
    Cell,
    Step,
    TimetableRow,
    TimetableRows,
    blocks,
    joined,
    legend,
    step_of,
)
from vsd_analytics.report.pages.week import policy_hash, rendered, shipped_style
from vsd_analytics.site.model import Site
from vsd_analytics.version import VERSION
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say

LONGEST_SHOWN: Final = 10
HOUR_STEPS: Final = (1.0, 3.0, 6.0, 12.0, 24.0)
"""Lower ends of the colour steps of an hour: each doubles."""
_WEEK_DAYS: Final = 7


@dataclass(frozen=True, slots=True, kw_only=True)
class WaitWords:
    """What a longer `for_s` would do to a rule that rings too often.

    Attributes:
        title: The rule and what it watches for.
        text: How often it rings, and which wait would be enough, if any.
        line: Line for vsd.toml; empty where none is enough.
        rows: Wait, alarms, alarms a day; the first is the rule as it is.
    """

    title: str
    text: str
    line: str
    rows: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmPage:
    """Everything the template may use.

    Attributes:
        site: Name of the site.
        span: The days.
        title: Title of the window.
        headline: One sentence, without a full stop.
        notes: What a reader must know first, as sentences.
        waits: Rules that ring too often.
        waits_note: What may be said of the others; empty for nothing.
        rules: Cells of each rule.
        blocks: The timetable in parts of at most seven days; none without a rule.
        used: States of hours that occur.
        hour_legend: Steps of the timetable's ramp.
        longest: Cells of the longest alarms of people.
        silences: Cells of the longest silences of cameras.
        style, style_hash: The page's only style, and its hash for the content security policy.
        first: First day, for machines.
        is_made_up: The data are those of `vsd demo`.
        made_by: The program.
    """

    site: str
    span: str
    title: str
    headline: str
    notes: tuple[str, ...]
    waits: tuple[WaitWords, ...]
    waits_note: str
    rules: tuple[tuple[str, ...], ...]
    blocks: tuple[TimetableRows, ...]
    used: frozenset[str]
    hour_legend: tuple[Step, ...]
    longest: tuple[tuple[str, ...], ...]
    silences: tuple[tuple[str, ...], ...]
    style: Markup
    style_hash: str
    first: date
    is_made_up: bool
    made_by: str


def make_alarm_page(answers: Answers, site: Site, *, is_made_up: bool = False) -> AlarmPage:
    """Return what the template shows, in the language in force; see `AlarmPage`.

    Args:
        answers: Those of `vsd_analytics.figures.alarms.alarm_answers`.
        site: The site.
        is_made_up: The data are those of `vsd demo`.
    """
    holds = answers["alarms"].holds_for
    headline = _headline(answers, site)
    span = fmt.days_span(holds.first, holds.last)
    style = shipped_style("report.css") + shipped_style("alarms.css")
    table = _timetable(answers)
    alarms = answers["alarms"].rows
    return AlarmPage(
        site=site.name,
        span=span,
        title=say("alarms.page_title", site=site.name, headline=headline),
        headline=headline,
        notes=_notes(answers, site),
        waits=tuple(_wait(row, answers, site) for row in answers["alarm_rules"].rows if _is_often(row)),
        waits_note=_waits_note(answers),
        rules=tuple(_rule(row, site) for row in answers["alarm_rules"].rows),
        blocks=blocks(table) if table.rows else (),
        used=table.used,
        hour_legend=legend(HOUR_STEPS, is_count=True),
        longest=_longest([row for row in alarms if row["kind"] != "silence"], site),
        silences=tuple(row[:-1] for row in _longest([row for row in alarms if row["kind"] == "silence"], site)),
        style=Markup(style),
        style_hash=policy_hash(style),
        first=holds.first,
        is_made_up=is_made_up,
        made_by=say("today.made_by", version=VERSION),
    )


def alarm_html(page: AlarmPage) -> str:
    """Return the page as one self-contained HTML file."""
    return re.sub(r"\n\s*\n+", "\n", rendered("alarms.html.j2", page))


def _span_words(first: date, last: date) -> str:
    """Write the days as part of a sentence: in week 46; on Wednesday 11 November 2026; on 9–22 November 2026."""
    if first.weekday() == 0 and (last - first).days == _WEEK_DAYS - 1:
        return say("alarms.in_week", n=first.isocalendar().week)
    return say("alarms.on_days", days=fmt.days_span(first, last))


def _headline(answers: Answers, site: Site) -> str:
    holds = answers["alarms"].holds_for
    span = _span_words(holds.first, holds.last)
    n = len(answers["alarms"].rows)
    if not answers["alarm_rules"].rows:
        return say("alarms.h_no_rules")
    if not n:
        is_known = any(row["state"] in ("ok", "partial") for row in answers["alarm_hours"].rows)
        return say("alarms.h_none" if is_known else "alarms.h_unknown", span=span)
    (peak,) = answers["alarm_peak"].rows
    n_there = _number(peak, "n_alarms")
    where = _place(peak, site)
    if n == 1 or n_there == 1:
        return say("alarms.h_few", plural=n, n=fmt.count(n), span=span, where=where)
    key = "alarms.h_all" if n_there == n else "alarms.h_peak"
    start, end = (fmt.hour_label(_whole(peak, name)) for name in ("first_hour", "end_hour"))
    return say(key, n=fmt.count(n), span=span, part=fmt.count(n_there), where=where, start=start, end=end)


def _notes(answers: Answers, site: Site) -> tuple[str, ...]:
    alarms, hours = answers["alarms"].rows, answers["alarm_hours"].rows
    holds = answers["alarms"].holds_for
    if not answers["alarm_rules"].rows:
        return (say("alarms.write_rules"),)
    going_on = sum(bool(row["is_going_on"]) for row in alarms)
    before = sum(
        isinstance(at := row["started"], datetime) and at.astimezone(site.zone).date() < holds.first for row in alarms
    )
    watched = [row for row in hours if row["state"] not in ("closed", "not_over")]
    missing = sum(row["state"] == "no_data" for row in watched)
    notes = []
    if missing:
        notes.append(say("alarms.missing", plural=missing, n=fmt.count(missing), of=fmt.count(len(watched))))
    if going_on:
        notes.append(say("alarms.going_on", plural=going_on, n=fmt.count(going_on)))
    if before:
        notes.append(say("alarms.before", plural=before, n=fmt.count(before)))
    if holds.until is not None:
        notes.append(say("alarms.until", at=fmt.instant_short(holds.until.astimezone(site.zone))))
    if site.settings.people != "all":
        notes.append(say("alarms.everybody"))
    if len(site.floors) > 1:
        notes.append(say("alarms.floors", floors=terms.joined(f.name for f in site.floors)))
    return tuple(notes)


def _is_often(row: Row) -> bool:
    per_day = value_of(row, "alarms_per_day").value
    return per_day is not None and per_day > OFTEN_PER_DAY


def _waits_note(answers: Answers) -> str:
    rules = answers["alarm_rules"].rows
    if not any(value_of(row, "n_alarms").value for row in rules):
        return ""
    if not any(map(_is_often, rules)):
        return say("alarms.none_often", most=fmt.plain(OFTEN_PER_DAY))
    return say("alarms.waits_note")


def _wait(rule: Row, answers: Answers, site: Site) -> WaitWords:
    rule_id, for_s = str(rule["rule_id"]), _seconds(rule["for_s"])
    waits = list(answers["alarm_waits"].where(rule_id=rule_id))
    suggested = next((row for row in waits if row["is_suggested"]), None)
    n, most, line = _per_day(rule), fmt.plain(OFTEN_PER_DAY), ""
    if suggested is not None:
        wait = _seconds(suggested["for_s"])
        text = say("alarms.would", n=n, most=most, wait=_duration(wait), then=_per_day(suggested))
        line = f"for_s = {wait:g}"
    else:
        text = say("alarms.would_not" if waits else "alarms.waits_long", n=n, most=most)
    advice = "" if line else say("alarms.repair" if rule["kind"] == "silence" else "alarms.narrow")
    rows = ((_duration(for_s), _count(rule, "n_alarms"), _per_day(rule)),)
    return WaitWords(
        title=_rule_name(rule, site),
        text=f"{text} {advice}".strip(),
        line=line,
        rows=(*rows, *((_duration(_seconds(w["for_s"])), _count(w, "n_alarms"), _per_day(w)) for w in waits)),
    )


def _rule(row: Row, site: Site) -> tuple[str, ...]:
    n_days = row["n_days"]
    assert isinstance(n_days, int)
    lengths = [
        fmt.MISSING if (s := value_of(row, name).value) is None else _duration(s) for name in ("median_s", "longest_s")
    ]
    return (
        _rule_name(row, site),
        _count(row, "n_alarms"),
        fmt.count(n_days),
        _per_day(row),
        *lengths,
        _count(row, "n_people_max"),
    )


def _rule_name(row: Row, site: Site) -> str:
    """Write a rule: queue-too-full: 4 people or more for 60 s at Checkout queue."""
    rule_id = str(row["rule_id"])
    rule = next((r for r in site.alarms if r.alarm_id == rule_id), None)
    if rule is None:
        return rule_id
    what = say(f"alarms.kind_{rule.kind}", n=rule.n_people, wait=_duration(rule.for_s))
    names = {area.area_id: area.name for area in site.areas}
    where = say("alarms.at", where=names.get(rule.area_id, rule.area_id)) if rule.area_id else ""
    return say("alarms.rule", id=rule_id, what=what, where=where).strip()


def _timetable(answers: Answers) -> TimetableRows:
    """Lay the hours out as the report does: hours down, days across; hours in which no rule watched are left out."""
    at = {(row["local_date"], row["local_hour"], row["fold"]): row for row in answers["alarm_hours"].rows}
    days = tuple(sorted({day for day, _, _ in at if isinstance(day, date)}))
    shown = sorted(
        {
            (hour, fold)
            for (_, hour, fold), row in at.items()
            if isinstance(hour, int) and isinstance(fold, int) and row["state"] != "closed"
        }
    )
    if shown:
        shown = sorted({*shown, *((h, 0) for h in range(shown[0][0], shown[-1][0] + 1))})
    rows = [
        TimetableRow(
            label=f"{hour:02d}",
            is_second=bool(fold),
            cells=tuple(_cell(at.get((day, hour, fold))) for day in days),
            mean=None,
            bar=Markup(),
        )
        for hour, fold in shown
    ]
    used = frozenset(word for row in rows for cell in row.cells for word in cell.style.split())
    return TimetableRows(days=days, rows=joined(rows), day_means=(None,) * len(days), used=used)


def _cell(row: Row | None) -> Cell:
    if row is None:
        return Cell("nx", "", say("when.cell_no_hour"))
    n, state = value_of(row, "n_alarms").value, row["state"]
    if state == "no_data":
        return Cell("hatch", fmt.count(n) if n else "", say("when.cell_no_data"))
    if state == "not_over" and n is None:
        return Cell("to", "", say("when.cell_not_over"))
    if n is None:
        return Cell("cl", fmt.MISSING, say("when.cell_closed"))
    is_part = state == "partial"
    style = f"b{step_of(n, HOUR_STEPS)}{' part' if is_part else ''}"
    return Cell(style, fmt.count(n), say("when.cell_incomplete") if is_part else "")


def _longest(alarms: Sequence[Row], site: Site) -> tuple[tuple[str, ...], ...]:
    rows = sorted(alarms, key=lambda row: -_number(row, "lasted_s"))[:LONGEST_SHOWN]
    return tuple(
        (
            fmt.instant_short(_local(row["since"], site)),
            _lasted(row),
            str(row["rule_id"]),
            _place(row, site),
            _count(row, "n_people_max"),
        )
        for row in rows
    )


def _lasted(row: Row) -> str:
    lasted = _duration(_number(row, "lasted_s"))
    return say("alarms.lasted_so_far", time=lasted) if row["ended"] is None else lasted


def _place(row: Row, site: Site) -> str:
    """Write a place: an area, else a camera; with its floor where the site has several."""
    area_id, camera_id = row["area_id"], row["camera_id"]
    area = next((a for a in site.areas if a.area_id == area_id), None)
    camera = next((c for c in site.cameras if c.camera_id == camera_id), None)
    if area is not None:
        name, floor_id = area.name, area.floor_id
    elif camera is not None:
        name, floor_id = terms.camera_name(camera.name), camera.floor_id
    else:
        return str(area_id or camera_id)
    if len(site.floors) < 2:
        return name
    floor = next((f.name for f in site.floors if f.floor_id == floor_id), str(floor_id))
    return say("alarms.on_floor", where=name, floor=floor)


def _duration(seconds: float) -> str:
    """Write a duration on one line: 45 s, 3 min 56 s, 10 min, 1 h 05 min."""
    return _duration_words(seconds).replace(" ", "\u00a0")


def _duration_words(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes_of_hour = divmod(minutes, 60)
    if hours:
        return say("alarms.hours_minutes", h=hours, min=f"{minutes_of_hour:02d}")
    if not minutes:
        return say("alarms.seconds", s=rest)
    return say("alarms.minutes_seconds", min=minutes, s=rest) if rest else say("alarms.minutes", min=minutes)


def _count(row: Row, column: str) -> str:
    return fmt.count(value_of(row, column).value)


def _per_day(row: Row) -> str:
    value = value_of(row, "alarms_per_day").value
    return fmt.MISSING if value is None else fmt.plain(round(value, 1))


def _number(row: Row, column: str) -> float:
    value = value_of(row, column).value
    assert value is not None
    return value


def _whole(row: Row, column: str) -> int:
    cell = row[column]
    assert isinstance(cell, int)
    return cell


def _seconds(cell: Any) -> float:
    return float(cell)


def _local(cell: Any, site: Site) -> datetime:
    at: datetime = cell
    return at.astimezone(site.zone)
