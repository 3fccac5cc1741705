"""How often the verdicts on a floor are false: its own past weeks, shuffled so that nothing changes on average.

The arithmetic is `vsd_analytics.stats.false_alarms`, on the two numbers of the floor that a weekly report judges: how
often (M0) and how risky (M7).
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from functools import partial
from typing import Final

import numpy as np

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, State, Value
from vsd_analytics.figures.panels import WEEK, Array, FloorHours, Panel
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.values import lack, measured
from vsd_analytics.site.model import Site
from vsd_analytics.stats.false_alarms import MIN_WEEKS, FalseAlarms, false_alarm_rate, together
from vsd_analytics.warehouse.stored_days import stored_extent

MAX_WEEKS: Final = 26
"""Weeks of the past that are shuffled, at most: what a site was like before that says little of today."""
WEEKS_A_YEAR: Final = 52
SELF_CHECK: Final = (
    Column("floor_id", "key"),
    Column("judged", "key"),
    Column("false_alarm_share", "share", "share"),
    Column("verdicts_a_year", "fact"),
    Column("false_a_year", "rate", "verdicts"),
    Column("n_weeks", "fact", "weeks"),
)
"""Columns of `self_check`."""

Days = tuple[date, date]


@dataclass(frozen=True, slots=True)
class FloorSelfCheck:
    """How often a clear verdict on a floor is false, as its own weeks tell.

    Attributes:
        floor_id: The floor.
        weeks: First day of the first and last day of the last week used; None without a week.
        n_weeks: Weeks used: whole, and recorded as far as a week must be to be compared (`min_coverage`).
        violation_rate: False alarms of how often (M0); None without a verdict.
        encounter_rate: Of how risky (M7); likewise.
        both: Of the two together; None where neither has one.
        verdicts_a_year: Verdicts on the floor in a year of weekly reports: 52 for each number that is judged.
        false_a_year: Expected false ones among them, with its interval.
        state, reason: Why nothing can be said.
    """

    floor_id: str
    weeks: Days | None
    n_weeks: int
    violation_rate: FalseAlarms | None
    encounter_rate: FalseAlarms | None
    both: FalseAlarms | None
    state: State
    reason: Reason | None

    @property
    def verdicts_a_year(self) -> int:
        """Return the verdicts on the floor in a year of weekly reports."""
        return WEEKS_A_YEAR * sum(figure is not None for figure in (self.violation_rate, self.encounter_rate))

    @property
    def false_a_year(self) -> tuple[float, float, float] | None:
        """Return how many of them are false, and the limits of that number."""
        if self.both is None:
            return None
        share, lo, hi = (self.verdicts_a_year * value for value in (self.both.value, self.both.lo, self.both.hi))
        return share, lo, hi


def days_needed(site: Site) -> Days:
    """Return the local days a warehouse must hold for a self-check: the last 26 whole weeks with records.

    Without records: one day, on which nothing is found.
    """
    extent = stored_extent(site)
    if extent is None:
        return date(2000, 1, 1), date(2000, 1, 1)
    last = extent.last_day + timedelta(days=1)
    monday = last - timedelta(days=last.weekday())
    return max(extent.first_day, monday - MAX_WEEKS * WEEK), max(extent.first_day, monday - timedelta(days=1))


def self_check(data: FloorHours, *, until: date) -> FloorSelfCheck:
    """Return how often shuffled weeks of a floor would have been called a clear fall or rise.

    Args:
        data: The floor; its warehouse is opened over the weeks to use, at most the last 26 of which are.
        until: Last day of the last week, a Sunday.
    """
    floor_id, settings = data.floor.floor_id, data.site.settings
    weeks = _weeks(data, until)
    if not weeks:
        return FloorSelfCheck(floor_id, None, 0, None, None, None, "not_enough_data", _too_few(0))
    used, last = (weeks[0].first, weeks[-1].last), weeks[-1]
    if last.why_no_violations is not None:
        why = last.why_no_violations
        return FloorSelfCheck(floor_id, used, len(weeks), None, None, None, "not_measurable", why)
    panels = [data.panel(last.whole, week.days) for week in weeks]
    violation_rate = encounter_rate = None
    if len(weeks) >= MIN_WEEKS:
        rate = partial(false_alarm_rate, **settings.for_intervals)
        n, x_h = (_stacked(panels, name) for name in ("n", "x_h"))
        violation_rate = rate(n, x_h)
        if all(week.why_no_exposure is None for week in weeks):
            person_h = _stacked(panels, "exposure_h")
            encounter_rate = rate(n.sum(axis=1)[:, None], person_h.sum(axis=1)[:, None])
    figures = [figure for figure in (violation_rate, encounter_rate) if figure is not None]
    if not figures:
        why = _too_few(len(weeks)) if len(weeks) < MIN_WEEKS else Reason("selfcheck.verdicts")
        return FloorSelfCheck(floor_id, used, len(weeks), None, None, None, "not_enough_data", why)
    both = together(figures, confidence=settings.confidence)
    return FloorSelfCheck(floor_id, used, len(weeks), violation_rate, encounter_rate, both, "ok", None)


def self_check_answer(check: FloorSelfCheck, site: Site, *, until: date, inputs: str) -> Answer:
    """Return a self-check as an answer: a row for each number that gets a verdict, and one for both together.

    Columns: share of verdicts that are false alarms; verdicts in a year of weekly reports, and how many of them are
    false; weeks used. It holds for the weeks used.

    Args:
        check: The self-check.
        site: The site.
        until: Last day that was asked for, where no week is used.
        inputs: Hash of the facts.
    """
    first, last = check.weeks or (until, until)
    holds = HoldsFor(site.site_id, check.floor_id, first, last, settings=site.settings.settings_id(), inputs=inputs)
    if check.state != "ok":
        nothing = lack(check.state, check.reason)
        return Answer("self_check", SELF_CHECK, (), holds, nothing=nothing.reason, state=nothing.state)
    judged = {"violation_rate": check.violation_rate, "encounter_rate": check.encounter_rate, "both": check.both}
    return Answer("self_check", SELF_CHECK, tuple(_judged(check, *entry) for entry in judged.items()), holds)


def _judged(check: FloorSelfCheck, judged: str, share: FalseAlarms | None) -> Row:
    a_year = check.verdicts_a_year if judged == "both" else WEEKS_A_YEAR if share is not None else 0
    why = Reason("selfcheck.not_judged")
    expected = None if share is None else Value(a_year * share.value, a_year * share.lo, a_year * share.hi)
    return {
        "floor_id": check.floor_id,
        "judged": judged,
        "false_alarm_share": Value.missing(why) if share is None else measured(share),
        "verdicts_a_year": a_year,
        "false_a_year": expected or Value.missing(why),
        "n_weeks": check.n_weeks,
    }


def _weeks(data: FloorHours, until: date) -> list[Period]:
    """Return the weeks that a report would compare, oldest first."""
    mondays = [until - timedelta(days=6) - k * WEEK for k in range(MAX_WEEKS)]
    withheld = data.warehouse.withheld_days.get(data.floor.floor_id, ())
    inside = [monday for monday in reversed(mondays) if monday >= data.warehouse.first and monday not in withheld]
    weeks = [Period(data, monday, monday + timedelta(days=6)) for monday in inside]
    least = data.site.settings.min_coverage
    return [week for week in weeks if week.recorded_h > 0 and week.recorded_h >= least * week.scheduled_h]


def _stacked(panels: list[Panel], name: str) -> Array:
    """Return one field of panels, shape (n_weeks, n_cameras, 7)."""
    return np.array([getattr(panel, name) for panel in panels])


def _too_few(n_weeks: int) -> Reason:
    return Reason("selfcheck.weeks", least=MIN_WEEKS, has=n_weeks)
