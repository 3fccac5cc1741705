"""Checks of times: their zone, their steps, their year (W223, W224, W227)."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from datetime import date, timedelta
from typing import Final

import numpy as np
import pandas as pd

from vsd_analytics.ingest.checks.check_case import (
    ROWS_MIN,
    Case,
    SourceCheck,
    SourceWarning,
    always,
    has_columns,
    has_tracks,
)
from vsd_analytics.ingest.checks.sample import Ints, Sample
from vsd_analytics.ingest.reading.cell_values import is_number
from vsd_analytics.ingest.reading.column_hints import named_like
from vsd_analytics.ingest.reading.instants import utc_to_local
from vsd_analytics.site.calendar import Opening
from vsd_analytics.site.model import Site

_DAY_MS, _HOUR_MS, _MINUTE_MS = 86_400_000, 3_600_000, 60_000
_ALWAYS: Opening = (((0, 24 * 60),),) * 7
_FIRST_MS, _LAST_MS = (int(pd.Timestamp(f"{year}-01-01", tz="UTC").timestamp() * 1000) for year in (2005, 2100))
_SILENCE_MS: Final = 10 * _MINUTE_MS
_GPS_MS: Final = 315_964_800_000
RECENT_DAYS: Final = 60
"""Files are imported within so many days. A wider limit would warn of more recordings of ten years ago."""
GOING_ON_MIN: Final = 2
SET_BACK_MS: Final = 30_000
ON_M, ON_SHARE = 1.5, 0.8
"""Nobody walks further from one frame to the next, and no more people come or go."""
SETS_MAX: Final = 5
"""Steps back in one file: a file sorted by person has one for each."""
CLOSED_SHARE: Final = 0.9
OUTSIDE_SHARE, INSIDE_SHARE = 0.05, 0.01
"""Of the records: staff come before the first visitor and leave after the last one, so a few are always outside."""
_OFFSET_MISTAKES: Final = {
    1: "a program may have counted local time as UTC",
    2: "a program may have added the offset from UTC where it had to subtract it",
}
"""By how many offsets the times are wrong."""


def _zones(case: Case) -> Iterator[SourceWarning]:
    site, sample = case.site, case.sample
    if case.options.zone is not None or not sample.n:
        return
    stated = {name for c in site.cameras if c.has_clock for name in (c.camera_id, *c.engine_ids)}
    is_assumed = (sample.zone.no >= 0) & ~sample.camera.is_in(stated)
    if not is_assumed.any():
        return
    zone = sample.zone.names[sample.zone.no[is_assumed][0]]
    here, there = (utc_to_local(sample.ts_ms[is_assumed], name) for name in (site.timezone, zone))
    if (here == there).all():
        return
    as_read, as_local = (f"{_clock(int(local.min()))} to {_clock(int(local.max()))}" for local in (here, there))
    shares = ""
    if site.hours.weeks:
        open_as_read, open_as_local = open_share(here, site), open_share(there, site)
        shares = f"; {open_as_read:.0%} and {open_as_local:.0%} of the records would be in opening hours"
    camera = next((c.camera_id for c in (*case.cameras, *site.cameras)), "cam-1")
    yield SourceWarning(
        f"times have no offset and are taken as {zone}: in {site.timezone} they are {as_read}",
        f"if they are on the clock of the site, they are {as_local}{shares}",
        f'--zone {site.timezone} or --zone {zone}; for good: clock = "{site.timezone}" under [[camera]] {camera}',
    )


def _clock(local_ms: int) -> str:
    day = date(1970, 1, 1) + timedelta(days=local_ms // _DAY_MS) if abs(local_ms) < 2**47 else None
    minutes = local_ms % _DAY_MS // _MINUTE_MS
    return f"{day} {minutes // 60:02d}:{minutes % 60:02d}"


def open_share(local_ms: np.ndarray, site: Site) -> float:
    """Return the share of local times in opening hours; the small hours belong to the day before where it is open."""
    if not site.hours.weeks:
        return 1.0
    days, minutes = local_ms // _DAY_MS, local_ms % _DAY_MS / _MINUTE_MS
    closed = {(day - date(1970, 1, 1)).days for day in site.closed}
    is_open = np.zeros(len(local_ms), dtype=bool)
    for back in (0, 1):
        weekday = (days - back + 3) % 7  # 1970-01-01 was a Thursday
        is_closed = np.isin(days - back, list(closed))
        at = minutes + back * 24 * 60
        for opening, holds in _holding(days - back, site):
            for day, spans in enumerate(opening or _ALWAYS):
                for start, end in spans:
                    is_open |= holds & (weekday == day) & ~is_closed & (at >= start) & (at < end)
    return float(is_open.mean()) if len(is_open) else 0.0


def _holding(days: np.ndarray, site: Site) -> Iterator[tuple[Opening | None, np.ndarray]]:
    """Yield opening hours, and on which days since 1970 they hold."""
    spans = site.hours.spans
    since = np.array([(first - date(1970, 1, 1)).days for first, _ in spans])
    which = np.searchsorted(since, days, side="right") - 1
    for k, (_, opening) in enumerate(spans):
        yield opening, which == k


def _mixed_offsets(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if case.options.zone is not None or sample.n < ROWS_MIN:
        return
    has_none = sample.zone.no >= 0
    if len(np.intersect1d(sample.camera.no[has_none], sample.camera.no[~has_none])):
        yield SourceWarning(
            f"{has_none.sum():,} of {sample.n:,} times have no offset, and are taken as {min(sample.zone.names)}; "
            "the others have one",
            "two programs with two clocks may have written the file: people would be hours apart who were together",
            "export all times with their offset, or one file for each clock",
        )


def _hour_back(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if sample.n < 5 * ROWS_MIN:
        return
    steps_ms = _steps_ms(sample.camera.no, sample.ts_ms)
    back = steps_ms[steps_ms < 0]
    if len(back) == 1 and -_HOUR_MS <= back[0] <= -_HOUR_MS + _SILENCE_MS:
        at = int(sample.ts_ms[:-1][steps_ms < 0][0])
        yield SourceWarning(
            f"the clock goes back by an hour once, at {_clock(at)} (UTC, as it is read)",
            "put right, or put back at the end of summer time: the hour would be stored on top of the one before",
            "export the records before and after it as two files, the wrong ones with corrected times"
            if not sample.zone.names
            else "export times with their offset: nothing else tells the second of two such hours from the first",
        )


def _steps_ms(camera_no: Ints, ts_ms: Ints) -> Ints:
    """Return the steps from record to record in the order of the file; 0 to another camera."""
    return np.where(camera_no[1:] == camera_no[:-1], np.diff(ts_ms), 0)


def _clock_set(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if not sample.has_floor:
        return
    row = np.flatnonzero(sample.track.no >= 0)
    steps_ms = _steps_ms(sample.camera.no[row], sample.ts_ms[row])
    is_hour_back = (steps_ms >= -_HOUR_MS) & (steps_ms <= _SILENCE_MS - _HOUR_MS)
    is_set = ((steps_ms < -SET_BACK_MS) & ~is_hour_back) | (steps_ms > _SILENCE_MS)
    if not 0 < is_set.sum() <= SETS_MAX:
        return
    columns = {"camera_no": sample.camera.no, "track_no": sample.track.no, "ts_ms": sample.ts_ms}
    rows = pd.DataFrame(columns | {"x": sample.floor_m[:, 0], "y": sample.floor_m[:, 1]}).iloc[row]
    for i in np.flatnonzero(is_set) + 1:
        camera, before_ms, after_ms = rows["camera_no"].iloc[i], rows["ts_ms"].iloc[i - 1], rows["ts_ms"].iloc[i]
        before, after, known = (
            part[(part["camera_no"] == camera) & (part["ts_ms"] == ms)].drop_duplicates("track_no")
            for part, ms in ((rows[:i], before_ms), (rows[i:], after_ms), (rows[:i], after_ms))
        )
        both = before.merge(after, on="track_no", suffixes=("", "_2"))
        n_on = int((np.hypot(both["x"] - both["x_2"], both["y"] - both["y_2"]) <= ON_M).sum())
        is_copy = len(known.merge(after, on=["track_no", "x", "y"])) > 0
        if n_on >= max(GOING_ON_MIN, ON_SHARE * max(len(before), len(after))) and not is_copy:
            step_ms = int(after_ms - before_ms)
            yield SourceWarning(
                f"after {_clock(int(before_ms))} (UTC) comes {_clock(int(after_ms))}, and {n_on} people go on in place",
                "the clock was set: people of two moments would be stored as those of one"
                if step_ms < 0
                else "the clock was set, or the engine paused: the records before or after it have a wrong time",
                "export the records before and after it as two files, the wrong ones with corrected times",
                is_note=step_ms > 0,
            )


def _named_utc(case: Case) -> Iterator[SourceWarning]:
    theirs = "" if case.head is None else case.head.plan.names.get("ts", "")
    zones = sorted(set(case.sample.zone.names) - {"UTC"})
    if zones and not {"utc", "gmt"}.isdisjoint(re.findall(r"[a-z]+", theirs.lower())):
        yield SourceWarning(
            f"{theirs[:80]!r} names UTC, and its times are read as {zones[0]}",
            "people would be stored hours too early or too late",
            "--zone UTC if the name is right",
        )


def _gps(case: Case) -> Iterator[SourceWarning]:
    if case.now is None or case.sample.n < ROWS_MIN:
        return
    written = str(next(iter(case.columns.rows.values()), {}).get(case.columns.plan.names.get("ts", ""), ""))
    late_ms = case.now.timestamp() * 1000 - _GPS_MS - float(np.median(case.sample.ts_ms))
    if is_number(written) and -_DAY_MS < late_ms < RECENT_DAYS * _DAY_MS:
        yield SourceWarning(
            f"times are {_GPS_MS / 365.2425 / _DAY_MS:.0f} years old, and as seconds since 1980 they would be recent",
            "GPS clocks count from 6 January 1980: all records would be stored ten years too early",
            "add 315964800 and take away the leap seconds (18 since 2017), or export ISO times",
        )


def _merging(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if sample.n < ROWS_MIN or case.options.period_s is not None:
        return
    local = _written_ms(sample)
    n_second, n_instants = sample.n_second, sample.n_instants
    share = n_second / sample.n
    if case.head is not None and "ts" in case.head.plan.theirs and not (local % _DAY_MS).any():
        times = named_like(case.head.ignored, "time")
        theirs = case.head.plan.names["ts"]
        yield SourceWarning(
            "all times are midnight: ts seems to be a date without the time of day",
            f"{n_second:,} of {sample.n:,} rows would be left out as second sightings; the others would be one frame",
            f"--map {shlex.quote(f'ts={theirs}+{times[0]}')}"
            if times
            else "export the time of day too, in the same column or in one beside it",
            is_sure=True,
        )
    elif share > 0.5:
        is_coarse = not (local % _MINUTE_MS).any()
        why = "a person has one place at a time; " + (
            "the times are whole minutes, so that frames of one minute cannot be distinguished"
            if is_coarse
            else "the times are days since 1899, as Excel counts them: export them as text"
            if 20_000_000 < np.median(sample.ts_ms) < 80_000_000
            else "the times are too coarse, or the ids belong to several people"
        )
        fix = "export times with seconds and parts of seconds; or keep one record of each period: --period "
        yield SourceWarning(
            f"{n_second:,} of {sample.n:,} rows would be left out as second sightings",
            why,
            fix + ("60" if is_coarse else "1"),
            is_sure=True,
        )
    elif case.head is not None and not (local % _MINUTE_MS).any() and not sample.has_ids and sample.n >= 5 * n_instants:
        yield SourceWarning(
            f"the times are whole minutes: {sample.n:,} rows have {n_instants:,} different times",
            "all rows of a minute would be one frame, and all their people close to each other at once",
            "export times with seconds; if there is one frame a minute: --period 60",
            is_sure=True,
        )
    elif share > 0.05:
        yield SourceWarning(
            f"{n_second:,} of {sample.n:,} rows would be left out as second sightings",
            "a person has one place at a time; the times may be too coarse, or ids belong to several people",
            "export times with parts of seconds; or keep one record of each period: --period 1",
        )


def _years(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if sample.n < ROWS_MIN:  # of few, bad ones go to quarantine
        return
    median = float(np.median(sample.ts_ms))
    if _FIRST_MS <= median < _LAST_MS:
        return
    year = 1970 + median / (365.2425 * _DAY_MS)
    fix = "export ISO times, or the time since 1970 in seconds, milliseconds, microseconds or nanoseconds"
    written = str(next(iter(case.columns.rows.values()), {}).get(case.columns.plan.names.get("ts", ""), ""))
    least = float(sample.ts_ms.min())
    if 0 <= least < _HOUR_MS and case.options.start is None and "ts" in case.columns.plan.names:
        fix = (
            "--start 2026-11-09T08:00 (when the recording began) if they are counted from its beginning; in "
            "other units than seconds with --time-format, such as --start 2026-11-09T08:00 --time-format ms"
        )
    elif 20_000_000 < median < 80_000_000:
        fix = "they look like days since 1899, as Excel counts them: export them as text"
    elif 720_000_000 < median < 760_000_000:
        fix = "they look like days of Matlab (datenum): (days - 719529) * 86400 are seconds since 1970"
    elif 2_440_000_000 < median < 2_480_000_000:
        fix = "they look like Julian days: (days - 2440587.5) * 86400 are seconds since 1970"
    elif len(written) in (12, 14) and written.isdecimal():
        fix = f'--time-format "{"%Y%m%d%H%M%S" if len(written) == 14 else "%y%m%d%H%M%S"}"'
    elif written.isdecimal() and len(written) == 18:
        fix = (
            "they look like ticks of .NET or Windows: (ticks - 621355968000000000) / 10,000,000 are seconds since 1970"
        )
    shown = f" ({written[:30]!r})" if written else ""
    what = f"times would be in the year {int(year)}{shown}"
    yield SourceWarning(what, "a wrong unit, or a count that begins at another date than 1970", fix, is_sure=True)


def _written_ms(sample: Sample) -> Ints:
    """Return the times on the clock of their zone where all have the same one, else UTC."""
    return sample.ts_ms if (sample.zone.no != 0).any() else utc_to_local(sample.ts_ms, sample.zone.names[0])


def _half_days(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if sample.n < ROWS_MIN or (sample.zone.no < 0).any():
        return
    local = _written_ms(sample)
    hours = local % _DAY_MS // _HOUR_MS
    steps_ms = _steps_ms(sample.camera.no, local)
    is_back = steps_ms < -_HOUR_MS
    back, then = steps_ms[is_back], hours[1:][is_back]
    if hours.min() < 1 or hours.max() > 12 or not len(back):
        return
    if ((back > -12 * _HOUR_MS) & (back < -6 * _HOUR_MS) & (then < 6)).all():
        n_back = "once" if len(back) == 1 else f"{len(back)} times"
        yield SourceWarning(
            f"the clock goes back by about twelve hours {n_back}, and no hour is 0 or above 12",
            "a clock of twelve hours without AM and PM: afternoons would be stored as the night before",
            "export times of 24 hours, or with AM and PM",
            is_sure=True,
        )


def _midnights(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if sample.n < ROWS_MIN or (sample.zone.no != 0).any():  # 0: one zone, of all
        return
    local = _written_ms(sample)
    is_back = _steps_ms(sample.camera.no, local) < -_HOUR_MS
    last, then = local[:-1][is_back], local[1:][is_back]
    is_midnight = (last % _DAY_MS > _DAY_MS - _HOUR_MS) & (then % _DAY_MS < _HOUR_MS) & (last - then < _DAY_MS)
    if len(last) and is_midnight.all():
        yield SourceWarning(
            f"after {_clock(int(last[0]))} comes {_clock(int(then[0]))}: the date does not change at midnight",
            "the hours after midnight would be stored as those of the day before",
            "export dates that change with the day; the column may hold the day of the export",
            is_sure=True,
        )


def _closed(case: Case) -> Iterator[SourceWarning]:
    site, sample = case.site, case.sample
    # who states another zone knows the hours
    is_stated = case.options.start is not None or case.options.zone not in (None, site.timezone)
    if not site.hours.weeks or is_stated or sample.n_instants < ROWS_MIN:
        return
    utc = sample.ts_ms
    local = utc_to_local(utc, site.timezone)
    share = 1 - open_share(local, site)
    outside = f"{share:.0%} of the records are outside opening hours: {_clock(int(local.min()))} to "
    outside += f"{_clock(int(local.max()))} in {site.timezone}"
    if share > CLOSED_SHARE:
        yield SourceWarning(
            outside,
            "the engine's clock may be that of another zone, or of twelve hours; hours outside opening enter no figure",
            "check the first time on the card against the clock on the wall, and opening in vsd.toml",
            is_note=True,
        )
    elif share >= OUTSIDE_SHARE:
        for n_offsets, mistake in _OFFSET_MISTAKES.items():
            right = local - n_offsets * (local - utc)
            if 1 - open_share(right, site) <= INSIDE_SHARE:
                yield SourceWarning(
                    f"{outside}; from {_clock(int(right.min()))} to {_clock(int(right.max()))} all would be inside",
                    mistake,
                    "check the first time on the card against the clock on the wall; export times in UTC",
                )
                return


TIME_CHECKS: Final = (
    SourceCheck(
        "W227", has_columns, _years, "times of another century, such as a count from another beginning than 1970"
    ),
    SourceCheck("W227", always, _half_days, "a clock of twelve hours without AM and PM: after 12:59 comes 1:00"),
    SourceCheck("W227", always, _midnights, "times of day that pass midnight beside a date that does not change"),
    SourceCheck(
        "W227",
        has_columns,
        _gps,
        "seconds since 1980, as satellites count them, read as seconds since 1970: ten years ago to the day",
    ),
    SourceCheck("W223", always, _zones, "times without an offset, in a zone that nobody stated"),
    SourceCheck("W223", always, _named_utc, "a column that names UTC, read on another clock"),
    SourceCheck(
        "W223", always, _mixed_offsets, "times of one camera of which some have an offset from UTC and others have none"
    ),
    SourceCheck(
        "W223",
        always,
        _hour_back,
        "a clock that goes back by an hour once, as at the end of summer time, read as one without it",
    ),
    SourceCheck(
        "W223",
        has_tracks,
        _clock_set,
        "a clock that was set while people were in view: they go on where they were, at another time",
    ),
    SourceCheck(
        "W223",
        always,
        _closed,
        "times outside opening hours: nearly all, or some that another offset from UTC would bring inside",
    ),
    SourceCheck("W224", always, _merging, "records that a fold leaves out, because times are too coarse"),
)
