"""Two periods side by side as answers: the periods, each place in both, and what moved the time too close."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Kind, Reason, Row, Value
from vsd_analytics.figures.compare import Comparison, PeriodSeen, PlaceChange, span
from vsd_analytics.figures.values import known, lack, measured, relative
from vsd_analytics.site.model import Site
from vsd_analytics.stats.decomposition import Mixing, MixingChange
from vsd_analytics.stats.estimates import ChangeEstimate, RateEstimate

_RATES: Final[tuple[tuple[str, Kind, str, str, str], ...]] = (
    ("violations_per_open_h", "rate", "per_open_hour", "M0", "recorded_h"),
    ("close_time_share", "share", "share", "M6", "person_h"),
    ("close_min_per_open_h", "rate", "minutes", "", ""),
    ("people", "people", "people", "M5", "compared_h"),
    ("violations_per_person_h", "rate", "per_person_hour", "M7", "person_h"),
)
"""Name, kind, unit and figure of what is compared, and the hours it is divided by."""
_BEFORE_AFTER: Final = ("before", "after")
PERIODS: Final = (
    Column("period", "key", "period"),
    Column("first_date", "fact"),
    Column("last_date", "fact"),
    Column("recorded_share", "share", "share", "M1", per="scheduled_h"),
    Column("recorded_h", "fact", "h"),
    Column("scheduled_h", "fact", "h"),
    Column("close_pair_h", "rate", "h"),
    Column("copresent_h", "rate", "h", "M23"),
    Column("layout_chance", "rate", "chance", "M23"),
    Column("behaviour_ratio", "rate", "ratio", "M23", per="copresent_h"),
)
"""Columns of `compared_periods`."""
PLACES: Final = (
    Column("kind", "key"),
    Column("area_id", "key"),
    Column("name", "fact"),
    *(
        column
        for name, kind, unit, figure, per in _RATES
        for column in (
            *(Column(f"{name}_{when}", kind, unit, figure, per=per and f"{per}_{when}") for when in _BEFORE_AFTER),
            Column(f"{name}_change", "rate", "change", figure),
            Column(f"{name}_verdict", "fact", "verdict"),
        )
    ),
    Column("people_change_share", "share", "share"),
    *(Column(f"n_{of}_{when}", "count", "violations") for of in ("violations", "compared") for when in _BEFORE_AFTER),
    *(
        Column(f"{hours}_{when}", "fact", "h")
        for hours in ("recorded_h", "person_h", "compared_h")
        for when in _BEFORE_AFTER
    ),
)
"""Columns of `compared_places`: levels over all hours of a period that enter rates, changes over hours of both."""
CAUSES: Final = (
    Column("cause", "key", "cause"),
    Column("cause_change", "rate", "change", "M23"),
    Column("cause_verdict", "fact", "verdict"),
    Column("cause_part", "rate", "change", "M23"),
    Column("cause_share", "share", "share", "M23"),
)
"""Columns of `change_causes`."""


def compare_answers(comparison: Comparison, site: Site, *, rest: str, inputs: str) -> tuple[Answer, ...]:
    """Return two periods of a floor as tables, with every count exact: for the operator.

    `compared_periods`: days and recorded hours of each; pair-hours too close and in view together, and what layout and
    behaviour make of them (M23). `compared_places`: for the floor, its areas and the rest, each rate in both periods,
    its relative change with a verdict, and the share of the change of violations per open hour that people explain.
    `change_causes`: by how much crowding, layout and behaviour moved the time that pairs spend too close; their parts
    add up to its change.

    Args:
        comparison: The comparison.
        site: The site.
        rest: Name of the rest of the floor.
        inputs: Hash of the facts.
    """
    first, last = min(comparison.a.first, comparison.b.first), max(comparison.a.last, comparison.b.last)
    settings = site.settings.settings_id()
    holds = HoldsFor(site.site_id, comparison.floor_id, first, last, settings=settings, inputs=inputs)
    why = None if comparison.state == "ok" else lack(comparison.state, comparison.reason)
    moved = comparison.mixing
    sides = (
        (comparison.a, "before", None if moved is None else moved.a),
        (comparison.b, "after", None if moved is None else moved.b),
    )
    periods = tuple(_period(seen, name, mixing, why=why) for seen, name, mixing in sides)
    notes = tuple((None, note) for note in _notes(comparison))
    return (
        Answer("compared_periods", PERIODS, periods, holds, notes=notes),
        _answer("compared_places", PLACES, [_place(p, rest) for p in comparison.places], holds, why=why),
        _causes(moved, holds, why=why),
    )


def _answer(name: str, columns: Sequence[Column], rows: Sequence[Row], holds: HoldsFor, *, why: Value | None) -> Answer:
    if why is None:
        return Answer(name, tuple(columns), tuple(rows), holds)
    return Answer(name, tuple(columns), (), holds, nothing=why.reason, state=why.state)


def _period(seen: PeriodSeen, name: str, mixing: Mixing | None, *, why: Value | None) -> Row:
    closed = Reason("compare.closed", days=span((seen.first, seen.last)))
    cells: dict[str, Value]
    if mixing is None or mixing.layout is None:
        none = why or lack("ok" if mixing is None else mixing.state, None if mixing is None else mixing.reason)
        cells = dict.fromkeys(("close_pair_h", "copresent_h", "layout_chance", "behaviour_ratio"), none)
    else:
        behaviour = known(mixing.behaviour, mixing.reason, mixing.state)
        if mixing.behaviour is not None:
            behaviour = Value(
                mixing.behaviour, mixing.lo, mixing.hi, reason=mixing.reason if mixing.lo is None else None
            )
        cells = {
            "close_pair_h": Value(mixing.close_h),
            "copresent_h": Value(mixing.copresent_h),
            "layout_chance": Value(mixing.layout),
            "behaviour_ratio": behaviour,
        }
    return {
        "period": name,
        "first_date": seen.first,
        "last_date": seen.last,
        "recorded_share": known(seen.coverage, closed),
        "recorded_h": seen.recorded_h,
        "scheduled_h": seen.scheduled_h,
        **cells,
    }


def _place(place: PlaceChange, rest: str) -> Row:
    split, few = place.split, Reason("change.few")
    people = split.people
    levels: dict[str, tuple[RateEstimate | Value, RateEstimate | Value, ChangeEstimate]] = {
        "violations_per_open_h": (place.violation_rate_a, place.violation_rate_b, split.violation_rate),
        "close_time_share": (place.close_time_share_a, place.close_time_share_b, place.close_time_share),
        "close_min_per_open_h": (place.burden_a, place.burden_b, place.burden),
        "people": (
            known(people.rate_a, people.reason or few, people.state),
            known(people.rate_b, people.reason or few, people.state),
            people,
        ),
        "violations_per_person_h": (place.encounter_rate_a, place.encounter_rate_b, split.encounter_rate),
    }
    row: dict[str, Value | str | float | None] = {
        "kind": place.kind,
        "area_id": place.area_id,
        "name": place.name if isinstance(place.name, str) else rest,
    }
    for name, (before, after, change) in levels.items():
        row |= {
            f"{name}_before": before if isinstance(before, Value) else measured(before),
            f"{name}_after": after if isinstance(after, Value) else measured(after),
            f"{name}_change": relative(change, reason=few),
            f"{name}_verdict": change.verdict,
        }
    rate = split.violation_rate
    return {
        **row,
        "people_change_share": known(split.people_share, Reason("change.no_people_share")),
        "n_violations_before": _count(place.violation_rate_a),
        "n_violations_after": _count(place.violation_rate_b),
        "n_compared_before": known(rate.n_a, rate.reason or few, rate.state),
        "n_compared_after": known(rate.n_b, rate.reason or few, rate.state),
        "recorded_h_before": place.violation_rate_a.exposure_h,
        "recorded_h_after": place.violation_rate_b.exposure_h,
        "person_h_before": place.encounter_rate_a.exposure_h,
        "person_h_after": place.encounter_rate_b.exposure_h,
        "compared_h_before": rate.exposure_a_h,
        "compared_h_after": rate.exposure_b_h,
    }


def _count(rate: RateEstimate) -> Value:
    return known(rate.n_events, rate.reason or Reason("change.few"), rate.state)


def _causes(mixing: MixingChange | None, holds: HoldsFor, *, why: Value | None) -> Answer:
    """Return by how much each cause moved the time that pairs spend too close; the first row is that time itself."""
    if why is None and (mixing is None or mixing.state != "ok" or mixing.close is None):
        why = lack("ok" if mixing is None else mixing.state, None if mixing is None else mixing.reason)
    if why is not None or mixing is None or mixing.close is None:
        return _answer("change_causes", CAUSES, (), holds, why=why)
    reason, no_shares = mixing.reason or Reason("change.few"), Reason("change.no_shares")

    def row(cause: str, change: Value, part: float | None, share: float | None, verdict: str | None = None) -> Row:
        return {
            "cause": cause,
            "cause_change": change,
            "cause_verdict": verdict,
            "cause_part": known(part, reason),
            "cause_share": known(share, no_shares),
        }

    def ratio(value: float | None) -> Value:
        return known(None if value is None else value - 1, reason)

    behaviour = mixing.behaviour
    rows = (
        row("close_time", ratio(mixing.close), mixing.close - 1, 1.0),
        row("crowding", ratio(mixing.crowding), mixing.crowding_part, mixing.crowding_share),
        row("layout", ratio(mixing.layout), mixing.layout_part, mixing.layout_share),
        row(
            "behaviour",
            relative(behaviour, reason=reason),
            mixing.behaviour_part,
            mixing.behaviour_share,
            None if behaviour is None else behaviour.verdict,
        ),
    )
    return _answer("change_causes", CAUSES, rows, holds, why=None)


def _notes(comparison: Comparison) -> list[Reason]:
    notes = list(comparison.notes)
    if comparison.state == "ok":
        notes.append(Reason("compare.compared", n=comparison.n_pairs, hours=comparison.hours_compared))
        rates = (comparison.places[0].violation_rate_a, comparison.places[0].violation_rate_b)
        if any(round(rate.exposure_h - comparison.hours_compared, 1) > 0 for rate in rates):
            notes.append(Reason("compare.all_hours"))
    if comparison.days_left_out:
        notes.append(Reason("compare.days_left_out", days=", ".join(map(str, comparison.days_left_out))))
    return notes + [Reason("compare.left_out", camera=c, why=why) for c, why in comparison.cameras_left_out.items()]
