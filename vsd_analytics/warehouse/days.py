"""Days kept: relations whose rows of a day are computed once, from the facts around it, and read from then on.

A relation says in its header by which day its rows are kept (`kept: local_date`, `site_day` or `utc_day`). Its rows of
one day stand in one file, named by the fingerprint of all they depend on:

```
facts/days/<relation>/site=<site>/date=<YYYY-MM-DD>/00-<fingerprint>.parquet
```

Rows of a mart are those of a warehouse of that day alone, rows of a fact those of the hours of that UTC day.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from pathlib import Path

from vsd_analytics.site import Site
from vsd_analytics.store.layout import list_parts, unit_folder
from vsd_analytics.warehouse.build import BuildResult
from vsd_analytics.warehouse.causes import Causes, SiteTimes, text_hash
from vsd_analytics.warehouse.dimensions import params
from vsd_analytics.warehouse.sqlfiles import Relation, relations

AROUND_H = 25
"""Hours of facts loaded on either side of a range, so that episodes and the site days that touch it are whole."""

FOLDER = Path("facts", "days")
SITE_DAY = "site_day"
_AROUND_DAYS = 2
_EPOCH = date(1970, 1, 1)
_OF_AREAS = {"areas", "area_cells"}


@dataclass(frozen=True, slots=True)
class DayFile:
    """The file of one relation and day.

    Attributes:
        path: Where it stands, or would.
        causes: Hashes of what its rows depend on; noted in it.
    """

    path: Path
    causes: Causes


class Days:
    """The day files of a range of local days.

    Args:
        site: The project.
        built: Its facts of the range and AROUND_H hours on either side.
        first: First local day.
        last: Last local day, inclusive.
    """

    def __init__(self, site: Site, built: BuildResult, *, first: date, last: date) -> None:
        self._site, self._first, self._last = site, first, last
        self._params, self._times = params(site), SiteTimes(site)
        hours = {h: [u.fingerprint, sorted(u.facts.items())] for h, u in built.sealed.hours.items()}
        self._hours: Mapping[int, object] = {**dict(built.fingerprints), **hours}
        days = {d: [u.fingerprint, sorted(u.facts.items())] for d, u in built.sealed.days.items()}
        self._days: Mapping[int, object] = {**days, **dict(built.day_fingerprints)}
        self._hashes: dict[tuple[int, int], str] = {}

    def utc_files(self, relation: Relation, *, first_hour: int, last_hour: int) -> dict[int, DayFile]:
        """Return the file of a fact of each UTC day number with records that lies whole in a range of hours."""
        days = sorted({h // 24 for h in self._hours})
        whole = [d for d in days if d * 24 >= first_hour and d * 24 + 23 <= last_hour]
        columns = text_hash(list(relation.columns))  # sealed hours may have been computed by another query
        causes = {d: {"facts": self._facts(d * 24, d * 24 + 23), "sql": columns} for d in whole}
        return {d: self._file(relation, _EPOCH + timedelta(days=d), causes[d]) for d in whole}

    def files(self, relation: Relation) -> dict[date, DayFile]:
        """Return the file of a mart of each of its days: local dates, or the site days that touch them."""
        before = timedelta(days=1 if relation.kept == SITE_DAY else 0)
        n = (self._last - self._first + before).days + 1
        days = [self._first - before + timedelta(days=i) for i in range(n)]
        shared = self._shared(relation)
        return {d: self._file(relation, d, {**shared, **self._own(relation, d)}) for d in days}

    def _file(self, relation: Relation, day: date, causes: Causes) -> DayFile:
        root = self._site.root / FOLDER
        folder = unit_folder(root, relation.name, self._site.site_id, (day - _EPOCH).days * 24)
        return DayFile(folder / f"00-{day_fingerprint(relation.name, day, causes)}.parquet", causes)

    def _shared(self, relation: Relation) -> dict[str, str]:
        """Return hashes of what the rows of every day depend on: queries, settings, and what they read of vsd.toml."""
        made = _marts_of(relation)
        read = {name for r in made for name in r.reads}
        used = sorted({p for r in made for p in r.params})
        found = {
            "sql": text_hash(sorted((r.name, r.sql) for r in made)),
            "settings": text_hash({p: self._params[p] for p in used}),
        }
        if "cameras" in read:
            found["cameras"] = text_hash([(c.camera_id, c.floor_id, c.hz) for c in self._site.cameras])
        if "owner_cells" in read:
            found["views"] = self._times.owners
        if read & _OF_AREAS:
            areas = [(a.area_id, a.floor_id, a.polygon) for a in self._site.areas]
            found["areas"] = text_hash([areas, self._site.settings.cell_m])
        return found

    def _own(self, relation: Relation, day: date) -> dict[str, str]:
        """Return hashes of what the rows of one day depend on: the facts around it, and the calendar."""
        site = self._site
        midnights = [day + timedelta(days=k) for k in (0, 1, 2)]
        edges = [round(datetime(d.year, d.month, d.day, tzinfo=site.zone).timestamp()) for d in midnights]
        opened = None if site.opening is None else site.opening[day.weekday()]
        hours = (edges[0] // 3600 - AROUND_H, (edges[1] - 1) // 3600 + AROUND_H)
        if relation.kept == SITE_DAY:  # nothing of it lies outside that day
            starts_s = site.day_starts_min * 60
            hours = ((edges[0] + starts_s) // 3600 - 1, (edges[1] + starts_s) // 3600 + 1)
        return {
            "facts": self._facts(*hours),
            "calendar": text_hash([site.timezone, edges, site.day_starts_min, opened, day in site.closed]),
        }

    def _facts(self, first_hour: int, last_hour: int) -> str:
        if (first_hour, last_hour) not in self._hashes:
            hours = [(h, self._hours[h]) for h in range(first_hour, last_hour + 1) if h in self._hours]
            days = range(first_hour // 24, last_hour // 24 + 1)
            known = [(d, self._days[d]) for d in days if d in self._days]
            self._hashes[first_hour, last_hour] = text_hash([hours, known])
        return self._hashes[first_hour, last_hour]


def day_fingerprint(name: str, day: date, causes: Causes) -> str:
    """Return the 16 hexadecimal digits that stand in the name of a day file."""
    return text_hash([name, day.isoformat(), sorted(causes.items())])


def kept_relations() -> list[Relation]:
    """Return the facts and marts whose rows are kept by day."""
    return [r for r in relations("facts", "marts").values() if r.kept]


def day_files_around(site: Site, hours: Iterable[int]) -> list[Path]:
    """Return all day files whose rows may have been made of facts of some UTC hours, fresh or not."""
    near = {h // 24 + k for h in hours for k in range(-_AROUND_DAYS, _AROUND_DAYS + 1)}
    if not near:
        return []
    within = {"first_hour": min(near) * 24, "last_hour": max(near) * 24}
    parts = (p for r in kept_relations() for p in list_parts(site.root / FOLDER, r.name, site.site_id, **within))
    return [p.path for p in parts if p.hour // 24 in near]


def _marts_of(relation: Relation) -> list[Relation]:
    """Return a mart and the marts it is made of; a fact alone, as fingerprints of hours tell what it is made of."""
    known = relations("marts")
    found: dict[str, Relation] = {}
    left = [relation.name]
    while left:
        name = left.pop()
        if name in known and name not in found:
            found[name] = known[name]
            left += known[name].reads
    return list(found.values())
