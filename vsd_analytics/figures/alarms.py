"""Alarms of stored days as answers: each alarm, rule and hour, where most of them are, and how many with more patience.

Whoever applies the rules (`vsd_analytics.live`) gives the alarms; here they are counted. All counts are exact, for the
operator.
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from typing import Final

from vsd_analytics.answer import Answer, Answers, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.site.instants import day_start_ms
from vsd_analytics.site.model import AlarmKind, AlarmRule, Camera, Site
from vsd_analytics.warehouse.dimensions import QUARTER_MS, is_open
from vsd_analytics.warehouse.owner_spans import camera_life

OFTEN_PER_DAY: Final = 3.0
"""Alarms per day above which people soon stop looking: a rule of thumb, not measured."""
WAITS_S: Final = (120.0, 180.0, 300.0, 600.0)
"""Values of `for_s` to try: minutes that somebody would choose."""
PEAK_SHARE: Final = 0.5
"""Of the alarms of a place, at least this share is in the hours that are named for it."""
HOUR_MS: Final = 3_600_000
_NOTHING: Final = Reason("recorded.nothing")
_OPERATOR: Final = "operator"

ALARMS: Final = (
    Column("alarm_id", "key", audience=_OPERATOR),
    Column("rule_id", "fact", audience=_OPERATOR),
    Column("kind", "fact", audience=_OPERATOR),
    Column("floor_id", "fact", audience=_OPERATOR),
    Column("camera_id", "fact", audience=_OPERATOR),
    Column("area_id", "fact", audience=_OPERATOR),
    Column("since", "instant", audience=_OPERATOR),
    Column("started", "instant", audience=_OPERATOR),
    Column("ended", "instant", audience=_OPERATOR),
    Column("is_going_on", "fact", audience=_OPERATOR),
    Column("lasted_s", "seconds", "s", audience=_OPERATOR),
    Column("n_people_max", "count", "people", audience=_OPERATOR),
    Column("nearest_m", "fact", "m", audience=_OPERATOR),
    Column("x_m", "place", "m", audience=_OPERATOR),
    Column("y_m", "place", "m", audience=_OPERATOR),
)
"""Columns of `alarms`."""
RULES: Final = (
    Column("rule_id", "key", audience=_OPERATOR),
    Column("kind", "fact", audience=_OPERATOR),
    Column("for_s", "fact", "s", audience=_OPERATOR),
    Column("n_days", "fact", "days", audience=_OPERATOR),
    Column("n_alarms", "count", audience=_OPERATOR),
    Column("alarms_per_day", "rate", tells=("n_alarms",), per="n_days", audience=_OPERATOR),
    Column("median_s", "seconds", "s", tells=("n_alarms",), audience=_OPERATOR),
    Column("longest_s", "seconds", "s", tells=("n_alarms",), audience=_OPERATOR),
    Column("n_people_max", "count", "people", audience=_OPERATOR),
)
"""Columns of `alarm_rules`."""
HOURS: Final = (
    Column("local_date", "key", audience=_OPERATOR),
    Column("local_hour", "key", audience=_OPERATOR),
    Column("fold", "key", audience=_OPERATOR),
    Column("state", "fact", audience=_OPERATOR),
    Column("n_alarms", "count", audience=_OPERATOR),
)
"""Columns of `alarm_hours`."""
WAITS: Final = (
    Column("rule_id", "key", audience=_OPERATOR),
    Column("for_s", "key", "s", audience=_OPERATOR),
    Column("n_alarms", "count", audience=_OPERATOR),
    Column("alarms_per_day", "rate", tells=("n_alarms",), audience=_OPERATOR),
    Column("is_suggested", "fact", audience=_OPERATOR),
)
"""Columns of `alarm_waits`."""
PEAK: Final = (
    Column("area_id", "key", audience=_OPERATOR),
    Column("camera_id", "key", audience=_OPERATOR),
    Column("first_hour", "fact", audience=_OPERATOR),
    Column("end_hour", "fact", audience=_OPERATOR),
    Column("n_alarms", "count", audience=_OPERATOR),
)
"""Columns of `alarm_peak`."""


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm as far as it is known.

    Attributes:
        alarm_id: Its id, the same in every replay.
        rule_id, kind: Its rule.
        floor_id, camera_id: Its place.
        area_id: Area of the rule; None without one.
        since: When the situation began.
        started: When the alarm started, `for_s` later or more.
        ended: When the situation was last true; None = not yet.
        lasted_s: From `since` to the end or, without one, to the last that is known.
        n_people_max: Most people in it; None for a silence.
        nearest_m: Least distance within it; None when unknown.
        x_m, y_m: Its place, to half a metre; None when unknown.
    """

    alarm_id: str
    rule_id: str
    kind: AlarmKind
    floor_id: str
    camera_id: str
    area_id: str | None
    since: datetime
    started: datetime
    ended: datetime | None
    lasted_s: float
    n_people_max: int | None
    nearest_m: float | None
    x_m: float | None
    y_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmDays:
    """What rules gave over some days.

    Attributes:
        rules: The rules.
        days: The local days, in order.
        alarms: Alarms that were going on at some time of these days.
        n_waited: Alarms by rule and `for_s`, had the rule had this one.
        recorded: Camera and start of each local hour, in UTC milliseconds, of which a record was read.
        now: The clock: later hours are not over.
    """

    rules: Sequence[AlarmRule]
    days: Sequence[date]
    alarms: Sequence[Alarm]
    n_waited: Mapping[tuple[str, float], int]
    recorded: Collection[tuple[str, int]]
    now: datetime


