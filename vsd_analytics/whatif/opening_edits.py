"""Other opening hours: who came in the hours that close, and what if some of them come beside the others."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date, datetime
from typing import Final
from zoneinfo import ZoneInfo

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.site.layout import OpeningEdit, Spans
from vsd_analytics.whatif.arrays import Bools, Floats, Ints
from vsd_analytics.whatif.closeness import n_close
from vsd_analytics.whatif.floor_records import ALONE, FloorRecords
from vsd_analytics.whatif.frame_pairs import FramePairs
from vsd_analytics.whatif.ranges import MIN_CLOSE_S, PredictedChange, predicted_change, spread
from vsd_analytics.whatif.retiming import Meetings, StepAside, halves, shifted, step_aside

STRANGERS_SD: Final = 0.15
"""Standard deviation of the time too close to strangers, shifted over recorded, of halves of real hours left out."""


@dataclass(frozen=True, slots=True)
class OpeningEffect:
    """What other opening hours do.

    Attributes:
        n_people: Tracks in opening hours, as recorded.
        n_closed: Of these, those that begin in an hour that would close.
        change: Of the time too close per open hour on the whole floor; None where refused.
        aside: The site's step aside; None where refused.
        refusal: Why there is no change.
    """

    n_people: int
    n_closed: int
    change: PredictedChange | None
    aside: StepAside | None
    refusal: Reason | None


@dataclass(frozen=True, slots=True)
class _ClosedPeople:
    closed: Bools
    """Which records are of people of hours that close, shape (n_records,)."""
    shift_s: Floats
    """By how much these would come at another time; NaN where the day has no open hour left."""


def opening_effect(
    records: FloorRecords, edit: OpeningEdit, opening: tuple[Spans, ...] | None, *, zone: ZoneInfo, within_m: float
) -> OpeningEffect:  # fmt: skip
    """Return what other opening hours do to the people of a floor.

    People of a span that closes come right after it, or right before it, in the nearest span that stays open; a stated
    share of them comes, chosen evenly over the day, companions together.

    Args:
        records: All people of the floor in opening hours.
        edit: The hours thought of.
        opening: The hours in force; None = always open.
        zone: Of opening hours.
        within_m: The distance.
    """
    first = np.flatnonzero(np.r_[True, records.track[1:] != records.track[:-1]][: records.track.size])
    n_records = np.diff(first, append=records.track.size)
    moves = _moves(edit, *local_minutes(records.t_s[first], zone))
    n_closed = int(moves.closed.sum())
    longer = opening is not None and any(
        not _is_within(span, old) for new, old in zip(edit.opening, opening, strict=True) for span in new
    )
    refusal = _refusal(edit, moves, n_closed, is_longer=longer)
    if refusal is not None or not n_closed:
        change = PredictedChange(0.0, 0.0, 0.0) if refusal is None else None
        return OpeningEffect(first.size, n_closed, change, None, refusal)
    assert edit.follow_share is not None
    aside = step_aside(records, halves(records), within_m=within_m)
    party = np.where(records.company[first] == ALONE, -2 - first, records.company[first])
    comes = moves.closed & _evenly(party, records.t_s[first], moves.closed, edit.follow_share)
    change, refusal = _change(
        records, np.repeat(moves.closed, n_records), np.repeat(np.where(comes, moves.shift_s, np.nan), n_records),
        aside.strength, _hours_left(edit, opening, records.day_numbers[0]), within_m,
    )  # fmt: skip
    return OpeningEffect(first.size, n_closed, change, aside, refusal)


def local_minutes(t_s: Floats, zone: ZoneInfo) -> tuple[Ints, Ints]:
    """Return weekday (0 = Monday) and minute after local midnight of instants."""
    quarters, at = np.unique(t_s // 900, return_inverse=True)
    local = [datetime.fromtimestamp(900 * q, zone) for q in quarters.tolist()]
    weekday = np.array([when.weekday() for when in local], np.int64)[at.ravel()]
    start = np.array([60 * when.hour + when.minute for when in local], np.int64)[at.ravel()]
    return weekday, start + (t_s % 900 // 60).astype(np.int64)


def _moves(edit: OpeningEdit, weekday: Ints, minute: Ints) -> _ClosedPeople:
    closed, shift_s = np.zeros(minute.size, np.bool_), np.full(minute.size, np.nan)
    for day in range(7):
        spans, own = edit.opening[day], weekday == day
        is_open = np.zeros(minute.size, np.bool_)
        for begin, end in spans:
            is_open |= (minute >= begin) & (minute < end)
        out = own & ~is_open
        closed |= out
        best = np.full(minute.size, np.inf)
        for begin, end in spans:  # before an opening: mirrored behind it, so that the first come first to the open door
            for shift, is_here in ((begin - minute, minute < begin), (end - 1 - minute, minute >= end)):
                nearer = out & is_here & (np.abs(shift) < best)
                best[nearer] = np.abs(shift[nearer])
                shift_s[nearer] = 2 * 60.0 * shift[nearer]
    return _ClosedPeople(closed, shift_s)


def _refusal(edit: OpeningEdit, moves: _ClosedPeople, n_closed: int, *, is_longer: bool) -> Reason | None:
    if is_longer:
        return Reason("whatif.longer_hours")
    if n_closed and edit.follow_share is None:
        return Reason("whatif.no_share")
    if not np.isfinite(moves.shift_s[moves.closed]).all():
        return Reason("whatif.closed_day")
    return None


def _is_within(span: tuple[int, int], spans: Spans) -> bool:
    return any(begin <= span[0] and span[1] <= end for begin, end in spans)


def _hours_left(edit: OpeningEdit, opening: tuple[Spans, ...] | None, days: Ints) -> float:
    """Return the open hours after the edit over those before, of the days with records."""
    before = (((0, 24 * 60),),) * 7 if opening is None else opening
    weekdays = [date.fromordinal(n).weekday() for n in days.tolist()]
    minutes = [sum(end - begin for d in weekdays for begin, end in week[d]) for week in (edit.opening, before)]
    return minutes[0] / minutes[1]


def _evenly(party: Ints, t_s: Floats, chosen: Bools, share: float) -> Bools:
    """Return a share of the people chosen, evenly in the order in which their parties come; parties stay whole."""
    rows = np.flatnonzero(chosen)
    parties, at = np.unique(party[rows], return_inverse=True)
    began = np.full(parties.size, np.inf)
    np.minimum.at(began, at.ravel(), t_s[rows])
    rank = np.empty(parties.size, np.int64)
    rank[np.argsort(began, kind="stable")] = np.arange(parties.size)
    takes = np.floor((rank + 1) * share) > np.floor(rank * share)
    result = np.zeros(party.size, np.bool_)
    result[rows] = takes[at.ravel()]
    return result


def _change(
    records: FloorRecords, closed: Bools, shift_s: Floats, strength: float, hours_left: float, within_m: float
) -> tuple[PredictedChange | None, Reason | None]:
    """Return the change of the time too close per open hour, of people who stay and who come at another time.

    Args:
        records: Everybody.
        closed: Which are of people of hours that close, shape (n_records,).
        shift_s: By how much people come at another time; NaN for those who do not.
        strength: With which they step aside; it is tried without, too.
        hours_left: Open hours after the edit over those before.
        within_m: The distance.
    """
    days, number = records.day_numbers
    before_s, after_s, met_s = np.zeros(days.size), np.zeros((2, days.size)), 0.0
    for day in records.days():
        part = records.part(np.arange(day.start, day.stop))
        weight_s = part.weight_s * part.is_owned
        recorded = n_close(part.frames, part.x_m, part.y_m, within_m=within_m) > 0
        before_s += np.bincount(number[day], weights=weight_s * recorded, minlength=days.size)
        layer = shifted(part, np.isfinite(shift_s[day]), shift_s[day])
        stay = np.flatnonzero(~closed[day])
        open_records = replace(part, frame=np.where(closed[day], -1 - np.arange(part.frame.size), part.frame))
        meetings = Meetings(open_records, layer, within_m=within_m)
        met_s += meetings.close_s(0.0)
        rows, frames = np.r_[stay, layer.rows], FramePairs(np.r_[part.frame[stay], layer.frame])
        for model, step in enumerate((0.0, strength)):
            places = (
                np.r_[own[stay], new] for own, new in zip((part.x_m, part.y_m), meetings.places(step), strict=True)
            )
            close_s = weight_s[rows] * (n_close(frames, *places, within_m=within_m) > 0)
            after_s[model] += np.bincount(number[day][rows], weights=close_s, minlength=days.size)
    total_s = float(before_s.sum())
    if total_s < MIN_CLOSE_S:
        return None, Reason("whatif.little_time", least=MIN_CLOSE_S, has=total_s)
    by_day = after_s[1] / np.maximum(before_s, 1e-9) / hours_left
    changes = (after_s.sum(axis=1) / total_s / hours_left - 1).tolist()
    met_share = min(met_s / max(float(after_s[0].sum()), 1e-9), 1.0)  # of meetings that nobody has recorded
    sd = spread(close_s=total_s, within_m=within_m, by_day=by_day, extra_sd=STRANGERS_SD * met_share)
    return predicted_change(changes, sd), None
