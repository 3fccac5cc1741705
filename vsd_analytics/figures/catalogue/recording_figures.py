"""What was recorded and how good it is: coverage (M1), outages (M2), tracks (M4), data quality (M29)."""

from __future__ import annotations

from vsd_analytics.answer import Reason
from vsd_analytics.figures.catalogue.form import FigureInputs, Row, figure, row
from vsd_analytics.figures.week.results import Figure


@figure("M1")
def coverage(inputs: FigureInputs) -> Figure:
    """Return the recorded share of open camera-hours."""
    found = inputs.coverage
    if not found.scheduled_h:
        return inputs.missing("not_enough_data", Reason("site.closed"))
    return Figure(unit=inputs.unit, value=found.share, denominator=found.scheduled_h)


@figure("M2")
def outages(inputs: FigureInputs) -> Figure:
    """Return the outages of the week."""
    rows = tuple(
        {"cameras": ", ".join(o.camera_ids), **row(o, "start", "end", "open_h", "is_inferred")}
        for o in inputs.coverage.outages
    )
    return Figure(unit=inputs.unit, rows=rows)


@figure("M4")
def tracks(inputs: FigureInputs) -> Figure:
    """Return the number of track ids."""
    found = inputs.found.episodes.tracks
    if found.n is None:
        return inputs.missing(found.state, found.reason)
    if inputs.small(found.n):
        return inputs.missing("not_enough_data", Reason("hidden.tracks", least=inputs.below))
    return Figure(unit=inputs.unit, value=found.n, denominator=found.n_records)


@figure("M29")
def quality(inputs: FigureInputs) -> Figure:
    """Return one row for each thing that is known of the records, missing ones with their reason."""
    data, coverage = inputs.data, inputs.coverage
    tracks = inputs.found.episodes.tracks
    first, end = data.this.span_ms
    sums = data.warehouse.rows(
        "select sum(person_records)::double as n, sum(n_doubled)::double as n_doubled, "
        "sum(n_unlocated)::double as n_unlocated from exposure inner join cameras using (camera_id) "
        "where floor_id = $floor and quarter * 900000 >= $first and quarter * 900000 < $end",
        {"floor": data.floor.floor_id, "first": first, "end": end},
    )[0]
    n_seen = (sums["n"] or 0) + (sums["n_doubled"] or 0)

    def share(part: float | None) -> float | None:
        return (part or 0) / n_seen if n_seen else None

    nobody = Reason("nobody.seen")
    n_shown = None if inputs.small(n_seen) else n_seen
    rows: list[Row] = [
        _row("records", n_shown, "records", Reason("hidden.records", least=inputs.below)),
        _row("without_id", tracks.without_id_share, "share_of_records", tracks.reason),
        _row("median_life", tracks.median_life_s, "s", tracks.reason),
        _row("seen_twice", share(sums["n_doubled"]), "share_of_records", nobody),
        _row("unlocated", share(sums["n_unlocated"]), "share_of_records", nobody),
        _row("lost_messages", coverage.missing_messages, "messages", Reason("engine.no_numbers")),
        _row("message_gaps", coverage.message_gaps, "gaps", None),
        _row("inferred", coverage.is_inferred, "yes_or_no", None),
        _row("recalibrated", len(data.pair.recalibrated), "cameras", None),
        _row("other_rules", len(data.warehouse.other_rules()), "stretches", None),
        _row(
            "intervals",
            ", ".join(f"{ms / 1000:g}" for ms in _intervals(inputs)) or None,
            "s",
            Reason("recorded.nothing"),
        ),
    ]
    return Figure(unit=inputs.unit, rows=tuple(rows))


def _row(what: str, value: float | str | bool | None, unit: str, reason: Reason | None) -> Row:
    why = reason if value is None else None
    return {"what": Reason(f"row.{what}"), "value": value, "unit": Reason(f"unit.{unit}"), "reason": why}


def _intervals(inputs: FigureInputs) -> list[int]:
    data = inputs.data
    first, end = data.this.span_ms
    rows = data.warehouse.rows(
        "select distinct camera_days.interval_ms::bigint as ms from camera_days inner join cameras using (camera_id) "
        "where floor_id = $floor and utc_day between $first and $last order by ms",
        {"floor": data.floor.floor_id, "first": first // 86_400_000, "last": (end - 1) // 86_400_000},
    )
    return [int(r["ms"]) for r in rows]
