"""What was recorded and how good it is: coverage (M1), outages (M2), tracks (M4), data quality (M29)."""

from __future__ import annotations

from typing import Final

from vsd_analytics.answer import Answer, Column, Reason, Row, Value
from vsd_analytics.figures.camera_watch import WATCH, watch_notes, watch_rows
from vsd_analytics.figures.catalogue.form import FigureInputs, answers
from vsd_analytics.figures.slots import NO_POSITIONS
from vsd_analytics.figures.values import known

RECORDING: Final = (
    Column("recorded_share", "share", "share", "M1", per="scheduled_h"),
    Column("scheduled_h", "fact", "h"),
    Column("n_tracks", "count", "tracks", "M4", per="n_track_records"),
    Column("n_track_records", "count", "records"),
    Column("n_records", "count", "records", "M29"),
    Column("without_id_share", "share", "share_of_records", "M29"),
    Column("track_life_median_s", "seconds", "s", "M29"),
    Column("cut_share", "share", "share", "M29"),
    Column("seen_twice_share", "share", "share_of_records", "M29"),
    Column("unlocated_share", "share", "share_of_records", "M29"),
    Column("lost_messages", "number", "messages", "M29"),
    Column("message_gaps", "number", "gaps", "M29"),
    Column("recalibrated_cameras", "number", "cameras", "M29"),
    Column("stretches_by_other_rules", "number", "stretches", "M29"),
    Column("is_inferred", "fact"),
    Column("frame_intervals_s", "fact", "s"),
)
"""Columns of `recording`."""
OUTAGES: Final = (
    Column("outage", "key"),
    Column("cameras", "fact"),
    Column("start", "instant"),
    Column("end", "instant"),
    Column("open_h", "rate", "h", "M2"),
    Column("is_inferred", "fact"),
)
"""Columns of `outages`."""
_RECORDS: Final = """
select sum(person_records)::double as n, sum(n_doubled)::double as n_doubled, sum(n_unlocated)::double as n_unlocated
from exposure inner join cameras using (camera_id)
where floor_id = $floor and quarter * 900000 >= $first and quarter * 900000 < $end
"""
_INTERVALS: Final = """
select distinct camera_days.interval_ms::bigint as ms from camera_days inner join cameras using (camera_id)
where floor_id = $floor and utc_day between $first and $last order by ms
"""

_ANY_RECORDED: Final = """
select 1 from camera_hours where floor_id = $floor and local_date between $first and $last and recorded_s > 0 limit 1
"""


@answers("M1", "M2", "M4", "M29")
def recording(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return what was recorded of the floor and how good it is, and its outages.

    Columns of `recording`: recorded share of open camera-hours (M1); track ids, one of a camera and site day each (M4);
    of the records (M29): their number, shares without an id, seen by two cameras and without a place, the median life
    of a track id, the share of ids that end inside the view and go on under another one, messages lost by the engine's
    numbers, cameras recalibrated since the week before, and purged hours computed by other rules. Of `outages`: which
    cameras were silent, from when to when (M2). Of `camera_watch`: which cameras lose or gain people beside their
    neighbours, since when (M29).
    """
    watched = inputs.results.camera_watch
    outages: list[Row] = [
        {
            "outage": number,
            "cameras": o.camera_ids,
            "start": o.start,
            "end": o.end,
            "open_h": Value(o.open_h),
            "is_inferred": o.is_inferred,
        }
        for number, o in enumerate(inputs.coverage.outages, 1)
    ]
    return (
        inputs.floor_answer("recording", RECORDING, {**_coverage(inputs), **_quality(inputs)}),
        inputs.list_answer("outages", OUTAGES, outages),
        inputs.list_answer("camera_watch", WATCH, watch_rows(watched), *watch_notes(watched)),
    )


def _coverage(inputs: FigureInputs) -> Row:
    coverage = inputs.coverage
    share = Value(coverage.share) if coverage.scheduled_h else Value.missing(Reason("site.closed"))
    return {"recorded_share": share, "scheduled_h": coverage.scheduled_h}


def _quality(inputs: FigureInputs) -> Row:
    data, coverage = inputs.data, inputs.coverage
    tracks = inputs.results.episodes.tracks
    first, end = data.this.span_ms
    floor = {"floor": data.floor.floor_id}
    [sums] = data.warehouse.rows(_RECORDS, {**floor, "first": first, "end": end})
    days = {"first": first // 86_400_000, "last": (end - 1) // 86_400_000}
    intervals = data.warehouse.rows(_INTERVALS, {**floor, **days})
    n_seen = (sums["n"] or 0) + (sums["n_doubled"] or 0)
    lost = coverage.missing_messages
    week = {"first": data.monday, "last": data.sunday}
    is_recorded = bool(data.warehouse.rows(_ANY_RECORDED, {**floor, **week}))
    unnumbered = Reason("engine.no_numbers" if is_recorded else "recorded.nothing")

    def share(part: float | None) -> Value:
        return Value((part or 0) / n_seen) if n_seen else Value.missing(tracks.reason or Reason("nobody.seen"))

    of_people = inputs.why_few_people
    return {
        "n_tracks": of_people or known(tracks.n, tracks.reason, tracks.state),
        "n_track_records": of_people or Value(tracks.n_records),
        "n_records": of_people or Value(n_seen),
        "without_id_share": known(tracks.without_id_share, tracks.reason),
        "track_life_median_s": of_people or known(tracks.median_life_s, tracks.reason),
        "cut_share": known(tracks.cut_share, tracks.reason or NO_POSITIONS),
        "seen_twice_share": share(sums["n_doubled"]),
        "unlocated_share": share(sums["n_unlocated"]),
        "lost_messages": known(lost, unnumbered),
        "message_gaps": Value.missing(unnumbered) if lost is None else Value(coverage.message_gaps),
        "recalibrated_cameras": Value(len(data.pair.recalibrated)),
        "stretches_by_other_rules": Value(len(data.warehouse.other_rules())),
        "is_inferred": coverage.is_inferred,
        "frame_intervals_s": tuple(f"{row['ms'] / 1000:g}" for row in intervals),
    }
