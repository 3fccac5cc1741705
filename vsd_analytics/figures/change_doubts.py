"""What speaks against a logged change: doubts, with which it never "works", and cautions, printed beside it."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from datetime import timedelta

from vsd_analytics.answer import Reason
from vsd_analytics.figures.camera_watch import watch
from vsd_analytics.figures.change_weeks import Windows, changes_elsewhere, events_beside, other_changes
from vsd_analytics.figures.comparable import other_intervals
from vsd_analytics.figures.panels import WEEK, FloorHours
from vsd_analytics.figures.periods import cut_ids
from vsd_analytics.site.model import Area, LogEntry, Site
from vsd_analytics.stats.cut_share import changed_cut_share
from vsd_analytics.warehouse.provenance import engines


def doubts_and_cautions(
    data: FloorHours, entry: LogEntry, area: Area, windows: Windows, *, cameras: Collection[str]
) -> tuple[list[Reason], list[Reason]]:
    """Return what the log, the calendar and the cameras say against a change, as doubts and as cautions.

    What moves the area's own cameras is a doubt, what moves those of the areas compared with is a caution.

    Args:
        data: The floor.
        entry: The change.
        area: The area looked at.
        windows: The weeks.
        cameras: Ids of the cameras that count in it.
    """
    site = data.site
    moved = [(c.camera_id, c.reason) for c in watch(data, windows.trend, windows.watched) if c.is_moved and c.reason]
    doubts = [
        *other_changes(site, entry, area, windows),
        *events_beside(site, windows),
        *(why for camera_id, why in moved if camera_id in cameras),
        *_frame_rates(data, cameras, windows),
        *_engines(site, windows),
    ]
    there = [Reason("watch.there", why=why) for camera_id, why in moved if camera_id not in cameras]
    return doubts, [*changes_elsewhere(site, entry, area, windows), *there]


def cut_doubts(data: FloorHours, windows: Windows, *, cameras: Collection[str]) -> list[Reason]:
    """Return the doubt of a verdict that rests on counts: its cameras' tracker cuts another share of ids."""
    sides = [cut_ids(data, days, cameras) for days in (windows.trend, windows.watched)]
    cut_shares = changed_cut_share(sides[0], sides[1])
    return [] if cut_shares is None else [Reason("compare.cut_ids", before=cut_shares.before, now=cut_shares.now)]


def _frame_rates(data: FloorHours, cameras: Collection[str], windows: Windows) -> Iterator[Reason]:
    first_ms, end_ms = data.span_ms(windows.trend[0], windows.watched[1])
    own = [c for c in data.cameras if c.camera_id in cameras]
    for other in other_intervals(data.warehouse, cameras=own, first_ms=first_ms, end_ms=end_ms):
        yield Reason(
            "compare.frames",
            camera=other.camera_id,
            after_s=other.after_ms / 1000,
            before_s=other.before_ms / 1000,
            day=f"{data.local(other.since_ms):%Y-%m-%d}",
        )


def _engines(site: Site, windows: Windows) -> Iterator[Reason]:
    """Yield a doubt where the first and the last of the weeks do not have the same engines, by name and version."""
    (first, _), (_, last) = windows.trend, windows.watched
    week = WEEK - timedelta(days=1)
    before, now = engines(site, first, first + week), engines(site, last - week, last)
    if before and now and before != now:
        yield Reason("compare.engine", before=", ".join(before), after=", ".join(now))
