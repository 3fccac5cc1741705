"""People together as answers: the share of violations between groups, both readings of rates, and what ids allow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from vsd_analytics.answer import Column, Reason, Row, Value
from vsd_analytics.figures.groups import GroupReadings, Groups
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.values import known, measured

_COUNTS: Final = ("n_all", "n_between", "n_within")
BETWEEN_GROUPS: Final = (
    Column("between_share", "share", "share", "M9", tells=_COUNTS, per="n_violations"),
    Column("n_violations", "count", "violations", tells=_COUNTS),
    *(Column(name, "count", "violations", audience="operator") for name in _COUNTS),
)
"""Columns of `between_groups`, after its key."""
READINGS: Final = (
    Column("reading", "key"),
    Column("violation_rate", "rate", "per_open_hour", "M9", tells=_COUNTS, per="n_violations"),
    Column("encounter_rate", "rate", "per_person_hour", "M9", tells=_COUNTS, per="n_violations"),
    Column("close_time_share", "share", "share", "M6"),
    Column("n_violations", "count", "violations", tells=_COUNTS),
    *(Column(name, "count", "violations", audience="operator") for name in _COUNTS),
)
"""Columns of `readings`, after its key."""
TOGETHER: Final = (
    Column("floor_id", "key"),
    Column("n_groups", "count", "groups"),
    Column("people_share", "share", "share"),
    Column("within_time_share", "share", "share"),
    Column("between_share", "share", "share", "M9", per="n_violations"),
    Column("n_violations", "count", "violations"),
    Column("n_unknown", "count", "violations"),
)
"""Columns of `together`."""
SIZES: Final = (Column("n_people", "key", "people"), Column("n_groups", "count", "groups"))
"""Columns of `groups_by_size`."""
LIVES: Final = (
    Column("camera_id", "key"),
    Column("n_tracks", "count", "tracks"),
    Column("life_median_s", "seconds", "s"),
    Column("long_lived_share", "share", "share"),
    Column("cut_share", "share", "share"),
    Column("takes_part", "fact"),
)
"""Columns of `track_lives`."""


def between_groups(
    found: Groups, floor: GroupReadings | None, *, is_whole_site: bool, why: Value | None
) -> tuple[Row, Reason]:
    """Return the share of a floor's violations that are between groups (M9) as cells, and how groups are found.

    Args:
        found: The groups of the site.
        floor: The readings of the floor.
        is_whole_site: The site has no other floor, so that the interval of the site is that of the floor.
        why: Why nothing is given; None where it is.
    """
    accuracy = found.accuracy
    lo, hi = accuracy.time_recall
    note = Reason("note.groups", scenes=accuracy.scenes, lo=lo, hi=hi, weakness=accuracy.weakness)
    if why is not None or floor is None:
        none = why or Value.missing(NOTHING_OPEN)
        return {"between_share": none, "n_violations": none, **dict.fromkeys(_COUNTS, none)}, note
    n, n_between = _counts(floor)
    share = Value.missing(Reason("violations.none"))
    if n and is_whole_site:
        whole = found.between
        share = Value(whole.value, whole.lo, whole.hi, reason=whole.reason)
    elif n:
        share = Value(n_between / n, reason=Reason("violations.one_floor"))
    return {"between_share": share, "n_violations": Value(n), **_count_cells(floor)}, note


def reading_rows(floor: GroupReadings | None, close: Mapping[str, Value], *, why: Value | None) -> list[Row]:
    """Return a row for each reading of a floor: all violations, and those between groups.

    Args:
        floor: Its readings.
        close: Share of person-time too close by reading.
        why: Why rates are not given; None where they are.
    """
    rows: list[Row] = []
    for reading in ("all", "between_groups"):
        cells: dict[str, Value] = dict.fromkeys(
            ("violation_rate", "encounter_rate", "n_violations", *_COUNTS), why or Value.missing(NOTHING_OPEN)
        )
        if floor is not None and why is None:
            is_all = reading == "all"
            often = floor.violation_rate if is_all else floor.violation_rate_between
            risky = floor.encounter_rate if is_all else floor.encounter_rate_between
            n = known(often.n_events, often.reason, often.state)
            cells = {"violation_rate": measured(often), "encounter_rate": measured(risky), "n_violations": n}
            cells |= _count_cells(floor)
        rows.append({"reading": reading, "close_time_share": close[reading], **cells})
    return rows


def _counts(floor: GroupReadings) -> tuple[int, int]:
    return int(floor.violation_rate.n_events or 0), int(floor.violation_rate_between.n_events or 0)


def _count_cells(floor: GroupReadings) -> dict[str, Value]:
    n, n_between = _counts(floor)
    return {"n_all": Value(n), "n_between": Value(n_between), "n_within": Value(n - n_between)}
