"""`vsd report`: the weekly page, its files, its figures and its mail."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from vsd_analytics.cli.options import choice_option, exact_option, json_option, language_option
from vsd_analytics.cli.output import facts_progress, render_error
from vsd_analytics.cli.project import Project, folder_of_files, pass_project, warn_of_broken_log_lines
from vsd_analytics.cli.ranges import last_monday
from vsd_analytics.cli.report_formats import FIGURES, Formats, ReportFiles, checked, expanded, print_one, write
from vsd_analytics.errors import ReportError, UsageError, VsdError
from vsd_analytics.site.instants import parse_range, parse_week
from vsd_analytics.site.places import named_floors

if TYPE_CHECKING:
    from vsd_analytics.report.model.week import WeekReport
    from vsd_analytics.report.pages.pdf import Paper


MOST_DAYS: Final = 31
"""Most days of a page of --range."""
PAGES: Final = frozenset({"html", "pdf", "json"})
"""Formats that show the week's question to somebody."""


@click.command()
@click.option("--week", metavar="WEEK", help="ISO week: 2026-W46, last, last-2.  [default: last]")
@click.option("--range", "days", metavar="DAYS", help="Other local days: 2026-11-09..2026-11-22, 2026-11-09.")
@click.option(
    "--format",
    "kinds",
    metavar="FORMATS",
    type=Formats(),
    help="html, pdf, json, csv; svg or png of one --figure; several with commas, or all.  [default: html]",
)
@click.option("--figure", type=click.Choice(FIGURES), help="The figure that svg and png draw.")
@choice_option("--paper", choices=["a4", "letter"], default="a4", help="Paper of the PDF.")
@click.option(
    "--out",
    metavar="DIR",
    help="Folder to write to, or - for standard output (default: reports/ of the project, with --exact operator/).",
)
@click.option("--floor", "floor_id", metavar="FLOOR", help="Only this floor (default: one report for each).")
@click.option("--strict", is_flag=True, help="Exit with 1 when too little was recorded to compare.")
@click.option("--open", "is_opened", is_flag=True, help="Open the page, the PDF or the figure.")
@click.option("--mail", "is_mailed", is_flag=True, help="Write the week as a mail, .eml (in mail/ of the project).")
@click.option("--send", "is_sent", is_flag=True, help="Send it by [mail] of vsd.toml, to nobody twice.")
@click.option("--to", "to", metavar="ADDRESS", multiple=True, help="Who it goes to (default: [mail] to); repeatable.")
@click.option("--from", "sender", metavar="ADDRESS", help="Who it comes from (default: [mail] from).")
@click.option("--subject", metavar="TEXT", help="Its subject (default: site, week and headline).")
@click.option("--zip", "is_zipped", is_flag=True, help="Attach the page as well, in a zip archive.")
@click.option("--again", "is_again", is_flag=True, help="Send it even to those who have this week.")
@exact_option
@language_option
@json_option
@pass_project
def report(
    project: Project,
    week: str | None,
    days: str | None,
    kinds: tuple[str, ...] | None,
    figure: str | None,
    paper: Paper,
    out: str | None,
    floor_id: str | None,
    strict: bool,
    is_opened: bool,
    is_mailed: bool,
    is_sent: bool,
    to: tuple[str, ...],
    sender: str | None,
    subject: str | None,
    is_zipped: bool,
    is_again: bool,
    as_json: bool,
) -> int:
    """Write the weekly report: more violations or fewer, where, when, and how certain.

    All formats come from one set of figures, computed once.

    \b
    Example:
      vsd report --week last --open
      vsd report --week 2026-W46 --format html,pdf,json,csv
      vsd report --week 2026-W46 --format png --figure where
      vsd report --week 2026-W46 --format json --out -
      vsd report --range 2026-11-09..2026-11-22 --exact
      vsd report --week last --mail --send
    """
    from vsd_analytics.cli import report_mail
    from vsd_analytics.report.send import sent_mails

    is_mailed = is_mailed or is_sent
    if as_json:
        if is_mailed or figure is not None or kinds not in (None, ("json",)):
            raise UsageError("--json prints the figures and nothing else", fix="vsd report --week WEEK --json")
        kinds, out = ("json",), "-"
    if kinds is None:
        kinds = () if is_mailed else ("html",)
    if not is_mailed and (to or sender or subject or is_zipped or is_again):
        raise UsageError("--to, --from, --subject, --zip and --again go with a mail", fix="--mail, or --mail --send")
    if is_mailed and out == "-":
        raise UsageError("a mail is a file", fix="--out DIR, or leave --out away: it goes to mail/ of the project")
    options = report_mail.MailOptions(
        sender=sender, to=to, is_sent=is_sent, is_again=is_again, subject=subject, is_zipped=is_zipped
    )
    options = report_mail.checked(project, options) if is_mailed else options
    reports = make_reports(project, week=week, days=days, floor_id=floor_id)
    every = [_files(project, r, figure=figure, paper=paper) for r in reports]
    kinds = expanded(kinds, every[0])
    checked(kinds, figure=figure, files=every[0], is_mailed=is_mailed)
    if out == "-":
        print_one(every, kinds)
        return _exit_code(reports, strict=strict)
    folder = project.pages(out)
    paths: list[Path] = []
    failed: list[VsdError] = []
    for files in every:
        for kind in kinds:
            try:
                paths += write(folder, files.of(kind))
            except ReportError as error:  # the other files and the mail are made all the same
                failed.append(error)
    code = _exit_code(reports, strict=strict)
    for files in every if is_mailed else ():
        where = folder_of_files(Path(out)) if out is not None else project.root / sent_mails.FOLDER
        try:
            paths.append(report_mail.mail_week(project, files, options=options, out=where))
        except VsdError as error:
            failed.append(error)
    if is_mailed or PAGES & set(kinds):
        remember_questions(project, reports)
    for path in paths:
        click.echo(f"{path}   {path.stat().st_size / 1000:.0f} KB")
    for report in reports:
        _say_what_lacks(project, report)
    warning = report_mail.late(project, every[0], week=week or "last") if is_sent and days is None else None
    if warning is not None:
        click.echo(render_error(warning, word="warning"), err=True)
        code = 1
    for failure in failed[:-1]:
        click.echo(render_error(failure), err=True)
    if failed:
        raise failed[-1]
    if is_opened and paths:
        click.launch(str(paths[0]))
    return code


