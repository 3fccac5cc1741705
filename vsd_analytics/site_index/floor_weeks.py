"""The reports of all projects, ordered as the index shows them: by floor, and by week."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import date, timedelta
from typing import Literal, NamedTuple

from vsd_analytics.errors import VsdError, Where
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.site_index.read_reports import Entry, IndexedReport

WEEKS_SHOWN = 10

Standing = Literal["fall", "rise", "same", "none", "not_compared", "incomplete", "no_data", "absent"]
"""What a floor's week amounts to. "none": no violation was recorded; "absent": there is no report of it."""


class FloorKey(NamedTuple):
    """What identifies a floor.

    Attributes:
        project: Name of the project.
        site_id: Site.
        floor_id: Floor.
    """

    project: str
    site_id: str
    floor_id: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FloorWeeks:
    """A floor and its weeks.

    Attributes:
        key: Identifies the floor among all floors.
        site_name: Display name of the site, from its latest report.
        name: Display name of the floor, from its latest report.
        rank: Its place among the floors of its site, as vsd.toml orders them.
        weeks: Reports with figures by Monday, in order.
    """

    key: FloorKey
    site_name: str
    name: str
    rank: int
    weeks: dict[date, Entry]

    @property
    def latest(self) -> date:
        """Return the Monday of its last report."""
        return max(self.weeks)

    @property
    def full_name(self) -> str:
        """Return site and floor."""
        return f"{self.site_name}, {self.name}"

    def report(self, monday: date) -> IndexedReport | None:
        """Return the report of a week, if there is one."""
        entry = self.weeks.get(monday)
        return entry.report if entry is not None else None

    def window(self, monday: date) -> tuple[tuple[date, IndexedReport | None], ...]:
        """Return the ten weeks that end with a week, each with its report if there is one."""
        mondays = (monday - timedelta(weeks=back) for back in reversed(range(WEEKS_SHOWN)))
        return tuple((week, self.report(week)) for week in mondays)


@dataclass(frozen=True, slots=True, kw_only=True)
class Catalogue:
    """Everything the index lists.

    Attributes:
        floors: Floors in the order of projects, then of sites and of their vsd.toml.
        pages: Pages without figures, in order of week.
        problems: JSON files of the same week of the same floor.
    """

    floors: tuple[FloorWeeks, ...]
    pages: tuple[Entry, ...]
    problems: tuple[VsdError, ...] = ()

    @property
    def latest(self) -> date | None:
        """Return the Monday of the last report of all; None when no report has figures."""
        return max((f.latest for f in self.floors), default=None)

    @property
    def earlier(self) -> tuple[date, ...]:
        """Return the Mondays of all other weeks, the last first."""
        mondays = {m for f in self.floors for m in f.weeks} | {p.monday for p in self.pages}
        return tuple(sorted(mondays - {self.latest}, reverse=True))

    def pages_of(self, monday: date) -> tuple[Entry, ...]:
        """Return the pages without figures of a week."""
        return tuple(p for p in self.pages if p.monday == monday)


def catalogue(entries: Iterable[Entry]) -> Catalogue:
    """Return the floors and weeks of all entries.

    Of two JSON files of one week and floor, the later one counts; the other is reported as a problem (W514).
    """
    weeks: dict[FloorKey, dict[date, Entry]] = {}
    pages, problems = [], []
    for entry in entries:
        if entry.report is None:
            pages.append(entry)
            continue
        report = entry.report
        known = weeks.setdefault(FloorKey(entry.project, report.site.site_id, report.site.floor_id), {})
        other = known.get(report.week.monday)
        if other is not None and other.report is not None:
            old, entry = sorted((other, entry), key=_made)  # noqa: PLW2901
            problems.append(_twice(old, entry))
        known[report.week.monday] = entry
    floors = []
    for key, known in weeks.items():
        last = known[max(known)].report
        if last is not None:
            site, order = last.site, last.site.floors
            rank = order.index(key.floor_id) if key.floor_id in order else len(order)
            weeks_in_order = dict(sorted(known.items()))
            floors.append(
                FloorWeeks(key=key, site_name=site.name, name=site.floor_name, rank=rank, weeks=weeks_in_order)
            )
    place = {project: k for k, project in enumerate(dict.fromkeys(f.key.project for f in floors))}
    floors.sort(key=lambda f: (place[f.key.project], f.site_name.casefold(), f.key.site_id, f.rank, f.key))
    return Catalogue(
        floors=tuple(_with_distinct_names(floors)),
        pages=tuple(sorted(pages, key=lambda p: (p.monday, p.project, p.stem))),
        problems=tuple(problems),
    )


def standing(report: IndexedReport | None) -> Standing:
    """Return what a week amounts to, by its state and the verdict on how often."""
    if report is None:
        return "absent"
    match report.state:
        case "no_data":
            return "no_data"
        case "too_incomplete":
            return "not_compared" if report.is_so_far else "incomplete"
        case "settings_changed" | "first_week":
            return "not_compared"
    verdict: Standing | None = verdict_of(report.level.violation_rate)
    if verdict is not None:
        return verdict
    return "none" if report.state == "empty" else "not_compared"


def verdict_of(estimate: Estimate) -> Literal["fall", "rise", "same"] | None:
    """Return the verdict on a change, or None where nothing is compared."""
    if estimate.state != "ok":
        return None
    match estimate.verdict:
        case "clear_fall":
            return "fall"
        case "clear_rise":
            return "rise"
        case "about_same" | "cannot_tell":
            return "same"
        case _:
            return None


def _made(entry: Entry) -> tuple[float, str]:
    return (entry.report.generated_at.timestamp() if entry.report is not None else 0.0, entry.stem)


def _with_distinct_names(floors: list[FloorWeeks]) -> list[FloorWeeks]:
    """Return the floors, with the project or the site's id behind names that several sites have."""
    sites: dict[str, set[tuple[str, str]]] = {}
    for floor in floors:
        sites.setdefault(floor.site_name, set()).add((floor.key.project, floor.key.site_id))
    named = []
    for floor in floors:
        same = sites[floor.site_name]
        if len(same) > 1:
            mark = floor.key.project if len({project for project, _ in same}) == len(same) else floor.key.site_id
            floor = replace(floor, site_name=f"{floor.site_name} ({mark})")  # noqa: PLW2901
        named.append(floor)
    return named


def _twice(old: Entry, new: Entry) -> VsdError:
    return VsdError(
        "two JSON files report the same week of the same floor",
        code="W514",
        where=Where(f"{old.stem}.json"),
        why=f"{new.stem}.json was made later and is the one that is listed",
        fix=f"delete {old.stem}.json and the files beside it",
    )