@dataclass(frozen=True, slots=True)
class _Hour:
    """A local hour: when it starts, whether the site is open in it, and the cameras that sent a record."""

    start: datetime
    start_ms: int
    is_open: bool
    cameras: frozenset[str]


def longer_waits(rules: Sequence[AlarmRule]) -> list[tuple[AlarmRule, float]]:
    """Return each rule with each `for_s` of `WAITS_S` that is longer than its own."""
    return [(rule, for_s) for rule in rules for for_s in WAITS_S if for_s > rule.for_s]


def local_hour_ms(ms: int, site: Site) -> int:
    """Return the start of the local hour of an instant; both are UTC milliseconds."""
    local = datetime.fromtimestamp(ms / 1000, tz=site.zone)
    return ms - (local.minute * 60 + local.second) * 1000 - ms % 1000


def alarm_answers(alarm_days: AlarmDays, site: Site) -> Answers:
    """Return the alarms of some days, and what they add up to.

    `alarms`: each alarm, in order of its start. `alarm_rules`: each rule; `n_days` are the days on which its cameras
    sent records while it watched (of a silence: the days it watched), and `alarms_per_day` is per such day.
    `alarm_hours`: each local hour with how many alarms started in it; `state` is "closed" (no rule watched),
    "not_over", "no_data" (no camera sent a record: only a silence can be known), "partial" (some camera sent none) or
    "ok". `alarm_waits`: how many alarms each rule would have had with a longer `for_s`; `is_suggested` marks the least
    one that has at most `OFTEN_PER_DAY` a day, of a rule that has more. `alarm_peak`: the place with most alarms, and
    the shortest run of hours of the day that has at least half of them; `end_hour` is when it ends, 1 to 24.

    Args:
        alarm_days: Rules, alarms and recorded hours.
        site: The site.
    """
    first, last = alarm_days.days[0], alarm_days.days[-1]
    is_running = alarm_days.now.astimezone(site.zone).date() <= last
    until = alarm_days.now if is_running else None
    holds = HoldsFor(site.site_id, None, first, last, until, site.settings.settings_id())
    hours = [hour for day in alarm_days.days for hour in _hours(alarm_days, day, site)]
    end = datetime.fromtimestamp(day_start_ms(last + timedelta(days=1), site.zone) / 1000, tz=UTC)
    rules = tuple(_rule(rule, alarm_days, hours, site) for rule in alarm_days.rules)
    nothing = None if alarm_days.rules else Reason("alarms.no_rules")
    return Answers(
        (
            Answer("alarms", ALARMS, tuple(_alarm(a, end) for a in alarm_days.alarms), holds, nothing=nothing),
            Answer("alarm_rules", RULES, rules, holds, nothing=nothing),
            Answer("alarm_hours", HOURS, tuple(_hour(hour, alarm_days, site) for hour in hours), holds),
            Answer("alarm_waits", WAITS, tuple(_waits(rules, alarm_days)), holds, nothing=nothing),
            Answer("alarm_peak", PEAK, _peak(alarm_days.alarms), holds, nothing=nothing),
        )
    )


def _hours(alarm_days: AlarmDays, day: date, site: Site) -> Iterator[_Hour]:
    start_ms, end_ms = day_start_ms(day, site.zone), day_start_ms(day + timedelta(days=1), site.zone)
    cameras = [c.camera_id for c in site.cameras]
    for ms in range(start_ms, end_ms, HOUR_MS):
        start = datetime.fromtimestamp(ms / 1000, tz=site.zone)
        quarters = (datetime.fromtimestamp(q / 1000, tz=site.zone) for q in range(ms, ms + HOUR_MS, QUARTER_MS))
        has_open = any(is_open(site, q.date(), q.hour * 60 + q.minute) for q in quarters)
        yield _Hour(start, ms, has_open, frozenset(c for c in cameras if (c, ms) in alarm_days.recorded))


def _watches(rule: AlarmRule, hour: _Hour) -> bool:
    return hour.is_open or not rule.is_open_only


def _cameras(rule: AlarmRule, site: Site) -> list[Camera]:
    return [c for c in site.cameras if not rule.camera_ids or c.camera_id in rule.camera_ids]


def _alarm(alarm: Alarm, end: datetime) -> Row:
    n = alarm.n_people_max
    return {
        "alarm_id": alarm.alarm_id,
        "rule_id": alarm.rule_id,
        "kind": alarm.kind,
        "floor_id": alarm.floor_id,
        "camera_id": alarm.camera_id,
        "area_id": alarm.area_id,
        "since": alarm.since,
        "started": alarm.started,
        "ended": alarm.ended,
        "is_going_on": alarm.ended is None or alarm.ended >= end,
        "lasted_s": Value(alarm.lasted_s),
        "n_people_max": Value.missing(Reason("alarms.silence"), "not_measurable") if n is None else Value(n),
        "nearest_m": alarm.nearest_m,
        "x_m": alarm.x_m,
        "y_m": alarm.y_m,
    }