def _say_what_lacks(project: Project, report: WeekReport) -> None:
    """Say why a page compares and ranks nothing, where too little was recorded or the week is not over."""
    if report.is_so_far:
        least = report.rules.min_coverage
        project.say(
            f"{report.week.iso} is not over: the page compares and ranks nothing before {least:.0%} of its open "
            "hours are recorded"
        )
    elif report.state in ("no_data", "too_incomplete"):
        floor = "" if len(project.site.floors) == 1 else f" of {report.site.floor_name}"
        project.say(
            f"{report.week.iso}{floor}: {_share(report)} of the open hours were recorded, so the "
            "page gives no change and no ranking; vsd coverage shows which hours, --week makes another week"
        )


def remember_questions(project: Project, reports: list[WeekReport]) -> None:
    """Store the questions of the pages for later weeks; a read-only project only warns."""
    from vsd_analytics.config.asked_questions import remember
    from vsd_analytics.report.pages.questions import choose, may_ask

    try:
        remember(project.site, [choose(report) for report in reports if may_ask(report)])
    except VsdError as error:
        click.echo(render_error(error, word="warning"), err=True)


def _share(report: WeekReport) -> str:
    share = report.coverage.share
    return "nothing" if not share else "under 1 %" if share < 0.01 else f"only {100 * share:.0f} %"


def _exit_code(reports: list[WeekReport], *, strict: bool) -> int:
    return 1 if strict and any(r.state in ("no_data", "too_incomplete") for r in reports) else 0


def _files(project: Project, report: WeekReport, *, figure: str | None = None, paper: Paper = "a4") -> ReportFiles:
    is_only = len(project.site.floors) == 1
    return ReportFiles(report=report, site=project.site, is_only=is_only, figure=figure, paper=paper)


def make_reports(
    project: Project, *, week: str | None, floor_id: str | None, days: str | None = None
) -> list[WeekReport]:
    """Return the finished report of each floor for a week or other days, with a progress bar over facts to be made.

    Raises:
        UsageError: E101, a week and days, no range of days, or too many of them; an unknown floor.
    """
    from vsd_analytics.report.pages.story import days_report, week_report

    project.speak()
    if days is not None and week is not None:
        raise UsageError("--week and --range both say which days", fix="one of them")
    first, last = _days(days) if days is not None else (None, None)
    monday = parse_week(week or "last", last=last_monday(project)) if first is None else first
    floors = named_floors(project.site, floor_id)
    warn_of_broken_log_lines(project)
    with facts_progress(quiet=project.quiet) as (on_plan, on_hours):
        clock = project.now
        options: dict[str, Any] = {
            "now": clock if project.now_text is not None else None,
            "clock": clock,
            "on_plan": on_plan,
            "on_hours": on_hours,
        }
        return [
            week_report(project.site, monday, floor_id=f, **options)
            if last is None
            else days_report(project.site, monday, last, floor_id=f, **options)
            for f in floors
        ]


def _days(text: str) -> tuple[date, date | None]:
    """Return first and last day of a range; of one ISO week its Monday and None, since that has a report of its own."""
    first, last = parse_range(text)
    n = (last - first).days + 1
    if n > MOST_DAYS:
        raise UsageError(
            f"{n} days are too many for one page", why=f"it has at most {MOST_DAYS}", fix="a shorter --range, or --week"
        )
    is_week = n == 7 and first.weekday() == 0
    return first, None if is_week else last
