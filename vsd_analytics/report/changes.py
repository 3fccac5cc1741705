"""What changed at the site around a week: its log, outages nobody logged, a new calibration, engine or frame rate."""

from __future__ import annotations

from dataclasses import replace
from datetime import date, timedelta

from vsd_analytics.analysis import comparable
from vsd_analytics.analysis.panels import WEEK, Place
from vsd_analytics.changelog import read_log
from vsd_analytics.report import estimates, words
from vsd_analytics.report import format as fmt
from vsd_analytics.report.model import Coverage, Estimate, LogLine, Outage, SettingsChange
from vsd_analytics.report.privacy import is_small
from vsd_analytics.report.weekdata import WeekData
from vsd_analytics.report.wording import say
from vsd_analytics.site import LogEntry

DETECTED_MIN_H = 2.0
NEAR = timedelta(hours=1)
"""An outage that begins this near to an entry for the whole site is taken as logged."""


def log_lines(data: WeekData, coverage: Coverage, *, is_compared: bool) -> tuple[LogLine, ...]:
    """Return the site's log of both weeks, and what nobody logged: long outages and other frame rates, by time.

    For an entry in an area of this floor and week, the area since then is compared with the same hours of the week
    before.
    """
    zone, start = data.site.zone, data.midnight(data.monday)
    entries = [e for e in read_log(data.site) if data.midnight(data.monday - WEEK) <= e.at < start + WEEK]
    names = {a.area_id: a.name for a in data.areas}
    elsewhere = {a.area_id for a in data.site.areas} - names.keys()
    lines = []
    for entry in entries:
        if entry.area_id in elsewhere:
            continue
        since = moved = None
        if entry.at >= start and entry.area_id in names and is_compared:
            since, moved = _since(data, data.area(entry.area_id), round(entry.at.timestamp() * 1000))
        lines.append(
            LogLine(
                at=entry.at.astimezone(zone),
                text=entry.text,
                area_id=entry.area_id,
                area_name=names.get(entry.area_id or ""),
                since=since,
                moved_after=moved,
            )
        )
    lines += [_detected(data, o) for o in coverage.outages if _is_news(o, entries)]
    lines += _other_frame_rates(data)
    return tuple(sorted(lines, key=lambda line: line.at))


def settings_change(data: WeekData, engines: tuple[str, ...], before: tuple[str, ...]) -> SettingsChange | None:
    """Return the change inside the two weeks that forbids any comparison: calibrations, cameras, the engine, rules.

    A calibration does when it leaves no camera that can be compared, other cameras when none recorded both weeks. Hours
    that were purged after they had been computed by other rules (SQL, settings) stay as they are, so they cannot be
    compared with others.

    Args:
        data: The week.
        engines: Engines of this week.
        before: Engines of the week before.
    """
    start, (first_ms, end_ms) = data.midnight(data.monday), data.both_weeks_ms
    if data.recalibrated and not (data.is_comparable & data.whole.cameras).any():
        latest = max(data.recalibrated, key=lambda r: r.at_ms)
        change = SettingsChange(name="calibration", before=latest.before, after=latest.after)
        at = data.local(latest.at_ms)
        return _with_parts(data, replace(change, at=at)) if at >= start else change
    was, is_now = (_recorded(data, first) for first in (data.monday - WEEK, data.monday))
    if was and is_now and not was & is_now:
        names = [words.joined(c.name for c in data.cameras if c.camera_id in ids) for ids in (was, is_now)]
        return SettingsChange(name="cameras", before=names[0], after=names[1])
    if engines and before and engines != before:
        return SettingsChange(name="engine", before=", ".join(before), after=", ".join(engines))
    if comparable.has_other_rules(data.warehouse, first_ms=first_ms, end_ms=end_ms):
        return SettingsChange(name="rules", before=say("changed.rules_before"), after=say("changed.rules_after"))
    return None


