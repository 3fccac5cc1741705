"""A small answer that has a column of every kind, with a hostile name and a missing number."""

from __future__ import annotations

from datetime import UTC, date, datetime

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Sum, Value

HOSTILE = '=cmd|"/c calc"\x1b[31m\nnext'
COLUMNS = (
    Column("area_id", "key"),
    Column("local_hour", "key", "hour_of_day"),
    Column("name", "fact"),
    Column("long_visit_s", "fact", "s"),
    Column("means_agree", "fact"),
    Column("silent_cameras", "fact"),
    Column("started", "instant"),
    Column("n_visits", "count", "visits", "M35"),
    Column("n_cut", "count", "visits", "M35", tells=("n_visits",), audience="operator"),
    Column("people", "people", "people", "M41", digits=2, per="n_visits"),
    Column("dwell_median_s", "seconds", "s", "M36", tells=("n_visits",)),
    Column("long_share", "share", "share", "M36"),
    Column("visits_per_open_h", "rate", "per_open_h", "M35"),
    Column("route", "place"),
)
HOLDS = HoldsFor(
    "shop", "ground", date(2026, 11, 9), date(2026, 11, 15), datetime(2026, 11, 12, 8, tzinfo=UTC), "s", "i"
)
WHY = Reason("waits.few_served", least=10, has=1)


def one_of_each() -> Answer:
    """Return two rows: one with everything, one of which nothing is known."""
    known: Row = {
        "area_id": "door",
        "local_hour": 8,
        "name": HOSTILE,
        "long_visit_s": 300.0,
        "means_agree": True,
        "silent_cameras": ("cam-1", "cam-2"),
        "started": datetime(2026, 11, 9, 8, tzinfo=UTC),
        "n_visits": Value(1234),
        "n_cut": Value(34),
        "people": Value(1.1666667, 0.0004, 1.4),
        "dwell_median_s": Value(150.0, 45.0, None),
        "long_share": Value(0.0058, 0.0003, 0.12),
        "visits_per_open_h": Value(83.456789, 72.5, 96.0),
        "route": "Door > Till",
    }
    missing = Value.missing(WHY)
    unknown: Row = {
        **dict.fromkeys((c.name for c in COLUMNS if isinstance(known[c.name], Value)), missing),
        **{"area_id": "till", "local_hour": 9, "name": "Till", "long_visit_s": None, "means_agree": None},
        **{"silent_cameras": (), "started": None, "route": None},
    }
    sums, notes = (Sum("n_visits", ("hours.n_visits",)),), ((None, Reason("note.visits")), (1, Reason("waits.no_end")))
    return Answer("visits", COLUMNS, (known, unknown), HOLDS, sums, notes)
