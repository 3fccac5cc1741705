"""People together as answers: the share of violations between groups, both readings of rates, and what ids allow."""

from __future__ import annotations

from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.figures.groups import CameraLives, GroupReadings, Groups
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.values import known, lack, measured
from vsd_analytics.site.model import Site

MANY: Final = 0.5
"""Share of tracks that live long below which a camera is named: taken as short visits."""
_COUNTS: Final = ("n_known", "n_between", "n_within", "n_unknown")
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


def group_answers(site_groups: Groups, site: Site, *, inputs: str) -> tuple[Answer, ...]:
    """Return who is together, with every count exact: for the operator.

    `together`: of the whole site, groups, shares of person-time in groups and of the time in violation within them, and
    the share of violations between groups (M9); violations of which it is not known. `groups_by_size`: groups by number
    of tracks. `readings`: rates of each floor, of all violations and of those between groups. `track_lives`: what the
    track ids of each camera allow.

    Args:
        site_groups: The groups.
        site: The site.
        inputs: Hash of the facts.
    """
    holds = HoldsFor(
        site.site_id, None, site_groups.first, site_groups.last, settings=site.settings.settings_id(), inputs=inputs
    )
    rows = tuple(
        {"floor_id": floor.floor_id, **row} for floor in site_groups.readings for row in reading_rows(floor, why=None)
    )
    nothing = None if rows else lack(site_groups.state, site_groups.reason)
    return (
        Answer("together", TOGETHER, (_together(site_groups),), holds, notes=_notes(site_groups)),
        Answer(
            "groups_by_size",
            SIZES,
            tuple({"n_people": size, "n_groups": Value(n)} for size, n in site_groups.n_by_size.items()),
            holds,
        ),
        Answer(
            "readings",
            (Column("floor_id", "key"), *READINGS),
            rows,
            holds,
            nothing=None if nothing is None else nothing.reason,
            state="ok" if nothing is None else nothing.state,
        ),
        Answer("track_lives", LIVES, tuple(_lives(c) for c in site_groups.cameras), holds),
    )


def _together(site_groups: Groups) -> Row:
    why = None if site_groups.state == "ok" else lack(site_groups.state, site_groups.reason)
    nobody = Reason("nobody.in_violation")
    return {
        "floor_id": None,
        "n_groups": why or Value(sum(site_groups.n_by_size.values())),
        "people_share": why or known(site_groups.people_share, site_groups.reason),
        "within_time_share": why or known(site_groups.time_share, nobody),
        "between_share": why or measured(site_groups.between),
        "n_violations": why or Value(site_groups.between.of),
        "n_unknown": why or Value(site_groups.n_unknown),
    }


def _notes(site_groups: Groups) -> tuple[tuple[int | None, Reason], ...]:
    accuracy = site_groups.accuracy
    lo, hi = accuracy.time_recall
    notes = [Reason("note.groups", scenes=accuracy.scenes, lo=lo, hi=hi, weakness=accuracy.weakness)]
    (f1_lo, f1_hi), (precision_lo, precision_hi) = accuracy.f1, accuracy.time_precision
    parts = {"f1_lo": f1_lo, "f1_hi": f1_hi, "precision_lo": precision_lo, "precision_hi": precision_hi}
    notes.append(Reason("groups.accuracy", **parts))
    short = [c.camera_id for c in site_groups.cameras if c.lives.state == "ok" and (c.lives.long_share or 0) < MANY]
    if short:
        notes.append(Reason("groups.short_lives", cameras=", ".join(short)))
    return tuple((None, note) for note in notes)


def _lives(camera: CameraLives) -> Row:
    lives = camera.lives
    why = lives.reason
    return {
        "camera_id": camera.camera_id,
        "n_tracks": Value(lives.n_tracks),
        "life_median_s": known(lives.median_life_s, why, lives.state),
        "long_lived_share": known(lives.long_share, why, lives.state),
        "cut_share": known(lives.cut_share, why, lives.state),
        "takes_part": lives.state == "ok",
    }


def between_groups(site_groups: Groups, floor: GroupReadings | None, *, why: Value | None) -> tuple[Row, Reason]:
    """Return the share of a floor's violations that are between groups (M9) as cells, and how groups are found.

    Args:
        site_groups: The groups of the site.
        floor: The readings of the floor.
        why: Why nothing is given; None where it is.
    """
    accuracy = site_groups.accuracy
    lo, hi = accuracy.time_recall
    note = Reason("note.groups", scenes=accuracy.scenes, lo=lo, hi=hi, weakness=accuracy.weakness)
    if why is not None or floor is None:
        none = why or Value.missing(NOTHING_OPEN)
        return {"between_share": none, "n_violations": none, **dict.fromkeys(_COUNTS, none)}, note
    share = measured(floor.between) if floor.between.of else Value.missing(Reason("violations.none"))
    return {"between_share": share, "n_violations": Value(floor.between.of), **_count_cells(floor)}, note


def reading_rows(floor: GroupReadings | None, *, why: Value | None) -> list[Row]:
    """Return a row for each reading of a floor: all violations, and those between groups.

    Args:
        floor: Its readings.
        why: Why rates are not given; None where they are.
    """
    rows: list[Row] = []
    for reading in ("all", "between_groups"):
        cells: dict[str, Value] = dict.fromkeys(
            ("violation_rate", "encounter_rate", "n_violations", *_COUNTS), why or Value.missing(NOTHING_OPEN)
        )
        if floor is not None and why is None:
            is_all = reading == "all"
            per_open_h = floor.violation_rate if is_all else floor.violation_rate_between
            per_person_h = floor.encounter_rate if is_all else floor.encounter_rate_between
            n = known(per_open_h.n_events, per_open_h.reason, per_open_h.state)
            cells = {
                "violation_rate": measured(per_open_h),
                "encounter_rate": measured(per_person_h),
                "n_violations": n,
            }
            cells |= _count_cells(floor)
        rows.append({"reading": reading, **cells})
    return rows


def _count_cells(floor: GroupReadings) -> dict[str, Value]:
    """Return the counts behind the share: violations whose groups are known, between groups, within, and unknown."""
    share = floor.between
    counts = (share.of, share.n, share.of - share.n, floor.n_unknown)
    return {name: Value(n) for name, n in zip(_COUNTS, counts, strict=True)}
