"""Day files: a relation's rows of one day, computed once from the facts around it and read by every later query.

The header of a relation says by which day its rows are stored (`stored_by: local_date`, `site_day` or `utc_day`). The
rows of one day are one file, whose name holds the fingerprint of all their inputs:

```
facts/days/<relation>/site=<site>/date=<YYYY-MM-DD>/00-<fingerprint>.parquet
```

The rows of a mart equal those of a warehouse of that day alone. A fact has a day file only of a UTC day with sealed
hours, which are many small files: its rows are those of the day's 24 UTC hours.
"""

from __future__ import annotations

import contextlib
import os
from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from pathlib import Path

from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.model import Site
from vsd_analytics.store.durable import is_temporary
from vsd_analytics.store.layout import list_parts, unit_folder
from vsd_analytics.warehouse import beside
from vsd_analytics.warehouse.beside import days_folder
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.dimensions import params
from vsd_analytics.warehouse.input_fingerprint import InputHashes, SiteInputs, text_hash
from vsd_analytics.warehouse.sqlfiles import Relation, relations
from vsd_analytics.warehouse.stored_days import Extent
from vsd_analytics.warehouse.week_files import DAYS
from vsd_analytics.warehouse.week_files import FOLDER as WEEKS

AROUND_H = 25
"""Hours of facts loaded on either side of a range: a day for episodes and site days that reach into it, and one hour
more for a site day on which the clocks are put back."""

FOLDER = Path("facts", "days")
NEAR_DAYS = 30
"""A month of days without facts has day files: while a place is closed, every report reads them. See `DayFile`."""
SITE_DAY = "site_day"
_AROUND_DAYS = 2
"""A day file may be computed from facts AROUND_H hours off, counted from a local day that itself is up to 14 hours off
the UTC day of its name: never more than two UTC days away."""
_EPOCH = date(1970, 1, 1)
_OF_AREAS = {"areas", "area_cells"}


@dataclass(frozen=True, slots=True)
class DayFile:
    """The file of one relation and day.

    Attributes:
        path: Its path, whether it exists or not.
        inputs: Hash of each kind of input of its rows; part of the file's metadata.
        is_stored: There are facts at most NEAR_DAYS away. Rows of a day without any follow from the calendar alone:
            those of holidays are stored, but an empty year would fill the disk with files.
    """

    path: Path
    inputs: InputHashes
    is_stored: bool = True


