"""Files of computed rows beside those of facts: which a range has, and the hashes of their inputs.

The header of a relation says by which day its rows are stored. Rows of a mart (`stored_by: local_date` or `site_day`)
are computed once from the facts around each day, and are one file for each week (`week_files`). They equal those of a
warehouse of that day alone.

A fact (`stored_by: utc_day`) has day files only of UTC days whose hours an older version sealed each alone, which are
many small files:

```
facts/days/<fact>/site=<site>/date=<YYYY-MM-DD>/00-<fingerprint>.parquet
```

Their rows are those of the day's 24 UTC hours.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from pathlib import Path

from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.model import Site
from vsd_analytics.store.layout import list_parts, unit_folder
from vsd_analytics.store.seals import UnitSeal
from vsd_analytics.warehouse import settings_variants
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.dimensions import params
from vsd_analytics.warehouse.fact_weeks import FactWeeks, fingerprints
from vsd_analytics.warehouse.input_fingerprint import InputHashes, SiteInputs, text_hash
from vsd_analytics.warehouse.sqlfiles import Relation, reached, relations
from vsd_analytics.warehouse.stored_days import Extent
from vsd_analytics.warehouse.week_files import DAYS, WeekFile, week_file
from vsd_analytics.warehouse.week_files import FOLDER as WEEKS

AROUND_H = 25
"""Hours of facts loaded on either side of a range: a day for episodes and site days that reach into it, and one hour
more for a site day on which the clocks are put back."""

FOLDER = Path("facts", "days")
NEAR_DAYS = 30
"""A month of days without facts has files: while a place is closed, every report reads them. Rows of a day far from any
facts follow from the calendar alone: those of holidays are stored, but an empty year would fill the disk with files."""
SITE_DAY = "site_day"
_AROUND_DAYS = 2
"""Rows of a day may be computed from facts AROUND_H hours off, counted from a local day that itself is up to 14 hours
off the UTC day of its name: never more than two UTC days away."""
_EPOCH = date(1970, 1, 1)
_OF_AREAS = {"areas", "area_cells", "area_tracks"}


@dataclass(frozen=True, slots=True)
class DayFile:
    """The file of one fact and UTC day with hours that were sealed each alone.

    Attributes:
        path: Its path, whether it exists or not.
        inputs: Hash of each kind of input of its rows; part of the file's metadata.
    """

    path: Path
    inputs: InputHashes


class DayFiles:
    """Paths and input hashes of the files of a range of local days.

    Args:
        site: The project.
        built: The facts of the range and of AROUND_H hours on either side.
        extents: The local days, in order.
    """

    def __init__(self, site: Site, built: BuildResult, *, extents: Sequence[Extent]) -> None:
        self._site, self._extents = site, extents
        self._roots, self._root = settings_variants.roots(site), settings_variants.root_of_marts(site)
        self._params, self._times = params(site), SiteInputs(site)
        hours = {h: _inputs_of_sealed(u) for h, u in built.sealed.hours.items()}
        self._hours: Mapping[int, object] = {**dict(built.fingerprints), **hours}
        self._alone = Counter(h // 24 for h, u in built.sealed.hours.items() if not u.is_in_day)
        days = {d: _inputs_of_sealed(u) for d, u in built.sealed.days.items()}
        self._days: Mapping[int, object] = {**days, **dict(built.day_fingerprints)}
        self._known_days = sorted({*(h // 24 for h in self._hours), *self._days})
        self._hashes: dict[tuple[int, int], str] = {}
        self._owned: dict[tuple[bool, bool, date], InputHashes] = {}

    def sealed_files(self, relation: Relation, *, first_hour: int, last_hour: int) -> dict[int, DayFile]:
        """Return the day files of a fact by UTC day number: of days that lie whole in a range.

        Only days of which several hours were sealed each alone have one. This version does so with the first hour of a
        day whose records stay, and one small file more is no reason to store the day again.
        """
        days = sorted(day for day, n_hours in self._alone.items() if n_hours > 1)
        whole = [d for d in days if d * 24 >= first_hour and d * 24 + 23 <= last_hour]
        columns = text_hash(list(relation.columns))  # sealed rows are read with today's columns
        inputs = {d: {"facts": self._facts(d * 24, d * 24 + 23), "sql": columns} for d in whole}
        return {d: self._file(relation, d, inputs[d]) for d in whole}

    def weeks(self, relation: Relation) -> list[WeekFile]:
        """Return the week files of a mart, in order, with the days of the range: local dates, or site days.

        A week that is cut by an end of the range is stored too where no facts lie beyond that end.
        """
        shared = self._shared(relation)
        of_areas = bool({name for r in _marts_of(relation) for name in r.reads} & _OF_AREAS)
        is_site_day = relation.stored_by == SITE_DAY
        weeks = []
        for monday, first, last in (week for e in self._extents for week in _weeks_of(e)):
            begin = first - timedelta(days=1) if is_site_day else first
            days = [begin + timedelta(days=k) for k in range((last - begin).days + 1)]
            own = {d: self._own(d, of_areas=of_areas, is_site_day=is_site_day) for d in days}
            inputs = {d: {**shared, **of_day} for d, of_day in own.items()}
            is_stored = self._is_stored(monday, first, last)
            weeks.append(week_file(self._root, relation.name, self._site.site_id, monday, inputs, is_stored=is_stored))
        return weeks

    def _is_stored(self, monday: date, first: date, last: date) -> bool:
        """Return whether the file of a week with local days from `first` to `last` is written; see `weeks`."""
        day = bisect_left(self._known_days, (first - _EPOCH).days - NEAR_DAYS)
        if day == len(self._known_days) or self._known_days[day] > (last - _EPOCH).days + NEAR_DAYS:
            return False
        zone = self._site.zone
        if first != monday:
            first_s = datetime(first.year, first.month, first.day, tzinfo=zone).timestamp()
            if any(h * 3600 < first_s for h in self._hours):
                return False
        after = last + timedelta(days=1)
        if (after - monday).days < DAYS:
            after_s = datetime(after.year, after.month, after.day, tzinfo=zone).timestamp()
            return not any(h * 3600 >= after_s for h in self._hours)
        return True

    def _file(self, relation: Relation, day: int, inputs: InputHashes) -> DayFile:
        root = self._roots[relation.name] / FOLDER.name
        name = f"00-{day_fingerprint(relation.name, _EPOCH + timedelta(days=day), inputs)}.parquet"
        return DayFile(unit_folder(root, relation.name, self._site.site_id, day * 24) / name, inputs)

    def _shared(self, relation: Relation) -> dict[str, str]:
        """Return the input hashes that all days share: queries, settings, and what they read of vsd.toml."""
        marts = _marts_of(relation)
        read = {name for r in marts for name in r.reads}
        used = sorted({p for r in marts for p in r.params})
        hashes = {
            "sql": text_hash(sorted((r.name, r.sql) for r in marts)),
            "settings": text_hash({p: self._params[p] for p in used}),
        }
        if "cameras" in read:
            hashes["cameras"] = text_hash(
                [(c.camera_id, c.floor_id, c.hz, c.first_day, c.end_day) for c in self._site.cameras]
            )
        if "owner_cells" in read:
            hashes["views"] = self._times.owners
        return hashes

    def _own(self, day: date, *, of_areas: bool, is_site_day: bool) -> InputHashes:
        """Return the input hashes of one day: of the facts around it, of its calendar and, where read, of its areas."""
        key = (of_areas, is_site_day, day)
        if key in self._owned:  # many marts read the same inputs
            return self._owned[key]
        site = self._site
        midnights = [day + timedelta(days=k) for k in (0, 1, 2)]
        edges = [round(datetime(d.year, d.month, d.day, tzinfo=site.zone).timestamp()) for d in midnights]
        opening = site.hours.on(day)
        opened = None if opening is None else opening[day.weekday()]
        hours = (edges[0] // 3600 - AROUND_H, (edges[1] - 1) // 3600 + AROUND_H)
        if is_site_day:  # track ids end with it, so no row reads beyond it
            starts_s = site.day_starts_min * 60
            hours = ((edges[0] + starts_s) // 3600 - 1, (edges[1] + starts_s) // 3600 + 1)
        hashes = {
            "facts": self._facts(*hours),
            "calendar": text_hash([site.timezone, edges, site.day_starts_min, opened, day in site.closed]),
        }
        if of_areas:
            around = (day - timedelta(days=1), day, day + timedelta(days=1))
            areas = [[(a.area_id, a.floor_id, a.polygon) for a in site.areas if a.is_there(d, d)] for d in around]
            hashes["areas"] = text_hash([areas, FLOOR_CELL_M])
        self._owned[key] = hashes
        return hashes

    def _facts(self, first_hour: int, last_hour: int) -> str:
        if (first_hour, last_hour) not in self._hashes:
            hours = [(h, self._hours[h]) for h in range(first_hour, last_hour + 1) if h in self._hours]
            days = range(first_hour // 24, last_hour // 24 + 1)
            known = [(d, self._days[d]) for d in days if d in self._days]
            self._hashes[first_hour, last_hour] = text_hash([hours, known])
        return self._hashes[first_hour, last_hour]


def _inputs_of_sealed(unit: UnitSeal) -> object:
    """Return what identifies the facts of a sealed hour or day: their fingerprint from before, while they are the same.

    So a purge by age makes no mart stale. A purge by camera changes facts, and not their fingerprint.
    """
    return unit.fingerprint if unit.is_as_built else [unit.fingerprint, sorted(unit.facts.items())]


def _weeks_of(extent: Extent) -> Iterator[tuple[date, date, date]]:
    """Yield the Monday and the first and last day of each week that touches a run of days."""
    monday = extent.first_day - timedelta(days=extent.first_day.weekday())
    while monday <= extent.last_day:
        yield monday, max(extent.first_day, monday), min(extent.last_day, monday + timedelta(days=DAYS - 1))
        monday += timedelta(days=DAYS)


def day_fingerprint(name: str, day: date, inputs: InputHashes) -> str:
    """Return the fingerprint in the name of a day file: 16 hexadecimal digits."""
    return text_hash([name, day.isoformat(), sorted(inputs.items())])


def relations_stored_by_day() -> list[Relation]:
    """Return the facts and marts that have files of computed rows."""
    return [r for r in relations("facts", "marts").values() if r.stored_by]


def superseded_anywhere(site: Site, fresh: Collection[Path]) -> list[Path]:
    """Return all but the newest of the files of each day and week, `fresh` apart, and those of marts no longer stored.

    There are several where a reader held the older one when the newer one was written, or was killed.
    """
    roots = [site.root / "facts", *settings_variants.folders(site)]
    folders = [(root / folder, name) for root in roots for folder in (FOLDER.name, WEEKS) for name in _ever_stored()]
    paths = [part.path for folder, name in folders for part in list_parts(folder, name, site.site_id)]
    newest = {path.parent: path for path in sorted(paths, key=lambda p: (_written_ns(p), p.name))}
    return [*no_longer_stored(site), *(path for path in paths if path not in fresh and newest[path.parent] != path)]


def _written_ns(path: Path) -> int:
    """Return when a file was written; 0 for one that somebody else has removed since its folder was listed."""
    try:
        return path.stat().st_mtime_ns
    except FileNotFoundError:
        return 0


def no_longer_stored(site: Site) -> list[Path]:
    """Return the files of facts, days and weeks of relations that an older version stored and this one does not."""
    facts = relations("facts")
    of_sealed = {r.name for r in relations_stored_by_day() if r.layer == "facts"}
    by_week = {*facts, *(r.name for r in relations_stored_by_day())}
    stored: dict[Path, Collection[str]] = {}
    for root in (site.root / "facts", *settings_variants.folders(site)):
        stored |= {root: facts, root / FOLDER.name: of_sealed, root / WEEKS: by_week}
    return [
        p.path
        for root, names in stored.items()
        for name in _ever_stored()
        if name not in names
        for p in list_parts(root, name, site.site_id)
    ]


def _ever_stored() -> Iterable[str]:
    """Return the relations of which this version or an older one may have stored files."""
    return relations("staging", "facts", "marts")


def facts_around(site: Site, hours: Collection[int]) -> list[Path]:
    """Return all files of facts, days and weeks, of all settings, whose rows may come from records of some UTC hours.

    Facts are those of the days of these hours: their files hold whole days, or whole weeks (`spare_other_days`).
    """
    own = {h // 24 for h in hours}
    near = {d + k for d in own for k in range(-_AROUND_DAYS, _AROUND_DAYS + 1)}
    if not near:
        return []
    within, facts = {"first_hour": min(near) * 24, "last_hour": max(near) * 24 + 23}, relations("facts")
    files: list[Path] = []
    for root in (site.root / "facts", *settings_variants.folders(site)):
        for name in _ever_stored():
            parts = list_parts(root, name, site.site_id, **within)
            files += [p.path for p in parts if p.hour // 24 in own]
        for name in _ever_stored():
            parts = list_parts(root / FOLDER.name, name, site.site_id, **within)
            files += [p.path for p in parts if p.hour // 24 in near]
        within["first_hour"] -= (DAYS - 1) * 24
        for name in _ever_stored():
            weeks, reached = list_parts(root / WEEKS, name, site.site_id, **within), own if name in facts else near
            files += [p.path for p in weeks if reached & set(range(p.hour // 24, p.hour // 24 + DAYS))]
    return files


def spare_other_days(site: Site, hours: Collection[int]) -> None:
    """Write the other days of the weeks of facts that lie in `facts_around` some hours as files of their own."""
    own = {h // 24 for h in hours}
    for root in (site.root / "facts", *settings_variants.folders(site)) if own else ():
        for name in relations("facts"):
            weeks = FactWeeks(root, name, site.site_id)
            for week in weeks.files(min(own), max(own)):
                days = fingerprints(week.path).keys()
                if own & days:
                    weeks.write_days(week.path, days - own)


def _marts_of(relation: Relation) -> list[Relation]:
    """Return a mart and all marts it reads, directly or through others.

    Facts are left out: the fingerprints of hours cover their SQL.
    """
    return [r for r in reached([relation.name], lambda r: r.layer == "marts") if r.layer == "marts"]
