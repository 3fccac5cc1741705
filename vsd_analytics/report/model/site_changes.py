"""What changed at the site around a week: its log, outages nobody logged, a new calibration, engine or frame rate."""

from __future__ import annotations

from dataclasses import replace
from datetime import date, timedelta
from typing import Final

from vsd_analytics.config.change_log import read_log
from vsd_analytics.figures import comparable
from vsd_analytics.figures.week import estimates
from vsd_analytics.figures.week.changes import moved_since, recorded_cameras, share_of_change, verdict_without
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_recording import Coverage, Outage
from vsd_analytics.figures.week.results import LogLine, SettingsChange
from vsd_analytics.site.model import LogEntry
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say

DETECTED_MIN_H: Final = 2.0
"""A shorter outage is no line of the log."""
NEAR: Final = timedelta(hours=1)
"""An outage that begins this near to an entry for the whole site is taken as logged."""


def log_lines(data: WeekData, coverage: Coverage, *, is_compared: bool) -> tuple[LogLine, ...]:
    """Return the site's log of both weeks, and what nobody logged: long outages and other frame rates, by time.

    For an entry in an area of this floor and week: how much of the area's change over the week came after it.
    """
    zone, start = data.site.zone, data.midnight(data.monday)
    entries = [
        e
        for e in read_log(data.site)
        if data.midnight(data.monday - data.span) <= e.at < data.midnight(data.monday + data.span)
    ]
    names = {a.area_id: a.name for a in data.areas}
    elsewhere = {a.area_id for a in data.site.areas} - names.keys()
    lines = []
    for entry in entries:
        if entry.area_id in elsewhere:
            continue
        moved = share = rest = None
        is_compared_here = entry.at >= start and entry.area_id in names and is_compared
        if is_compared_here and not data.is_held_back(str(entry.area_id), data.monday - data.span, data.sunday):
            area = data.area(entry.area_id)
            moved = moved_since(data, area, round(entry.at.timestamp() * 1000))
            if moved is not None and not data.is_revealed_by_comparing:
                share, rest = share_of_change(data, area), verdict_without(data, area)
        lines.append(
            LogLine(
                at=entry.at.astimezone(zone),
                text=entry.text,
                area_id=entry.area_id,
                area_name=names.get(entry.area_id or ""),
                moved_after=moved,
                floor_share=share,
                rest_verdict=rest,
            )
        )
    lines += [_detected(data, o) for o in coverage.outages if _is_news(o, entries)]
    lines += _other_frame_rates(data)
    if (cut := data.pair.cut_shares) is not None and data.is_week:
        text = say("changed.log_cut_ids", before=fmt.percent(cut.before), now=fmt.percent(cut.now))
        lines.append(LogLine(at=data.midnight(data.monday), text=text, kind="detected"))
    return tuple(sorted(lines, key=lambda line: line.at))


def settings_change(data: WeekData, sent: tuple[str, ...], before: tuple[str, ...]) -> SettingsChange | None:
    """Return the change inside the two weeks that forbids any comparison: calibrations, cameras, the engine, rules.

    A calibration does when it leaves no camera that can be compared, other cameras when none recorded both weeks. Hours
    that were purged after they had been computed by other rules (SQL, settings) stay as they are, so they cannot be
    compared with others.

    Args:
        data: The week.
        sent: Engines of this week.
        before: Engines of the week before.
    """
    start, (first_ms, end_ms) = data.midnight(data.monday), data.pair.span_ms
    if data.pair.recalibrated and not (data.pair.is_comparable & data.whole.cameras).any():
        latest = max(data.pair.recalibrated, key=lambda r: r.at_ms)
        change = SettingsChange(name="calibration", before=latest.before, after=latest.after)
        at = data.local(latest.at_ms)
        return _with_parts(data, replace(change, at=at)) if at >= start else change
    was, is_now = (recorded_cameras(data, first) for first in (data.monday - data.span, data.monday))
    if was and is_now and not was & is_now:
        names = [terms.joined(c.name for c in data.cameras if c.camera_id in ids) for ids in (was, is_now)]
        return SettingsChange(name="cameras", before=names[0], after=names[1])
    if sent and before and sent != before:
        return SettingsChange(name="engine", before=", ".join(before), after=", ".join(sent))
    if comparable.has_other_rules(data.warehouse, first_ms=first_ms, end_ms=end_ms):
        return SettingsChange(name="rules", before=say("changed.rules_before"), after=say("changed.rules_after"))
    return None


def _other_frame_rates(data: WeekData) -> list[LogLine]:
    """Return a line for the cameras whose frames come at another rate since some day; they are compared all the same.

    Cameras that changed alike on one day share a line.
    """
    first_ms, end_ms = data.pair.span_ms
    names = {c.camera_id: terms.camera_name(c.name) for c in data.cameras}
    alike: dict[tuple[date, str, str], list[str]] = {}
    for o in comparable.other_intervals(data.warehouse, cameras=data.cameras, first_ms=first_ms, end_ms=end_ms):
        before, after = (fmt.seconds(ms / 1000) for ms in (o.before_ms, o.after_ms))
        alike.setdefault((data.local(o.since_ms).date(), before, after), []).append(names[o.camera_id])
    return [
        LogLine(
            at=data.midnight(day),
            text=say("changed.log_frames", camera=terms.joined(cameras), after=after, before=before),
            kind="detected",
        )
        for (day, before, after), cameras in alike.items()
    ]


def _with_parts(data: WeekData, change: SettingsChange) -> SettingsChange:
    """Return the change with how often before and after it in this week, unless a count is too small to print."""
    ms = None if change.at is None else round(change.at.timestamp() * 1000)
    before = estimates.measure(data, data.whole, is_compared=False, until=ms)
    after = estimates.measure(data, data.whole, is_compared=False, since=ms)
    if (
        data.hidden.why_floor
        or data.hidden.hides_hours
        or any(data.mask.hides(m.n) or m.violation_rate.value is None for m in (before, after))
    ):
        return change
    return replace(change, violation_rate_before=before.violation_rate, violation_rate_after=after.violation_rate)


def _is_news(outage: Outage, entries: list[LogEntry]) -> bool:
    """Tell whether an outage is long, certain, and not in the log already."""
    if outage.open_h < DETECTED_MIN_H or outage.is_inferred:
        return False
    return not any(e.area_id is None and outage.start - NEAR <= e.at <= outage.start + NEAR for e in entries)


def _detected(data: WeekData, outage: Outage) -> LogLine:
    names = {c.camera_id: c.name for c in data.cameras}
    is_all = len(outage.camera_ids) == len(names) > 1
    who = say("changed.all_cameras") if is_all else terms.joined(terms.camera_name(names[c]) for c in outage.camera_ids)
    text = say("changed.log_no_data", who=who, end=fmt.instant_short(outage.end))
    return LogLine(at=outage.start, text=text, kind="detected")
