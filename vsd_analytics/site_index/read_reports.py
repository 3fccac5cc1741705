"""Reads the JSON files in a folder of reports, and names every file that cannot be listed.

A JSON file is not trusted before these checks: it is small enough, a plain file, of our schema, and about the week and
floor of its name. Links are made from the names of existing files, never from the content of a JSON file.
"""

from __future__ import annotations

import math
import re
import stat
from dataclasses import dataclass, fields
from datetime import date, datetime
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

import msgspec

from vsd_analytics.errors import CONTROL, VsdError, Where
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import Target
from vsd_analytics.figures.week.results import (
    BusiestHour,
    BusiestSpot,
    CloseByCrowding,
    LogLine,
    Provenance,
    Rules,
    SettingsChange,
    SiteRef,
    WeekRef,
    WeekState,
)
from vsd_analytics.report.model.older_files import FAMILY, VERSION, brought_up_to_date
from vsd_analytics.report.model.week import SCHEMA, Span
from vsd_analytics.wording.reasons import decode_reason

MAX_BYTES: Final = 20_000_000
"""The JSON file of a report has a few hundred kilobytes. A far larger file is something else and is not read into
memory."""
KINDS: Final = {".html": "report", ".pdf": "pdf", ".json": "json"}
STEM: Final = re.compile(r"(?P<iso>\d{4}-W\d{2})(?:-(?P<floor>[a-z0-9][a-z0-9_-]{0,62}))?")
"""Names of reports: 2026-W46, or 2026-W46-ground where a site has several floors."""
OF_DAYS: Final = re.compile(r"\d{4}-\d{2}-\d{2}")
"""How the files of other days than a week begin (`vsd report --range`); the index lists weeks."""
OPERATORS: Final = b'<meta name="audience" content="operator">'
"""In the head of each page that hides no small counts."""
HEAD_BYTES: Final = 4096
PLANNER: Final = re.compile(rf"{STEM.pattern}-planner")
_YEARS: Final = range(1900, 2200)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedCamera:
    """The part of a camera in `coverage` that the index needs; same names."""

    share: float | None = None
    scheduled_h: float = 0.0
    recorded_h: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """The part of `coverage` in the JSON file that the index shows; same names."""

    share: float
    seen_h: float | None = None
    cameras: tuple[RecordedCamera, ...] = ()
    not_over_from: datetime | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """The part of `level` in the JSON file that the index shows; same names."""

    violation_rate: Estimate
    encounter_rate: Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class IndexedStory:
    """The part of `story` in the JSON file that the index shows; same names."""

    headline: str
    lead: tuple[Span, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class IndexedTrend:
    """What the index needs of the weeks of a report."""

    target_violation_rate: Target | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class IndexedViews:
    """The part of `views` that the index needs; same names."""

    floor_m2: float = 0.0
    unseen_m2: float = 0.0

    @property
    def seen_m2(self) -> float:
        """Return the size of the floor that cameras see, without fixtures."""
        return self.floor_m2 - self.unseen_m2


@dataclass(frozen=True, slots=True, kw_only=True)
class IndexedReport:
    """What the index needs of a `report.model.WeekReport`; same names, units and meanings.

    Other parts of the file may be there or not: later versions only add to the schema.
    """

    schema: str
    site: SiteRef
    week: WeekRef
    generated_at: datetime
    provenance: Provenance
    rules: Rules
    state: WeekState
    coverage: Recorded
    level: Levels
    story: IndexedStory
    busiest_spot: BusiestSpot | None = None
    busiest_hour: BusiestHour | None = None
    log: tuple[LogLine, ...] = ()
    settings_change: SettingsChange | None = None
    close_by_crowding: CloseByCrowding | None = None
    trend: IndexedTrend | None = None
    views: IndexedViews | None = None

    @property
    def is_so_far(self) -> bool:
        """Tell whether nothing is compared only because the week was not over; see `WeekReport.is_so_far`."""
        is_recorded = self.coverage.share >= self.rules.min_coverage
        return self.state == "too_incomplete" and self.coverage.not_over_from is not None and is_recorded


@dataclass(frozen=True, slots=True, kw_only=True)
class _Audience:
    """The part of a JSON file that says from which count on it hides nothing."""

    rules: Rules


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One week of one floor that can be listed.

    Attributes:
        project: Name of the project it is of.
        stem: Name of its files without the ending.
        report: Its figures; None for a page without a JSON file.
        links: Address, relative to the index, by kind: report, pdf, json, planner.
    """

    project: str
    stem: str
    report: IndexedReport | None
    links: dict[str, str]

    @property
    def monday(self) -> date:
        """Return the first day of its week, from its name."""
        return monday_of(self.stem)


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundReports:
    """What a folder of reports holds.

    Attributes:
        entries: Weeks, in the order of their names.
        problems: What could not be listed, or only in part, as warnings with what, where, why and fix.
    """

    entries: tuple[Entry, ...] = ()
    problems: tuple[VsdError, ...] = ()


def find_reports(folder: Path, *, project: str, prefix: str = "", hides: bool = True) -> FoundReports:
    """Return the weeks in a folder of reports.

    Args:
        folder: Folder with `2026-W46.json` and its pages; one that does not exist holds nothing.
        project: Name of the project, to distinguish sites of one name.
        prefix: Address of `folder` relative to the index, ending in "/" unless empty.
        hides: Small counts are hidden from readers, so pages for the operator are left out.
    """
    names, problems = shared_names(folder, hides=hides)
    reports: dict[str, IndexedReport] = {}
    for name in (n for n in names if n.endswith(".json") and not OF_DAYS.match(n)):
        try:
            reports[name.removesuffix(".json")] = read_report_json(folder / name)
        except VsdError as problem:
            problems.append(problem)
    stems = sorted({Path(n).stem for n in names if kind_of(n) in ("report", "json")} | reports.keys())
    entries = []
    for stem in stems:
        if stem not in reports and f"{stem}.html" not in names:
            continue  # a JSON file that could not be read, without a page: reported above
        links = {kind: prefix + quote(f"{stem}{end}") for end, kind in KINDS.items() if f"{stem}{end}" in names}
        if f"{stem}-planner.html" in names:
            links["planner"] = prefix + quote(f"{stem}-planner.html")
        if stem not in reports:
            links.pop("json", None)
            if f"{stem}.json" not in names:
                problems.append(_without_figures(folder / f"{stem}.html"))
        entries.append(Entry(project=project, stem=stem, report=reports.get(stem), links=links))
    return FoundReports(entries=tuple(entries), problems=tuple(problems))


def files_in(folder: Path) -> list[str]:
    """Return the names of the plain files in a folder, in order; no links, pipes or devices, and no hidden ones."""
    if not folder.is_dir():
        return []
    return sorted(p.name for p in folder.iterdir() if not p.name.startswith(".") and stat.S_ISREG(p.lstat().st_mode))


def monday_of(stem: str) -> date:
    """Return the Monday of the week a report's name begins with.

    Raises:
        ValueError: There is no such week.
    """
    monday = date.fromisocalendar(int(stem[:4]), int(stem[6:8]), 1)
    if monday.year not in _YEARS:
        raise ValueError(f"{monday} lies outside {_YEARS.start} to {_YEARS.stop - 1}")
    return monday


def shared_names(folder: Path, *, hides: bool) -> tuple[list[str], list[VsdError]]:
    """Return the files in a folder of reports without those for the operator, and a warning for each of these.

    A page says whom it is for, a JSON file from which count on it hides nothing. Where a week's page or JSON file is
    the operator's, so may be all files of its name: a PDF does not say.

    Args:
        folder: The folder.
        hides: False where `mask_below` of vsd.toml is 0 or 1: whoever wrote it shows everything to readers.
    """
    names = files_in(folder)
    if not hides:
        return names, []
    operators = {name for name in names if kind_of(name) is not None and _is_operators(folder / name)}
    stems = {name.rpartition(".")[0] for name in operators}
    problems = [_for_operator(folder / name) for name in sorted(operators)]
    return [name for name in names if name.rpartition(".")[0] not in stems], problems


def _is_operators(path: Path) -> bool:
    if path.suffix == ".html":
        with path.open("rb") as page:
            return OPERATORS in page.read(HEAD_BYTES)
    if path.suffix != ".json" or path.lstat().st_size > MAX_BYTES:
        return False
    try:
        rules = msgspec.json.decode(path.read_bytes(), type=_Audience).rules
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError):
        return False  # named where it is read
    return not Mask(rules.mask_below).is_on


def _for_operator(path: Path) -> VsdError:
    return VsdError(
        "a page for the operator is among the reports and is not listed",
        code="W516",
        where=Where(str(path)),
        why="it was made with --exact or mask_below = 0, or is one of alarms: small counts are not hidden in it",
        fix=f"move it to another folder; vsd report --week {path.name[:8]} --format html,json makes that for readers",
    )


def kind_of(name: str) -> str | None:
    """Return the kind of a week's file from its name: report, pdf, json, planner, or None for any other file.

    Example:
        >>> kind_of("2026-W46.html"), kind_of("2026-W46-ground.json"), kind_of("2026-W46-planner.html")
        ('report', 'json', 'planner')
    """
    stem, _, end = name.rpartition(".")
    if end == "html" and PLANNER.fullmatch(stem):
        return "planner"
    return KINDS.get(f".{end}") if _is_report(stem) else None


def _is_report(stem: str) -> bool:
    try:
        return STEM.fullmatch(stem) is not None and bool(monday_of(stem))
    except ValueError:
        return False


def read_report_json(path: Path) -> IndexedReport:
    """Return the parts of a report's JSON file that the index shows.

    Raises:
        VsdError: W510, it is damaged; W511, it is something else; W512, a newer version wrote it. Warnings: the others
            can still be listed.
    """
    if path.lstat().st_size > MAX_BYTES:
        raise _foreign(path, why=f"it is larger than {MAX_BYTES // 1_000_000} MB; a report has a fraction of that")
    data = path.read_bytes()
    try:
        head = msgspec.json.decode(data)
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise _damaged(path, why=f"it is no whole JSON text: {_said(error)}") from None
    _check_schema(head.get("schema") if isinstance(head, dict) else None, path)
    try:
        needed = {f.name: head[f.name] for f in fields(IndexedReport) if f.name in head}
        report = msgspec.convert(brought_up_to_date(_cleaned(needed)), IndexedReport, dec_hook=decode_reason)
        is_week = _is_week(report.week)
    except (msgspec.ValidationError, RecursionError, ValueError, OverflowError) as error:
        raise _damaged(path, why=_said(error)) from None
    if report.generated_at.tzinfo is None:
        raise _damaged(path, why="its instants have no offset")
    if not is_week:
        raise _damaged(path, why="its week, its Monday and its Sunday do not fit together")
    if report.close_by_crowding is not None and not _fits_together(report.close_by_crowding):
        raise _damaged(path, why="its time too close by crowding does not fit together")
    name = STEM.fullmatch(path.name.removesuffix(".json"))
    if name is None or name["iso"] != report.week.iso or name["floor"] not in (None, report.site.floor_id):
        raise _foreign(path, why="its name and the week and floor in it differ, so that it may be of another page")
    return report


def _check_schema(schema: Any, path: Path) -> None:
    match = re.fullmatch(rf"{re.escape(FAMILY)}/(\d{{1,6}})", schema) if isinstance(schema, str) else None
    if match is None:
        raise _foreign(path, why=f"it does not say that it is of {FAMILY}")
    if int(match[1]) > VERSION:
        raise VsdError(
            "a JSON file was written by a newer version and is not listed",
            code="W512",
            where=Where(str(path)),
            why=f"it is {match[0]}; this version reads up to {SCHEMA}",
            fix="pip install --upgrade vsd-analytics",
        )
    if match[0] not in {f"{FAMILY}/{version}" for version in range(1, VERSION + 1)}:
        raise _foreign(path, why=f"it is {match[0]}, which never was")


def _is_week(week: WeekRef) -> bool:
    iso = week.monday.isocalendar()
    return (
        iso.weekday == 1
        and iso.year in _YEARS
        and (week.year, week.number) == (iso.year, iso.week)
        and week.iso == f"{iso.year}-W{iso.week:02d}"
        and week.sunday == date.fromordinal(week.monday.toordinal() + 6)
    )


def _fits_together(crowding: CloseByCrowding) -> bool:
    """Tell whether each day has person-time in every class, classes are classes, and no time is below zero."""
    n_classes = len(crowding.edges) + 1
    times = [t for d in crowding.days for t in (d.close_h, *d.person_h)] + [c.close_h for c in crowding.classes]
    return (
        all(len(d.person_h) == n_classes for d in crowding.days)
        and all(0 <= c.first <= c.last < n_classes for c in crowding.classes)
        and all(math.isfinite(t) and t >= 0 for t in times)
    )


def _cleaned(value: Any) -> Any:
    """Return plain values without control characters and overrides of the direction of writing in any text."""
    if isinstance(value, str):
        return CONTROL.sub("\ufffd", value)
    if isinstance(value, dict):
        return {key: _cleaned(inner) for key, inner in value.items()}
    return [_cleaned(inner) for inner in value] if isinstance(value, list) else value


def _said(error: BaseException) -> str:
    return "it is nested too deeply" if isinstance(error, RecursionError) else str(error)


def _damaged(path: Path, *, why: str) -> VsdError:
    return VsdError(
        "the JSON file of a report is damaged and is not listed",
        code="W510",
        where=Where(str(path)),
        why=why,
        fix=f"vsd report --week {path.name[:8]} --format html,json" if STEM.fullmatch(path.stem) else "delete it",
    )


def _foreign(path: Path, *, why: str) -> VsdError:
    return VsdError(
        "a JSON file among the reports is not that of a weekly report and is not listed",
        code="W511",
        where=Where(str(path)),
        why=why,
        fix="move it to another folder",
    )


def _without_figures(page: Path) -> VsdError:
    return VsdError(
        "a page has no JSON file, so it is listed without its figures",
        code="W513",
        where=Where(str(page)),
        why=f"{page.stem}.json is missing, and the records of today would give another page or none",
        fix=f"vsd report --week {page.stem[:8]} --format html,json",
    )
