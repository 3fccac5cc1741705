"""The answers on a logged change that the planner would have, made from the section that a page has of it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date

from vsd_analytics.answer import VALUES, Answer, Answers, Cell, Column, HoldsFor, Reason, Value
from vsd_analytics.figures import change_answers as columns
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import LoggedChangeEffect

_HOLDS = HoldsFor("shop", "ground", date(2026, 11, 9), date(2026, 11, 15))
_NONE = Reason("logged_change.none")


def planner_answers(change: LoggedChangeEffect) -> Answers:
    """Return the tables of `shared_change_answers` as far as the planner's words read them."""
    entry = {"entry": change.number, "name": change.area_name, "design": change.design, "outcome": change.outcome}
    entry |= {"n_weeks_each_side": change.n_weeks, "comparison_names": change.compared_with}
    notes = [(None, Reason("logged_change.doubt", why=why)) for why in change.doubts]
    so_far: list[dict[str, Cell]] = []
    if change.running is not None:
        share = Value.missing(_NONE) if change.moved_elsewhere is None else Value(change.moved_elsewhere)
        so_far = [
            {
                "effect": "close_min_per_open_h",
                "so_far_change": _value(change.running),
                "so_far_verdict": change.running.verdict,
                "n_weeks_after": change.n_watched or 0,
                "taken_up_share": share,
            }
        ]
    received = [
        {
            "area_id": r.area_name,
            "name": r.area_name,
            "received_people_change": Value(r.change, r.change_lo, r.change_hi),
        }
        for r in change.receivers
    ]
    people = [] if change.people is None else [{"place": "area", "place_people_change": _value(change.people)}]
    places = _table("change_places", columns.PLACES, people)
    if change.state != "ok":
        places = Answer("change_places", columns.PLACES, (), _HOLDS, nothing=change.reason, state=change.state)
    return Answers(
        (
            Answer("logged_change", columns.CHANGE, _rows(columns.CHANGE, [entry]), _HOLDS, notes=tuple(notes)),
            _table("change_effects", columns.EFFECTS, []),
            _table("change_so_far", columns.SO_FAR, so_far),
            _table("change_parts", columns.PARTS, []),
            _table("change_receivers", columns.RECEIVERS, received),
            places,
        )
    )


def _table(name: str, of: Sequence[Column], rows: Sequence[dict[str, Cell]]) -> Answer:
    return Answer(name, tuple(of), _rows(of, rows), _HOLDS)


def _rows(of: Sequence[Column], rows: Sequence[dict[str, Cell]]) -> tuple[dict[str, Cell], ...]:
    return tuple({c.name: Value.missing(_NONE) if c.kind in VALUES else None for c in of} | row for row in rows)


def _value(estimate: Estimate) -> Value:
    if estimate.change is None:
        return Value.missing(estimate.reason)
    return Value(estimate.change, estimate.change_lo, estimate.change_hi, reason=estimate.reason)
