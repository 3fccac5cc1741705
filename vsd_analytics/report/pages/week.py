"""The weekly page: one HTML file with one style, no script, no request, equal bytes for equal reports."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import dataclass, fields
from functools import cache
from itertools import pairwise
from typing import Any, Final

from markupsafe import Markup

from vsd_analytics.figures.week.model_map import FloorMap
from vsd_analytics.figures.week.results import AreaRow
from vsd_analytics.figures.week.uncertain_floor import LIMIT_SHARE
from vsd_analytics.report.draw import floor_plan, svg
from vsd_analytics.report.model.week import Story, WeekReport
from vsd_analytics.report.pages import figure_titles, sections, tables
from vsd_analytics.report.pages.change_rows import ChangeRow, change_rows
from vsd_analytics.report.pages.context import ContextView, context
from vsd_analytics.report.pages.contributions import Contributions, contributions
from vsd_analytics.report.pages.figure_list import FigureRow, further_figures
from vsd_analytics.report.pages.json_and_csv import rounded
from vsd_analytics.report.pages.key_figures import Tile, tiles
from vsd_analytics.report.pages.lines import LinesView, has_lines, lines_and_doors
from vsd_analytics.report.pages.logged_changes import AskedLine, LogRow, asked_lines, log_rows
from vsd_analytics.report.pages.map_figures import MapFigures, map_figures
from vsd_analytics.report.pages.replies import ReplyButton, reply_buttons
from vsd_analytics.report.pages.spoken import in_its_words
from vsd_analytics.report.pages.spot_cards import Cards, cards
from vsd_analytics.report.pages.story import finish
from vsd_analytics.report.pages.templates import environment
from vsd_analytics.report.pages.waiting import WaitingView, waiting
from vsd_analytics.resources import shipped
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

WIDE = 1.8
LETTER = "@page { size: letter; margin: 10mm 14mm 14mm }@media print { :root { --paper: 254.9mm } }"
_SECTIONS = ("where", "spots", "when", "changed", "waiting", "lines", "trend", "context", "next", "data", "about")


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnMap:
    """A map and its drawing.

    Attributes:
        shown: The map.
        drawing: It as SVG.
        is_wide: True when it is so much wider than high that paper has more room below than beside it.
    """

    shown: FloorMap
    drawing: Markup
    is_wide: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """Everything the templates may use; each field is one variable.

    Attributes:
        report: The figures.
        story: The words made from them.
        style: The page's only style.
        style_hash: Base64 SHA-256 of `style`, for the content security policy.
        span: First and last day in words.
        shown: Sections on this page.
        contents: Anchor and name of each section.
        anchors: Name of the section behind each anchor.
        things_title: Heading of the things to know.
        tiles: Key figures.
        titles: Titles of the figures.
        maps: Maps with drawings.
        figures: The drawings beside the maps.
        has_spots: True when numbers are drawn on a map.
        heat_legend: Steps of the map's ramp.
        doubles: True when each step of the map doubles.
        hour_legend: Steps of the timetable's ramp.
        is_ranked: True when areas may be ordered and shares shown.
        areas: Areas in the order of the page.
        table: The timetable.
        blocks: It in parts of at most seven days.
        not_recorded: What hatched floor of a map means.
        too_uncertain: What dotted floor of a map means.
        down: Names of cameras that were down in some hour.
        masked_hours: True when the count of any hour is too small to print.
        held_hours: True when any other hour is held back, as it would tell such a count.
        held_areas: The same of areas.
        mask_middle: What an hour too small to print counts in averages.
        second: True when the clocks were set back.
        is_compared: True when changes are shown.
        why_not_compared: Why not.
        axis: Labels above the interval bars.
        changes: Rows of the table of changes.
        strips: Rows of the table of recorded hours.
        strip_blocks: They in parts of at most seven days.
        outages: Missing hours, one by one.
        distance: The legal distance in the site's unit, on one line.
        readings_note: How far the second reading can be trusted, or why there is none.
        between: Violations between groups per open hour, by area; empty for none.
        cards: The numbered spots.
        unusual: Hours far from usual.
        contributions: What each area adds to the floor's change.
        causes: What moved the time spent close.
        change_effects: What logged changes did.
        trend: The last weeks.
        outlook: The next week.
        waiting: Queues and capacities.
        crossed: Counting lines and doors.
        what_else: What else happened.
        log: What happened at the site.
        log_section: Position of that list: "trend" below charts that mark it, else "changed".
        messages: How many messages are missing, in words.
        further_figures: Rows of the table of further figures.
        asked: What earlier weeks asked, and what came of it.
        is_at_desk: The page is served by the desk: its question has buttons, and it links to the other pages there.
        replies: The answers to the question, each with what it leads to.
        privacy: What is stored about people, until when, and what was deleted.
    """

    report: WeekReport
    story: Story
    style: Markup
    style_hash: str
    span: tuple[str, str]
    shown: frozenset[str]
    contents: tuple[tuple[str, str], ...]
    anchors: dict[str, str]
    things_title: str
    tiles: tuple[Tile, ...]
    titles: dict[str, str]
    maps: tuple[DrawnMap, ...]
    figures: MapFigures
    has_spots: bool
    heat_legend: tuple[tables.Step, ...]
    doubles: bool
    hour_legend: tuple[tables.Step, ...]
    is_ranked: bool
    areas: tuple[AreaRow, ...]
    table: tables.TimetableRows
    blocks: tuple[tables.TimetableRows, ...]
    not_recorded: str
    too_uncertain: str
    down: str
    masked_hours: bool
    held_hours: bool
    held_areas: bool
    mask_middle: float
    second: bool
    is_compared: bool
    why_not_compared: str
    axis: Markup
    changes: tuple[ChangeRow, ...]
    strips: tuple[tables.StripRow, ...]
    strip_blocks: tuple[tables.StripBlock, ...]
    outages: tuple[tables.OutageRow, ...]
    distance: str
    readings_note: str
    between: dict[str | None, float | None]
    cards: Cards | None
    unusual: sections.Listed | None
    contributions: Contributions | None
    causes: sections.BarTable | None
    change_effects: sections.BarTable | None
    trend: sections.TrendView | None
    outlook: sections.Listed | None
    waiting: WaitingView | None
    crossed: LinesView | None
    what_else: ContextView | None
    log: tuple[LogRow, ...]
    log_section: str
    messages: str
    further_figures: tuple[FigureRow, ...]
    asked: tuple[AskedLine, ...]
    is_at_desk: bool
    replies: tuple[ReplyButton, ...]
    privacy: str


@in_its_words
def render_html(report: WeekReport, *, paper: str = "a4", is_at_desk: bool = False, is_open: bool = True) -> str:
    """Return the page of a week as one self-contained HTML file.

    Floats are rounded as in the JSON file first, so that both have the same numbers.

    Args:
        report: The figures; its story is made here when it has none.
        paper: a4 or letter: what the page is printed on.
        is_at_desk: It is served by the desk, where its question is answered.
        is_open: Its question can be answered; False = it has no buttons.
    """
    return re.sub(
        r"\n\s*\n+",
        "\n",
        rendered("week.html.j2", make_page(report, paper=paper, is_at_desk=is_at_desk, is_open=is_open)),
    )


def make_page(report: WeekReport, *, paper: str = "a4", is_at_desk: bool = False, is_open: bool = True) -> Page:
    """Return what the templates show; see `Page`."""
    report = finish(rounded(report))
    if report.story is None:
        raise AssertionError("finish fills the story")
    style = _style(report, paper=paper)
    is_compared = report.state == "normal" and report.level.violation_rate.verdict is not None
    is_ranked = report.state in ("normal", "first_week", "settings_changed")
    weeks, figures = sections.trend(report), map_figures(report)
    log_section = "trend" if weeks is not None and weeks.panels else "changed"
    shown = _shown(report, figures, log_section=log_section)
    timetable, strips = tables.timetable(report), tables.strips(report)
    limit = svg.change_limit(
        [report.level.violation_rate, *(a.violation_rate for a in report.areas if not a.is_masked)]
    )
    rules, steps = report.rules, report.rules.heat_steps
    half_the_distance = fmt.distance(LIMIT_SHARE * rules.distance_m, rules.distance_unit)
    titles_of_things = {3: "things.title_three", 2: "things.title_two"}
    names = {c.camera_id: c.name for c in report.coverage.cameras}
    return Page(
        report=report,
        story=report.story,
        style=Markup(style),
        style_hash=policy_hash(style),
        span=fmt.date_span(report.week.monday, report.week.sunday),
        shown=shown,
        contents=tuple((k, say(f"nav.{k}")) for k in _SECTIONS if k in shown),
        anchors={k: say(f"nav.{k}") for k in _SECTIONS},
        things_title=say(titles_of_things.get(len(report.story.things), "things.title_one")),
        tiles=tiles(report),
        titles={name: getattr(figure_titles, name)(report) for name in ("where", "when", "changed", "data")},
        maps=tuple(_drawn(m, i, report, is_ranked=is_ranked) for i, m in enumerate(report.maps)),
        figures=figures,
        has_spots=is_ranked and any(m.spots for m in report.maps),
        heat_legend=tables.legend(steps, is_count=False),
        doubles=all(abs(b - 2 * a) < 1e-9 for a, b in pairwise(steps)),
        hour_legend=tables.legend(rules.hour_steps, is_count=True, highest=tables.highest_hour(report)),
        is_ranked=is_ranked,
        areas=report.areas if is_ranked else tuple(sorted(report.areas, key=lambda a: (a.area_id is None, a.name))),
        table=timetable,
        blocks=tables.blocks(timetable),
        not_recorded=not_recorded(report),
        too_uncertain=say("where.too_uncertain", half=half_the_distance),
        down=terms.joined(terms.camera_name(names.get(c, c)) for c in _down(report)),
        masked_hours=any(c.is_masked for c in report.when.cells),
        held_hours=any(c.is_held_back for c in report.when.cells),
        held_areas=any(a.is_held_back for a in report.areas),
        mask_middle=rules.mask_below / 2,
        second=any(row.is_second for row in timetable.rows),
        is_compared=is_compared,
        why_not_compared=_why_not_compared(report),
        axis=svg.change_axis(limit),
        changes=change_rows(report, limit=limit) if is_compared else (),
        strips=strips,
        strip_blocks=tables.strip_blocks(strips),
        outages=tuple(tables.outage_row(o, names) for o in report.coverage.outages),
        distance=fmt.distance_unbroken(rules.distance_m, rules.distance_unit),
        readings_note=sections.readings_note(report),
        between={a.area_id: a.violation_rate.value for a in report.readings.areas} if report.readings else {},
        cards=cards(report, question=report.story.question),
        unusual=sections.unusual(report),
        contributions=contributions(report),
        causes=sections.causes(report),
        change_effects=sections.change_effects(report),
        trend=weeks,
        outlook=sections.outlook(report),
        waiting=waiting(report.answers),
        crossed=lines_and_doors(report),
        what_else=context(report),
        log=log_rows(report, with_weeks=log_section == "trend"),
        log_section=log_section,
        messages=_messages(report),
        further_figures=further_figures(report),
        asked=asked_lines(report),
        is_at_desk=is_at_desk,
        replies=reply_buttons(report, is_at_desk=is_at_desk) if is_open else (),
        privacy=privacy(report),
    )


def _shown(report: WeekReport, figures: MapFigures, *, log_section: str) -> frozenset[str]:
    always = {"data", "about"}
    always |= {"trend"} if report.trend is not None and report.trend.weeks else set()
    if report.level.violation_rate.state != "not_measurable" and report.outlook is not None and report.outlook.highest:
        always |= {"next"}
    if report.state == "no_data":
        return frozenset(always | ({"changed"} if report.log and log_section == "changed" else set()))
    maps = {"where"} if report.maps else set()
    if (report.spots is not None and report.spots.cards) or (
        (figures.footsteps is not None or figures.flow is not None) and report.week.is_week
    ):
        maps |= {"spots"}
    hours = set() if report.level.violation_rate.state == "not_measurable" else {"when"}
    asked = {"waiting"} if "queues" in report.answers or "capacity" in report.answers else set()
    asked |= {"lines"} if has_lines(report) else set()
    days = report.answers.get("context_days")
    asked |= {"context"} if days is not None and days.rows else set()
    return frozenset({"changed"} | always | hours | maps | asked)


_SHOWN_FROM_ANSWERS: Final = {"M37", "M39", "M41", "M42"}
"""Figures whose sections are made from answers, which files of version 1 do not have."""


def _messages(report: WeekReport) -> str:
    lines = []
    if n := report.coverage.missing_messages:
        n_gaps = report.coverage.message_gaps
        gaps = say("data.gaps", plural=n_gaps, n=fmt.count(n_gaps))
        lines.append(say("data.messages", plural=n, n=fmt.count(n), gaps=gaps))
    lines += [terms.sentence(reason_text(c.moved)) for c in report.coverage.cameras if c.moved is not None]
    if report.figures.keys() & _SHOWN_FROM_ANSWERS and not len(report.answers):
        lines.append(say("data.version_1"))
    return " ".join(lines)


def not_recorded(report: WeekReport) -> str:
    """Return what hatched floor of a map means: no camera sees it, or who does recorded nothing that counts."""
    cameras = terms.joined(terms.camera_name(c.name) for c in report.silent_cameras)
    key = "where.little_recording" if report.is_little_recorded else "where.no_recording"
    return say(key, cameras=cameras) if cameras else say("where.no_camera")


def _down(report: WeekReport) -> list[str]:
    """Return the cameras that missed at least an hour the others may have recorded, most missed first."""
    lost: dict[str, float] = {}
    for outage in report.coverage.outages:
        if len(outage.camera_ids) < len(report.coverage.cameras):
            for camera_id in outage.camera_ids:
                lost[camera_id] = lost.get(camera_id, 0.0) + outage.open_h
    return sorted((c for c, h in lost.items() if h >= 0.5), key=lambda c: (-lost[c], c))[:3]


def _why_not_compared(report: WeekReport) -> str:
    match report.state:
        case _ if report.level.violation_rate.state == "not_measurable":
            return say("changed.why_not_measurable")
        case "first_week":
            return say("changed.why_no_week_before" if report.has_history else "changed.why_first_week")
        case "settings_changed":
            change = report.settings_change
            is_cameras = change is not None and change.name == "cameras"
            return say("changed.why_cameras" if is_cameras else "changed.why_settings")
        case "too_incomplete" if report.is_so_far:
            return say("changed.why_not_over")
        case "too_incomplete":
            return say("changed.why_incomplete", limit=fmt.percent(report.rules.min_coverage))
        case "empty":
            return say("changed.why_empty")
        case _:
            return say("changed.why_no_data")


def _drawn(shown: FloorMap, index: int, report: WeekReport, *, is_ranked: bool) -> DrawnMap:
    spots = shown.spots if is_ranked else ()
    label = say("where.label", title=shown.title, week=report.week.number)
    if spots:
        label += say(
            "where.label_spots",
            spots="; ".join(say("where.label_spot", number=s.number, name=s.name) for s in spots),
        )
    elif not shown.bands:
        label += say("where.label_none")
    if shown.unseen:
        label += say("where.label_unseen")
    if shown.uncertain:
        label += say("where.label_uncertain")
    if report.areas:
        label += say("where.label_table")
    if not is_ranked and shown.spots:
        shown = FloorMap(**{f.name: getattr(shown, f.name) for f in fields(shown)} | {"spots": ()})
    drawing = floor_plan.floor_map(shown, index=index, rules=report.rules, label=label.strip())
    x0, y0, x1, y1 = shown.extent
    return DrawnMap(shown=shown, drawing=drawing, is_wide=x1 - x0 > WIDE * (y1 - y0))


def _style(report: WeekReport, *, paper: str = "a4") -> str:
    """Return the style without comments and indents, with the printed footers of this report."""
    footer = say("page.footer", site=report.site.name, week=report.week.number, year=report.week.year)
    return shipped_style() + shipped_style("ask.css") + printed_footers(footer) + (LETTER if paper == "letter" else "")


def printed_footers(text: str) -> str:
    """Return the style of printed pages: a text at the left of each foot, its number at the right."""
    separator, font = css_string(f" {say('page.of')} "), "font: 8pt Arial, sans-serif; color: #525d68"
    return (
        f"@page {{ @bottom-left {{ content: {css_string(text)}; {font} }} "
        f"@bottom-right {{ content: counter(page) {separator} counter(pages); {font} }} }}"
    )


@cache
def shipped_style(name: str = "report.css") -> str:
    """Return a shipped style without comments and indents."""
    text = (shipped("reports") / "static" / name).read_text(encoding="utf-8")
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    return "".join(f"{line.strip()}\n" for line in text.splitlines() if line.strip())


def css_string(text: str) -> str:
    r"""Return `text` as a CSS string in which every character but ASCII letters, digits and ` ,.-` is escaped.

    Example:
        >>> css_string('a"</style>')
        '"a\\22 \\3c \\2f style\\3e "'
    """
    safe = re.compile(r"[A-Za-z0-9 ,.\-]")
    return '"' + "".join(c if safe.match(c) else f"\\{ord(c):x} " for c in text) + '"'


def rendered(template: str, page: Any) -> str:
    """Return a template filled with the fields of a dataclass."""
    return environment().get_template(template).render({f.name: getattr(page, f.name) for f in fields(page)})


def policy_hash(text: str) -> str:
    """Return the base64 SHA-256 by which a content security policy allows a style or script."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def privacy(report: WeekReport) -> str:
    """Return what is stored about people, until when, and what was deleted."""
    stored, rules = report.stored, report.rules
    key = "pseudonyms" if stored is None or stored.has_pseudonyms else "ids"
    sentences = [
        say(
            "about.privacy_text",
            numbers=say(f"about.privacy_{key}"),
            below=rules.mask_below,
            masked=fmt.masked(rules.mask_below),
        )
    ]
    if stored is not None and stored.first_day is not None:
        sentences.append(say("about.privacy_since", first=fmt.date_long(stored.first_day)))
        n, days = stored.n_overdue_days, rules.retention_days
        if n:
            sentences.append(say("about.privacy_overdue", plural=n, n=n, days=days))
        else:
            sentences.append(say("about.privacy_in_time", on=fmt.date_long(report.generated_at.date()), days=days))
    if stored is not None and stored.purged_before is not None and stored.purged_on is not None:
        before, on = fmt.date_long(stored.purged_before), fmt.date_long(stored.purged_on)
        sentences.append(say("about.privacy_purged", before=before, on=on))
    return " ".join(sentences)