def _rule(rule: AlarmRule, alarm_days: AlarmDays, hours: Sequence[_Hour], site: Site) -> Row:
    cameras = {c.camera_id for c in _cameras(rule, site)}
    watched = [h for h in hours if _watches(rule, h) and h.start < alarm_days.now]
    n_days = len({h.start.date() for h in watched if rule.kind == "silence" or cameras & h.cameras})
    alarms = [a for a in alarm_days.alarms if a.rule_id == rule.alarm_id]
    lasted = [a.lasted_s for a in alarms]
    people = [a.n_people_max for a in alarms if a.n_people_max is not None]
    none = Value.missing(Reason("alarms.none") if n_days else _NOTHING)
    return {
        "rule_id": rule.alarm_id,
        "kind": rule.kind,
        "for_s": rule.for_s,
        "n_days": n_days,
        "n_alarms": Value(len(alarms)) if n_days or alarms else none,
        "alarms_per_day": _per_day(len(alarms), n_days),
        "median_s": Value(statistics.median(lasted)) if lasted else none,
        "longest_s": Value(max(lasted)) if lasted else none,
        "n_people_max": Value(max(people)) if people else _no_people(rule) or none,
    }


def _no_people(rule: AlarmRule) -> Value | None:
    return Value.missing(Reason("alarms.silence"), "not_measurable") if rule.kind == "silence" else None


def _per_day(n: int, n_days: int) -> Value:
    return Value(n / n_days) if n_days else Value.missing(_NOTHING)


def _hour(hour: _Hour, alarm_days: AlarmDays, site: Site) -> Row:
    rules = [r for r in alarm_days.rules if _watches(r, hour)]
    there = {
        c.camera_id
        for r in rules
        for c in _cameras(r, site)
        if camera_life(site, c)[0] < hour.start_ms + HOUR_MS and camera_life(site, c)[1] > hour.start_ms
    }
    n = sum(hour.start_ms <= a.started.timestamp() * 1000 < hour.start_ms + HOUR_MS for a in alarm_days.alarms)
    if there & hour.cameras:
        state = "ok" if there <= hour.cameras else "partial"
    elif not there:
        state = "closed"
    else:
        state = "not_over" if hour.start + timedelta(hours=1) > alarm_days.now else "no_data"
    unknown = {"closed": Reason("today.closed"), "not_over": Reason("today.not_over"), "no_data": _NOTHING}
    return {
        "local_date": hour.start.date(),
        "local_hour": hour.start.hour,
        "fold": hour.start.fold,
        "state": state,
        "n_alarms": Value.missing(unknown[state]) if state in unknown and not n else Value(n),
    }


def _waits(rules: Sequence[Row], alarm_days: AlarmDays) -> Iterator[Row]:
    """Yield each rule with each longer `for_s`; a rule that is not known to ring too often gets no suggestion."""
    for row in rules:
        rule_id, n_days, now = row["rule_id"], row["n_days"], row["alarms_per_day"]
        assert isinstance(rule_id, str)
        assert isinstance(n_days, int)
        assert isinstance(now, Value)
        needs_one = now.value is not None and now.value > OFTEN_PER_DAY
        for rule, for_s in longer_waits([r for r in alarm_days.rules if r.alarm_id == rule_id]):
            n = alarm_days.n_waited[rule.alarm_id, for_s]
            per_day = _per_day(n, n_days)
            is_suggested = needs_one and per_day.value is not None and per_day.value <= OFTEN_PER_DAY
            needs_one = needs_one and not is_suggested
            counted = Value(n) if n_days or n else Value.missing(_NOTHING)
            yield {
                "rule_id": rule_id,
                "for_s": for_s,
                "n_alarms": counted,
                "alarms_per_day": per_day,
                "is_suggested": is_suggested,
            }


def _peak(alarms: Sequence[Alarm]) -> tuple[Row, ...]:
    """Return the place with most alarms and its hours; of equal ones the first by id, none without an alarm."""
    places = Counter((a.area_id, None if a.area_id else a.camera_id) for a in alarms)
    if not places:
        return ()
    place = min(places, key=lambda p: (-places[p], p[0] or "", p[1] or ""))
    there = Counter(a.started.hour for a in alarms if (a.area_id, None if a.area_id else a.camera_id) == place)
    runs = [(first, end) for first in range(24) for end in range(first + 1, 25)]
    counted = {run: sum(there[hour] for hour in range(*run)) for run in runs}
    least = PEAK_SHARE * places[place]
    first, end = min((run for run in runs if counted[run] >= least), key=lambda r: (r[1] - r[0], -counted[r], r[0]))
    row: Row = {
        "area_id": place[0],
        "camera_id": place[1],
        "first_hour": first,
        "end_hour": end,
        "n_alarms": Value(counted[first, end]),
    }
    return (row,)
