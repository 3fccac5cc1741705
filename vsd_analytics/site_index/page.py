"""The index page: one HTML file with one style, no script, no request, equal bytes for equal reports."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from functools import reduce

from markupsafe import Markup

from vsd_analytics.answer import Verdict
from vsd_analytics.figures.week.results import LogLine
from vsd_analytics.report.model.week import Span
from vsd_analytics.report.pages.key_figures import target_words
from vsd_analytics.report.pages.week import policy_hash, printed_footers, rendered, shipped_style
from vsd_analytics.site_index import week_bars
from vsd_analytics.site_index.compare_section import CompareSection, compare_section
from vsd_analytics.site_index.floor_weeks import Catalogue, FloorWeeks, standing, verdict_of
from vsd_analytics.site_index.read_reports import Entry, IndexedReport
from vsd_analytics.site_index.site_comparison import compare_sites, is_whole
from vsd_analytics.site_index.summary import headline, lead, week_line
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import months
from vsd_analytics.wording.reasons import reason_text

LONGEST_NOTE = 110
YEAR = timedelta(weeks=52)
LINKS = ("report", "pdf", "planner", "json")


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """A link to one file.

    Attributes:
        text: What it says.
        address: Relative to the index, quoted.
        name: Whose it is, for those who hear links one by one.
    """

    text: str
    address: str
    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One floor.

    Attributes:
        site: Name of the site.
        floor: Name of the floor.
        link: Its page, if there is one.
        week: The week shown, where it is not the index's.
        rate: Violations per recorded open hour.
        rates: Violations per person-hour and per 100 square metres in view, those that are known.
        bars: Ten weeks.
        verdict: What became of it, in words.
        direction: Class of the verdict: good, bad or same.
        details: The likely range of the change or why there is none; then what was logged, or where and when it is
            busiest.
        recorded: Share of open hours recorded.
        is_low: Too little was recorded to compare.
        links: Files of the week.
        weeks: Figure of each of the ten weeks, in words where there is none.
    """

    site: str
    floor: str
    link: Link | None
    week: str
    rate: str
    rates: tuple[str, ...]
    bars: Markup
    verdict: str
    direction: str
    details: tuple[str, ...]
    recorded: str
    is_low: bool
    links: tuple[Link, ...]
    weeks: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class WeekLine:
    """One earlier week.

    Attributes:
        name: Week 45, with a capital.
        monday: First day.
        span: 2 to 8 November 2026.
        text: What it amounts to.
        logged: What was changed in an area that week, by those who logged it.
        only: Its page, where the index has one floor only.
        sites: Its pages by site, where there are several.
    """

    name: str
    monday: date
    span: str
    text: str
    logged: tuple[str, ...]
    only: Link | None
    sites: tuple[tuple[str, tuple[Link, ...]], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Year:
    """The earlier weeks of one year.

    Attributes:
        number: ISO year.
        weeks: Weeks, the last first.
        is_open: Shown at once; older years unfold.
    """

    number: int
    weeks: tuple[WeekLine, ...]
    is_open: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Index:
    """Everything the template may use.

    Attributes:
        style: The page's only style.
        style_hash: Base64 SHA-256 of `style`, for the content security policy.
        title: Title of the window.
        week: Name of the week; None when no report has figures.
        monday, sunday: Its days.
        span: First and last day in words.
        headline: The sentence over all floors.
        lead: The sentences below it.
        rows: One for each floor.
        compare: Which floors really differ; None with one floor.
        window: Names of the ten weeks: of the table, and in one phrase.
        phrase: Weeks 37 to 46.
        kinds: Kinds of bars that occur, to be explained.
        has_divider: True when a setting changed in some week shown.
        rule: What a violation is, by the settings in force.
        min_coverage: Below this share of open hours recorded a week is too incomplete.
        years: Earlier weeks.
        tag: Whether the data are made up; empty when they are not.
        as_of: When the last report was made, in the zone of its site.
        zone: That zone.
        versions: Versions that made the reports.
    """

    style: Markup
    style_hash: str
    title: str
    week: str | None
    monday: date | None
    sunday: date | None
    span: tuple[str, str]
    headline: str
    lead: tuple[Span, ...]
    rows: tuple[Row, ...]
    compare: CompareSection | None
    window: tuple[str, ...]
    phrase: str
    kinds: frozenset[str]
    has_divider: bool
    rule: str
    min_coverage: str
    years: tuple[Year, ...]
    tag: str
    as_of: datetime | None
    zone: str
    versions: tuple[str, ...]


def render_index(catalogue: Catalogue) -> str:
    """Return the index as a self-contained HTML file.

    Args:
        catalogue: The floors and weeks to list.
    """
    return re.sub(r"\n\s*\n+", "\n", rendered("index/index.html.j2", make_index(catalogue)))


def make_index(catalogue: Catalogue) -> Index:
    """Return what the template shows; see `Index`."""
    latest = catalogue.latest
    reports = [t for f in catalogue.floors for e in f.weeks.values() if (t := e.report) is not None]
    shown = [t for f in catalogue.floors for _, t in f.window(latest or f.latest)]
    newest = max(reports, key=lambda t: (t.generated_at, t.site.site_id, t.site.floor_id, t.week.iso), default=None)
    week = "" if latest is None else _week_name(latest)
    sentence = say("index.without_figures") if latest is None else headline(catalogue.floors, latest)
    footer = say("index.name_week", week=week) if week else say("index.name")
    style = _style(footer)
    window = [latest - timedelta(weeks=k) for k in reversed(range(10))] if latest is not None else []
    n_made_up = sum(t.provenance.is_made_up for t in reports)
    return Index(
        style=Markup(style),
        style_hash=policy_hash(style),
        title=say("index.title", name=footer, headline=sentence) if week else footer,
        week=terms.capital(week) or None,
        monday=latest,
        sunday=latest + timedelta(days=6) if latest is not None else None,
        span=fmt.date_span(latest, latest + timedelta(days=6)) if latest is not None else ("", ""),
        headline=sentence,
        lead=lead(catalogue.floors, latest) if latest is not None else (),
        rows=tuple(_row(f, latest) for f in catalogue.floors) if latest is not None else (),
        compare=compare_section(compare_sites(catalogue.floors, latest)) if latest is not None else None,
        window=tuple(_short_week(m) for m in window),
        phrase=_phrase(window),
        kinds=frozenset(week_bars.bar_kind(t) for t in shown),
        has_divider=any(t is not None and t.state == "settings_changed" for t in shown),
        rule=_rule(shown),
        min_coverage=_distinct(fmt.percent(t.rules.min_coverage) for t in shown if t is not None),
        years=_years(catalogue),
        tag="" if not n_made_up else say("page.made_up") if n_made_up == len(reports) else say("index.partly_made_up"),
        as_of=newest.generated_at if newest is not None else None,
        zone=newest.week.zone if newest is not None else "",
        versions=tuple(sorted({t.provenance.version for t in reports})),
    )


def _row(floor: FloorWeeks, latest: date) -> Row:
    monday = floor.latest
    entry, report = floor.weeks[monday], floor.report(monday)
    if report is None:
        raise AssertionError("a floor is made of reports")
    window = floor.window(latest)
    weeks = tuple(week_bars.said(t) for _, t in window)
    share = report.coverage.share
    violation_rate = report.level.violation_rate
    is_current = monday == latest
    target = None if report.trend is None else report.trend.target_violation_rate
    return Row(
        site=floor.site_name,
        floor=floor.name,
        link=next(iter(_links(entry, floor.full_name, only="report")), None),
        week="" if is_current else say("index.last_report", week=_week_name(monday)),
        rate=week_bars.said(report) if week_bars.bar_kind(report) == "rough" else fmt.number(violation_rate.value),
        rates=tuple(_like_with_like(report)),
        bars=week_bars.bars(
            window,
            target=None if target is None else target.value,
            label=say("index.bars", weeks=_phrase([m for m, _ in window]), said=", ".join(weeks)),
        ),
        verdict=_verdict(report),
        direction=terms.direction(_clear(report)),
        details=tuple(
            d for d in (_why(report), terms.capital(target_words(target)), _year_ago(floor, report), _note(report)) if d
        ),
        recorded=fmt.percent_short(share),
        is_low=report.state in ("no_data", "too_incomplete") and not report.is_so_far,
        links=tuple(_links(entry, say("index.whose", floor=floor.full_name, week=_week_name(monday)))),
        weeks=weeks,
    )


def _like_with_like(report: IndexedReport) -> Iterator[str]:
    """Yield the rate by people and by floor in view, so that a crowded or large floor is not taken for a bad one."""
    encounter_rate, rate, views = report.level.encounter_rate, report.level.violation_rate, report.views
    if encounter_rate.value is not None and encounter_rate.state == "ok":
        yield say("index.per_person_hour", rate=fmt.number(encounter_rate.value))
    if rate.value is not None and rate.state == "ok" and views is not None and views.seen_m2 > 0:
        yield say("index.per_100_m2", rate=fmt.number(100 * rate.value / views.seen_m2))


def _year_ago(floor: FloorWeeks, report: IndexedReport) -> str:
    """Return the rate of the same week a year before, where it was measured at the same distance."""
    before = floor.report(report.week.monday - YEAR)
    if before is None or before.level.violation_rate.state != "ok" or not is_whole(before):
        return ""
    if before.rules.distance_m != report.rules.distance_m:
        return ""
    rate = fmt.number(before.level.violation_rate.value)
    return say("index.year_ago", week=_week_name(before.week.monday), rate=rate)


def _clear(report: IndexedReport) -> Verdict | None:
    return report.level.violation_rate.verdict if standing(report) in ("fall", "rise") else None


def _verdict(report: IndexedReport) -> str:
    violation_rate = report.level.violation_rate
    match standing(report):
        case "no_data":
            return terms.capital(say("index.no_data"))
        case "incomplete":
            return say("index.too_incomplete")
        case "none":
            return terms.capital(say("index.no_violations"))
        case "fall" | "rise":
            return say(
                "index.verdict", verdict=terms.verdict_words(violation_rate), change=fmt.signed(violation_rate.change)
            )
        case "same":
            return terms.verdict_words(violation_rate)
    match report.state:
        case "too_incomplete":  # of an incomplete week that is over, the standing is "incomplete"
            return terms.capital(say("index.not_over"))
        case "first_week":
            return terms.capital(say("index.first_week"))
        case "settings_changed":
            return terms.capital(say("index.setting_changed"))
        case _:
            return say("tiles.not_measurable" if violation_rate.state == "not_measurable" else "words.too_little_data")


def _why(report: IndexedReport) -> str:
    violation_rate = report.level.violation_rate
    if verdict_of(violation_rate) is not None and standing(report) in ("fall", "rise", "same"):
        return fmt.likely_signed(violation_rate)
    match report.state:
        case "no_data":
            return say("index.nothing_received")
        case "too_incomplete" if report.is_so_far:
            return ""
        case "too_incomplete":
            return say("index.below", share=fmt.percent(report.rules.min_coverage))
        case "first_week":
            return say("index.starts_next")
        case "settings_changed" if report.settings_change is not None:
            change = report.settings_change
            return _shortened(say("index.setting", name=change.name, before=change.before, after=change.after))
        case "empty" if report.coverage.seen_h is not None:
            return say("index.people_seen", hours=fmt.hours(report.coverage.seen_h))
        case _:
            return _shortened(reason_text(violation_rate.reason))


def _note(report: IndexedReport) -> str:
    """Return what was logged in the week (not in the one before), else where and when it is busiest."""
    entries = _entries(report)
    if entries:
        about_areas = [e for e in entries if e.area_id is not None]
        return _shortened(say("index.logged", text=(about_areas or entries)[-1].text.strip()))
    spot, hour = report.busiest_spot, report.busiest_hour
    if spot is None:
        return ""
    busiest = _shortened(say("index.busiest", area=spot.name))
    if hour is None:
        return busiest
    return say("index.busiest_at", busiest=busiest, day=fmt.day_short(hour.start.date()), clock=fmt.clock(hour.start))


def _entries(report: IndexedReport) -> list[LogLine]:
    """Return what people logged in the week itself."""
    return [e for e in report.log if e.kind == "logged" and e.text.strip() and e.at.date() >= report.week.monday]


def _logged(catalogue: Catalogue, monday: date) -> Iterator[str]:
    """Yield the last change of an area that was logged on each floor in a week."""
    for floor in catalogue.floors:
        report = floor.report(monday)
        texts = [e.text.strip() for e in _entries(report) if e.area_id is not None] if report is not None else []
        if texts:
            is_one = len(catalogue.floors) == 1
            text = texts[-1] if is_one else say("index.logged_at", floor=floor.full_name, text=texts[-1])
            yield _shortened(say("index.logged", text=text))


def _links(entry: Entry, whose: str, *, only: str | None = None) -> Iterable[Link]:
    for kind in LINKS:
        if kind in entry.links and only in (None, kind):
            yield Link(text=say(f"index.links.{kind}"), address=entry.links[kind], name=whose)


def _years(catalogue: Catalogue) -> tuple[Year, ...]:
    years: dict[int, list[WeekLine]] = {}
    for monday in catalogue.earlier:
        years.setdefault(monday.isocalendar().year, []).append(_week_line(catalogue, monday))
    newest = max(years, default=0)
    return tuple(Year(number=y, weeks=tuple(w), is_open=y == newest) for y, w in sorted(years.items(), reverse=True))


def _week_line(catalogue: Catalogue, monday: date) -> WeekLine:
    sites: dict[str, list[Link]] = {}
    for floor in catalogue.floors:
        address = floor.weeks[monday].links.get("report") if monday in floor.weeks else None
        if address is not None:
            link = Link(text=floor.name, address=address, name=_week_name(monday))
            sites.setdefault(floor.site_name, []).append(link)
    pages = [p for p in catalogue.pages_of(monday) if "report" in p.links]
    for page in pages:
        link = Link(text=page.stem, address=page.links["report"], name=page.project)
        sites.setdefault(say("index.page_without_figures"), []).append(link)
    is_only = len(catalogue.floors) == 1 and not pages
    return WeekLine(
        name=terms.capital(say("words.week", number=monday.isocalendar().week)),
        monday=monday,
        span=_short_span(monday),
        text=week_line(catalogue.floors, monday) or (say("index.only_the_page") if pages else ""),
        logged=tuple(_logged(catalogue, monday)),
        only=next((links[0] for links in sites.values()), None) if is_only else None,
        sites=() if is_only else tuple((site, tuple(links)) for site, links in sites.items()),
    )


def _week_name(monday: date) -> str:
    iso = monday.isocalendar()
    return say("words.week_year", number=iso.week, year=iso.year)


def _short_week(monday: date) -> str:
    return say("index.week_short", number=monday.isocalendar().week)


def _short_span(monday: date) -> str:
    sunday = monday + timedelta(days=6)
    month, last = (months()[day.month - 1][:3] for day in (monday, sunday))
    first = f"{monday.day} {month}" if monday.month != sunday.month else f"{monday.day}"
    return say("index.span", first=first, last=f"{sunday.day} {last}")


def _phrase(window: Sequence[date]) -> str:
    """Return the weeks in one phrase: Weeks 37 to 46; Week 50, 2026 to week 6, 2027."""
    if not window:
        return ""
    first, last = (m.isocalendar() for m in (window[0], window[-1]))
    if first.year == last.year:
        return say("index.weeks", first=first.week, last=last.week)
    return terms.capital(say("index.span", first=_week_name(window[0]), last=_week_name(window[-1])))


def _rule(shown: Iterable[IndexedReport | None]) -> str:
    """Return what a violation is; where sites have different rules, all of them."""
    rules = [t.rules for t in shown if t is not None]
    distances = _distinct(fmt.metres_unbroken(r.distance_m) for r in rules)
    times = _distinct(fmt.seconds(r.episode_min_s) for r in rules)
    return say("index.rule", distance=distances, time=times) if rules else ""


def _distinct(texts: Iterable[str]) -> str:
    """Return different texts in order, joined by "or"."""
    distinct = dict.fromkeys(texts)
    return reduce(lambda first, last: say("index.or", first=first, last=last), distinct) if distinct else ""


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_NOTE else f"{text[: LONGEST_NOTE - 1].rstrip()}\u2026"


def _style(footer: str) -> str:
    """Return the report's style, the index's after it, and the printed footers."""
    return shipped_style("report.css") + shipped_style("index.css") + printed_footers(footer)
