"""The story of a week, made from its figures in one direction: headline, lead, three things to know, one question."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import date, datetime

from vsd_analytics.report.model.assemble import measured
from vsd_analytics.report.model.week import Story, WeekReport
from vsd_analytics.report.pages.headline import headline, lead
from vsd_analytics.report.pages.questions import choose, may_ask
from vsd_analytics.report.pages.spoken import spoken_of
from vsd_analytics.report.pages.things_to_know import things
from vsd_analytics.site.model import Site
from vsd_analytics.wording.languages import speaking


def week_report(
    site: Site,
    monday: date,
    *,
    floor_id: str | None = None,
    now: datetime | None = None,
    clock: datetime | None = None,
    on_plan: Callable[[int], None] | None = None,
    on_hours: Callable[[int], None] | None = None,
    has_context: bool = False,
) -> WeekReport:
    """Return the report of one floor and ISO week, its sentences in the site's language (or that of `speaking`).

    Args:
        site: The project.
        monday: First day of the week.
        floor_id: Floor; None = the first.
        now: Instant to print as the time of making; None = the last record's.
        clock: The present: hours that are not over at it are neither recorded nor missing; None = all are over.
        on_plan: Called with the number of fact hours to compute first; see `build`.
        on_hours: Called after computed hours.
        has_context: With figures that use what else happened, also where `show_context` is off.

    Returns:
        The report with its story; a week without data has a report too.

    Raises:
        StoreError: E301, nothing was ever stored.
        KeyError: The site has no floor of this id.

    Example:
        >>> report = vsd.week_report(site.site, date(2026, 11, 9))
        >>> report.state, vsd.render_html(report)[:15]
        ('first_week', '<!doctype html>')
    """
    return finish(
        measured(
            site,
            monday,
            None,
            floor_id=floor_id,
            now=now,
            clock=clock,
            on_plan=on_plan,
            on_hours=on_hours,
            has_context=has_context,
        )
    )


def days_report(
    site: Site,
    first: date,
    last: date,
    *,
    floor_id: str | None = None,
    now: datetime | None = None,
    clock: datetime | None = None,
    on_plan: Callable[[int], None] | None = None,
    on_hours: Callable[[int], None] | None = None,
) -> WeekReport:
    """Return the report of one floor and days in a row, for a study of a day or a fortnight.

    It has what such days can tell: no spots, trend, forecast or logged changes, which need weeks, and no question.
    Whole weeks of days are compared with as many days before them; other days are compared with nothing, since the
    days before them are other days of the week.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
        floor_id: Floor; None = the first.
        now: Instant to print as the time of making; None = the last record's.
        clock: The present, as for `week_report`.
        on_plan: Called with the number of fact hours to compute first; see `build`.
        on_hours: Called after computed hours.

    Raises:
        StoreError: E301, nothing was ever stored.
        KeyError: The site has no floor of this id.
    """
    return finish(
        measured(site, first, last, floor_id=floor_id, now=now, clock=clock, on_plan=on_plan, on_hours=on_hours)
    )


def finish(report: WeekReport) -> WeekReport:
    """Return the report with its story filled in."""
    if report.story is not None:
        return report
    with speaking(report.language), spoken_of(report):
        return replace(report, story=story_of(report))


def story_of(report: WeekReport) -> Story:
    """Make the words of the page.

    Args:
        report: The figures; `report.story` is not read.

    Returns:
        Headline with the name of its rule, lead, at most three things to know, one question, notes.
    """
    rule, title = headline(report)
    spans, notes = lead(report)
    question = choose(report) if may_ask(report) else None
    return Story(
        headline=title,
        rule=rule,
        lead=tuple(spans),
        things=things(report),
        question="" if question is None else question.text,
        question_id="" if question is None else question.question_id,
        notes=tuple(notes),
    )