class DayFiles:
    """Paths and input hashes of the day files of a range of local days.

    Args:
        site: The project.
        built: The facts of the range and of AROUND_H hours on either side.
        extents: The local days, in order.
    """

    def __init__(self, site: Site, built: BuildResult, *, extents: Sequence[Extent]) -> None:
        self._site, self._extents = site, extents
        self._folder = days_folder(site)
        self._params, self._times = params(site), SiteInputs(site)
        # The fingerprint of a sealed hour is not enough: a purge by camera changes its facts and not their fingerprint.
        hours = {h: [u.fingerprint, sorted(u.facts.items())] for h, u in built.sealed.hours.items()}
        self._hours: Mapping[int, object] = {**dict(built.fingerprints), **hours}
        self._sealed = frozenset(built.sealed.hours)
        days = {d: [u.fingerprint, sorted(u.facts.items())] for d, u in built.sealed.days.items()}
        self._days: Mapping[int, object] = {**days, **dict(built.day_fingerprints)}
        self._hashes: dict[tuple[int, int], str] = {}
        self._owned: dict[tuple[bool, bool, date], InputHashes] = {}

    def sealed_files(self, relation: Relation, *, first_hour: int, last_hour: int) -> dict[int, DayFile]:
        """Return the day files of a fact by UTC day number: of days with sealed hours that lie whole in a range."""
        days = sorted({h // 24 for h in self._sealed})
        whole = [d for d in days if d * 24 >= first_hour and d * 24 + 23 <= last_hour]
        columns = text_hash(list(relation.columns))  # sealed rows are read with today's columns
        inputs = {d: {"facts": self._facts(d * 24, d * 24 + 23), "sql": columns} for d in whole}
        return {d: self._file(relation, _EPOCH + timedelta(days=d), inputs[d]) for d in whole}

    def files(self, relation: Relation) -> dict[date, DayFile]:
        """Return the day files of a mart by day: local dates, or the site days that touch them."""
        before = timedelta(days=1 if relation.stored_by == SITE_DAY else 0)
        spans = [(e.first_day - before, e.last_day) for e in self._extents]
        days = [first + timedelta(days=i) for first, last in spans for i in range((last - first).days + 1)]
        shared, no_facts = self._shared(relation), text_hash([[], []])
        of_areas = bool({name for r in _marts_of(relation) for name in r.reads} & _OF_AREAS)
        own = {d: self._own(d, of_areas=of_areas, is_site_day=relation.stored_by == SITE_DAY) for d in days}
        known = sorted(d.toordinal() for d, inputs in own.items() if inputs["facts"] != no_facts)
        near = (_is_near(d.toordinal(), known) for d in own)
        every = zip(own.items(), near, strict=True)
        return {d: self._file(relation, d, {**shared, **inputs}, is_stored=is_near) for (d, inputs), is_near in every}

    def _file(self, relation: Relation, day: date, inputs: InputHashes, *, is_stored: bool = True) -> DayFile:
        folder = unit_folder(self._folder, relation.name, self._site.site_id, (day - _EPOCH).days * 24)
        path = folder / f"00-{day_fingerprint(relation.name, day, inputs)}.parquet"
        return DayFile(path, inputs, is_stored)

    def _shared(self, relation: Relation) -> dict[str, str]:
        """Return the input hashes that all days share: queries, settings, and what they read of vsd.toml."""
        marts = _marts_of(relation)
        read = {name for r in marts for name in r.reads}
        used = sorted({p for r in marts for p in r.params})
        found = {
            "sql": text_hash(sorted((r.name, r.sql) for r in marts)),
            "settings": text_hash({p: self._params[p] for p in used}),
        }
        if "cameras" in read:
            found["cameras"] = text_hash([(c.camera_id, c.floor_id, c.hz) for c in self._site.cameras])
        if "owner_cells" in read:
            found["views"] = self._times.owners
        return found

    def _own(self, day: date, *, of_areas: bool, is_site_day: bool) -> InputHashes:
        """Return the input hashes of one day: of the facts around it, of its calendar and, where read, of its areas."""
        key = (of_areas, is_site_day, day)
        if key in self._owned:  # many marts read the same inputs
            return self._owned[key]
        site = self._site
        midnights = [day + timedelta(days=k) for k in (0, 1, 2)]
        edges = [round(datetime(d.year, d.month, d.day, tzinfo=site.zone).timestamp()) for d in midnights]
        opened = None if site.opening is None else site.opening[day.weekday()]
        hours = (edges[0] // 3600 - AROUND_H, (edges[1] - 1) // 3600 + AROUND_H)
        if is_site_day:  # track ids end with it, so no row reads beyond it
            starts_s = site.day_starts_min * 60
            hours = ((edges[0] + starts_s) // 3600 - 1, (edges[1] + starts_s) // 3600 + 1)
        found = {
            "facts": self._facts(*hours),
            "calendar": text_hash([site.timezone, edges, site.day_starts_min, opened, day in site.closed]),
        }
        if of_areas:
            around = (day - timedelta(days=1), day, day + timedelta(days=1))
            areas = [[(a.area_id, a.floor_id, a.polygon) for a in site.areas if a.is_there(d, d)] for d in around]
            found["areas"] = text_hash([areas, FLOOR_CELL_M])
        self._owned[key] = found
        return found

    def _facts(self, first_hour: int, last_hour: int) -> str:
        if (first_hour, last_hour) not in self._hashes:
            hours = [(h, self._hours[h]) for h in range(first_hour, last_hour + 1) if h in self._hours]
            days = range(first_hour // 24, last_hour // 24 + 1)
            known = [(d, self._days[d]) for d in days if d in self._days]
            self._hashes[first_hour, last_hour] = text_hash([hours, known])
        return self._hashes[first_hour, last_hour]


def _is_near(day: int, known: Sequence[int]) -> bool:
    """Return whether one of some days, in order, is at most NEAR_DAYS from a day."""
    after = bisect_left(known, day - NEAR_DAYS)
    return after < len(known) and known[after] <= day + NEAR_DAYS


def day_fingerprint(name: str, day: date, inputs: InputHashes) -> str:
    """Return the fingerprint in the name of a day file: 16 hexadecimal digits."""
    return text_hash([name, day.isoformat(), sorted(inputs.items())])


def relations_stored_by_day() -> list[Relation]:
    """Return the facts and marts that have day files."""
    return [r for r in relations("facts", "marts").values() if r.stored_by]


def superseded(files: Iterable[DayFile]) -> list[Path]:
    """Return the other files in the folders of some day files: older fingerprints, and temporary files.

    Listing the folders also finds those whose writer was killed between writing the new file and removing the old.
    """
    wanted: dict[Path, set[str]] = defaultdict(set)
    for file in files:
        wanted[file.path.parent].add(file.path.name)
    found: list[Path] = []
    for folder, own in sorted(wanted.items()):
        with contextlib.suppress(FileNotFoundError):
            others = [folder / name for name in os.listdir(folder) if name not in own]
            found += [p for p in others if p.suffix == ".parquet" or is_temporary(p)]
    return found


def superseded_anywhere(site: Site, built: BuildResult) -> list[Path]:
    """Return the superseded files of all days that have several files, and those of marts no longer stored by day.

    Args:
        site: The project.
        built: The facts of everything stored.
    """
    several: list[tuple[Relation, list[int]]] = []
    for relation in relations_stored_by_day():
        n_files = Counter(p.hour // 24 for p in list_parts(days_folder(site), relation.name, site.site_id))
        if days := sorted(d for d, n in n_files.items() if n > 1):
            several.append((relation, days))
    dates = [_EPOCH + timedelta(days=d) for d in sorted({d for _, days in several for d in days})]
    of_days = DayFiles(site, built, extents=[Extent(d, d) for d in dates])
    found = no_longer_stored(site)
    for relation, days in several:
        hours = {"first_hour": days[0] * 24, "last_hour": days[-1] * 24 + 23}
        files = of_days.sealed_files(relation, **hours) if relation.layer == "facts" else of_days.files(relation)
        found += superseded(files.values())
    return found


def no_longer_stored(site: Site) -> list[Path]:
    """Return the files of facts, days and weeks of relations that an older version stored and this one does not."""
    facts, by_day = relations("facts"), {r.name for r in relations_stored_by_day()}
    stored: dict[Path, Collection[str]] = {}
    for root in (site.root / "facts", *beside.folders(site)):
        stored |= {root: facts, root / FOLDER.name: by_day, root / WEEKS: {*facts, *by_day}}
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

    Hourly facts are those of the days of these hours: their files hold whole days.
    """
    own = {h // 24 for h in hours}
    near = {d + k for d in own for k in range(-_AROUND_DAYS, _AROUND_DAYS + 1)}
    if not near:
        return []
    within = {"first_hour": min(near) * 24, "last_hour": max(near) * 24 + 23}
    found: list[Path] = []
    for root in (site.root / "facts", *beside.folders(site)):
        for name in _ever_stored():
            parts = list_parts(root, name, site.site_id, **within)
            found += [p.path for p in parts if p.hour // 24 in own]
        for name in _ever_stored():
            parts = list_parts(root / FOLDER.name, name, site.site_id, **within)
            found += [p.path for p in parts if p.hour // 24 in near]
        within["first_hour"] -= (DAYS - 1) * 24
        for name in _ever_stored():
            weeks = list_parts(root / WEEKS, name, site.site_id, **within)
            found += [p.path for p in weeks if near & set(range(p.hour // 24, p.hour // 24 + DAYS))]
    return found


def _marts_of(relation: Relation) -> list[Relation]:
    """Return a mart and all marts it reads, directly or through others.

    Facts are left out: the fingerprints of hours cover their SQL.
    """
    known = relations("marts")
    found: dict[str, Relation] = {}
    queue = [relation.name]
    while queue:
        name = queue.pop()
        if name in known and name not in found:
            found[name] = known[name]
            queue += known[name].reads
    return list(found.values())