def not_compared(data: WeekData) -> dict[str, str]:
    """Return why cameras are left out of the comparison though the rest of the floor is compared, by camera."""
    if not (data.is_comparable & data.whole.cameras).any():
        return {}
    since = {r.camera_id: fmt.instant_short(data.local(r.at_ms)) for r in data.recalibrated}
    was, is_now = (_recorded(data, first) for first in (data.monday - WEEK, data.monday))
    new = {c: say("changed.new_camera") for c in data.ids if was and c in is_now - was}
    return new | {camera_id: say("changed.calibrated", at=at) for camera_id, at in since.items()}


def _recorded(data: WeekData, monday: date) -> set[str]:
    """Return the cameras that recorded any opening time of a week."""
    hours = data.hours.recorded_s[:, data.week(monday)]
    return {c for i, c in enumerate(data.ids) if hours[i].any()}


def _other_frame_rates(data: WeekData) -> list[LogLine]:
    """Return a line for the cameras whose frames come at another rate since some day; they are compared all the same.

    Cameras that changed alike on one day share a line.
    """
    first_ms, end_ms = data.both_weeks_ms
    names = {c.camera_id: words.camera_name(c.name) for c in data.cameras}
    alike: dict[tuple[date, str, str], list[str]] = {}
    for o in comparable.other_intervals(data.warehouse, cameras=data.cameras, first_ms=first_ms, end_ms=end_ms):
        before, after = (fmt.seconds(ms / 1000) for ms in (o.before_ms, o.after_ms))
        alike.setdefault((data.local(o.since_ms).date(), before, after), []).append(names[o.camera_id])
    return [
        LogLine(
            at=data.midnight(day),
            text=say("changed.log_frames", camera=words.joined(cameras), after=after, before=before),
            kind="detected",
        )
        for (day, before, after), cameras in alike.items()
    ]


def _with_parts(data: WeekData, change: SettingsChange) -> SettingsChange:
    """Return the change with how often before and after it in this week, unless a count is too small to print."""
    ms = None if change.at is None else round(change.at.timestamp() * 1000)
    before = estimates.measure(data, data.whole, is_compared=False, until=ms)
    after = estimates.measure(data, data.whole, is_compared=False, since=ms)
    below = data.site.settings.mask_below
    if any(is_small(m.n, below=below) or m.often.value is None for m in (before, after)):
        return change
    return replace(change, often_before=before.often, often_after=after.often)


def _since(data: WeekData, place: Place, ms: int) -> tuple[Estimate | None, float | None]:
    """Return a place since an instant against the same hours of the week before, and the share of its change.

    Nothing is told where a count of before or after the instant, in either week, is too small to print.
    """
    if data.why_no_violations is not None or data.why_no_places is not None:
        return None, None
    whole, after = (estimates.measure(data, place, is_compared=True, since=at) for at in (None, ms))
    counts = (whole.n, after.n, whole.n - after.n, whole.n_before, after.n_before, whole.n_before - after.n_before)
    if any(is_small(n, below=data.site.settings.mask_below) for n in counts):
        return None, None
    change, late = (_difference(data, place, since=at) for at in (None, ms))
    return after.often, None if change == 0 else min(1.0, max(0.0, late / change))


def _difference(data: WeekData, place: Place, *, since: int | None) -> float:
    before, now = data.compared(place, since=since)
    return float(now.n.sum() - before.n.sum())


def _is_news(outage: Outage, entries: list[LogEntry]) -> bool:
    """Tell whether an outage is long, certain, and not in the log already."""
    if outage.open_h < DETECTED_MIN_H or outage.is_inferred:
        return False
    return not any(e.area_id is None and outage.start - NEAR <= e.at <= outage.start + NEAR for e in entries)


def _detected(data: WeekData, outage: Outage) -> LogLine:
    names = {c.camera_id: c.name for c in data.cameras}
    is_all = len(outage.camera_ids) == len(names) > 1
    who = say("changed.all_cameras") if is_all else words.joined(words.camera_name(names[c]) for c in outage.camera_ids)
    text = say("changed.log_no_data", who=who, end=fmt.instant_short(outage.end))
    return LogLine(at=outage.start, text=text, kind="detected")
