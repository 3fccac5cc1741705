"""Sites of which everything is known that a page may claim: for the proof of the pages' words.

Days are drawn by `change_worlds`: areas whose rates share shocks of days and weeks, and of which one may change. Four
cameras look at two of the areas each, one open hour a day. Cameras may record nothing, the site may be closed, another
engine may count. Then the product makes its own model of the page, from planted marts.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any, Final
from unittest import mock

import numpy as np
import pyarrow as pa
from change_worlds import MUSEUM, OFFICE, SHOP, Drawn, World, draw
from planted_changes import area
from planted_marts import plant

from vsd_analytics.figures.week import trend_weeks
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.lazy_answers import LazyAnswers
from vsd_analytics.report.model import assemble
from vsd_analytics.report.model.sections import add_week_sections
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.story import finish
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import Warehouse

FIRST: Final = date(2025, 6, 2)  # a Monday
N_AREAS: Final = 8
CAMERAS: Final = ("camera-1", "camera-2", "camera-3", "camera-4")
AREAS: Final = tuple(area(f"place-{k}", 10.0 * k) for k in range(N_AREAS))
OPEN: Final = tuple(((9 * 60, 10 * 60),) for _ in range(7))
HISTORY: Final = 12
"""Weeks before the first that is read, in most tales; what happens, happens when they end."""
Down = Callable[[int, int], bool]
"""Whether a camera (0 to 3) records nothing on a day, counted from the Monday of the first week after `HISTORY`."""
HALF_WEEK: Final = 4


def up(camera: int, day: int) -> bool:
    return False


@dataclass(frozen=True, kw_only=True)
class Tale:
    """What happens at a site.

    Attributes:
        name: For tables.
        world: How it varies, and what is planted from the first week after its history on.
        entries: Areas the change log names at the start of that week; None = the whole site.
        weeks: Weeks that are read, counted from there.
        down: Camera-days without a record.
        closed: Days on which it is closed, counted like those of `down`.
        engine_since: Day from which another engine counts; None = always the same.
    """

    name: str
    world: World
    entries: tuple[int | None, ...] = ()
    weeks: tuple[int, ...] = (0, 1, 3)
    down: Down = up
    closed: frozenset[int] = frozenset()
    engine_since: int | None = None


def of(world: World, **changes: Any) -> World:
    """Return a world of this many areas and weeks with something planted in it."""
    return world.but(**{"n_areas": N_AREAS, "weeks_before": HISTORY, "weeks_after": 9} | changes)


TALES: Final = (
    *(Tale(name=f"nothing changes: {w.name}", world=of(w)) for w in (OFFICE, SHOP, MUSEUM)),
    *(
        Tale(name=f"an entry that does nothing: {w.name}", world=of(w), entries=(3,), weeks=(0, 2, 5, 8))
        for w in (OFFICE, MUSEUM)
    ),
    *(
        Tale(
            name=f"a redesign that halves an area: {w.name}", world=of(w, effect=0.5), entries=(0,),
            weeks=(0, 2, 5, 8),
        )
        for w in (OFFICE, SHOP, MUSEUM)
    ),
    *(
        Tale(
            name=f"a redesign that moves people on: {w.name}", world=of(w, effect=0.4, spill=(1.0, 2)), entries=(0,),
            weeks=(0, 2, 5, 8),
        )
        for w in (OFFICE, SHOP)
    ),
    *(
        Tale(name=f"a redesign that clears an area: {w.name}", world=of(w, effect=0.1), entries=(0,), weeks=(2, 5))
        for w in (OFFICE, SHOP)
    ),
    Tale(name="everything falls, an entry does nothing", world=of(SHOP, season=0.7), entries=(3,)),
    Tale(name="everything rises, an entry does nothing", world=of(SHOP, season=1.4), entries=(3,)),
    Tale(name="an area rises", world=of(SHOP, effect=1.8), weeks=(0, 1, 2)),
    Tale(name="a quiet site", world=of(SHOP, per_week=3.0), entries=(3,)),
    Tale(name="a site with hardly an event", world=of(SHOP, per_week=0.3)),
    Tale(name="a camera dead for half a week", world=of(SHOP), down=lambda c, d: c == 1 and HALF_WEEK <= d < 7),
    Tale(name="a camera dead for a week", world=of(SHOP), down=lambda c, d: c == 1 and 0 <= d < 7, weeks=(0, 1)),
    Tale(
        name="a camera dead for a week, its area rises", world=of(SHOP, effect=2.0), weeks=(0, 1),
        down=lambda c, d: c == 0 and 0 <= d < 7,
    ),
    Tale(
        name="a camera dead since a redesign under it", world=of(SHOP, effect=0.5), entries=(0,), weeks=(0, 2),
        down=lambda c, d: c == 0 and d >= 0,
    ),
    Tale(name="a new camera", world=of(SHOP), down=lambda c, d: c == 1 and d < 0, weeks=(0, 1, 4)),
    Tale(name="holidays", world=of(SHOP), closed=frozenset((0, 1, 2)), weeks=(0, 1)),
    Tale(name="a closed week", world=of(SHOP), closed=frozenset(range(7)), weeks=(0, 1, 2)),
    Tale(name="all cameras dead for a week", world=of(SHOP), down=lambda c, d: 0 <= d < 7, weeks=(0, 1)),
    *(
        Tale(
            name=f"a site that is {n} weeks old: {w.name}", world=of(w, weeks_before=n), weeks=(0,),
            entries=(3,) if n else (),
        )
        for w in (SHOP, MUSEUM)
        for n in (0, 1, 3)
    ),
    Tale(name="a first week with a dead camera", world=of(SHOP, weeks_before=0), weeks=(0,), down=lambda c, d: c == 1),
    Tale(name="another engine", world=of(SHOP), engine_since=0, weeks=(0, 1)),
    Tale(
        name="a slow fall of one area, an entry does nothing", world=of(OFFICE, trend=-0.02), entries=(0,),
        weeks=(0, 5, 8),
    ),
    Tale(name="a slow rise of one area", world=of(SHOP, trend=0.03), weeks=(0, 4)),
)  # fmt: skip


def sites_of(tale: Tale, n_sites: int, seed: int) -> Drawn:
    """Return the sites of a tale, drawn apart from those of every other tale."""
    return draw(tale.world, n_sites, seed + zlib.crc32(tale.name.encode()))


@dataclass(frozen=True, eq=False)
class Truth:
    """What is true of a site in a week.

    Attributes:
        tale: What happens there.
        drawn: All sites of the tale.
        site: Number of this one.
        week: The week, counted from the first drawn.
    """

    tale: Tale
    drawn: Drawn
    site: int
    week: int

    @property
    def start(self) -> int:
        """Return the first day after the history."""
        return 7 * self.tale.world.weeks_before

    @property
    def monday(self) -> date:
        """Return the first day of the week."""
        return FIRST + timedelta(weeks=self.week)

    def is_recorded(self, k: int, day: int) -> bool:
        """Tell whether an area was open and recorded on a day counted from the first drawn."""
        return self.is_open(day) and not self.tale.down(camera_of(k), day - self.start)

    def is_open(self, day: int) -> bool:
        """Tell whether the site was open on a day."""
        return day - self.start not in self.tale.closed

    def days(self, week: int | None = None) -> range:
        """Return the days of a week; None = this one."""
        first = 7 * (self.week if week is None else week)
        return range(first, first + 7)

    def counted(self, k: int, week: int | None = None) -> float | None:
        """Return the violations counted in an area in a week; None where nothing was recorded."""
        days = [d for d in self.days(week) if d >= 0 and self.is_recorded(k, d)]
        return float(self.drawn.n[self.site, k, days].sum()) if days else None

    def happened(self, k: int) -> float:
        """Return the violations of an area in the week, recorded or not."""
        return float(self.drawn.n[self.site, k, [d for d in self.days() if self.is_open(d)]].sum())

    def silent(self) -> list[str]:
        """Return the cameras that recorded nothing in a week in which the site was open."""
        open_days = [d for d in self.days() if self.is_open(d)]
        down = [c for c in range(len(CAMERAS)) if all(self.tale.down(c, d - self.start) for d in open_days)]
        return [CAMERAS[c] for c in down] if open_days else []

    def ratio(self, areas: Sequence[int], *, drawn: np.ndarray | None = None) -> float | None:
        """Return the planted change of some areas against the week before, over the days both weeks recorded.

        Returns:
            None where no day of both was recorded.
        """
        now = before = 0.0
        expected = self.drawn.expected[self.site] if drawn is None else drawn
        for k in areas:
            for d in self.days():
                if d >= 7 and self.is_recorded(k, d) and self.is_recorded(k, d - 7):
                    now, before = now + expected[k, d], before + expected[k, d - 7]
        return float(now / before) if before else None

    def share_of_change(self, k: int) -> float:
        """Return the part of the floor's planted change that lies in an area."""
        e = self.drawn.expected[self.site]
        each = [
            sum(e[j, d] - e[j, d - 7] for d in self.days() if self.is_recorded(j, d) and self.is_recorded(j, d - 7))
            for j in range(N_AREAS)
        ]
        return float(each[k] / sum(each)) if abs(sum(each)) > 1e-9 else 0.0

    def level(self, areas: Sequence[int], *, of: str = "given") -> float:
        """Return the mean rate per open hour of some areas over the week's recorded days, by camera, summed."""
        values = getattr(self.drawn, of)[self.site]
        total = 0.0
        for k in areas:
            days = [d for d in self.days() if self.is_recorded(k, d)]
            total += float(values[k, days].mean()) if days else 0.0
        return total

    def effect(self, k: int | None = None) -> float:
        """Return what the log's entry did to its area (k), or (None) became of the floor, over the weeks since.

        Without a real entry this is 1, whatever else happened; of the floor it is all that happened.
        """
        if k is None:
            e = self.drawn.expected[self.site]
            since, before = e[:, self.start : 7 * self.week + 7], e[:, : self.start]
            return float(since.mean(axis=1).sum() / before.mean(axis=1).sum()) if before.size else 1.0
        return self.tale.world.effect if k == 0 else 1.0


def camera_of(k: int) -> int:
    """Return which camera looks at an area."""
    return len(CAMERAS) * k // N_AREAS


def site_of(tale: Tale, root: Path) -> Site:
    """Return the site of a tale."""
    wide = 10.0 * N_AREAS / len(CAMERAS)
    left = [wide * c - 3.0 for c in range(len(CAMERAS))]
    views = [((x, -2.0), (x + wide, -2.0), (x + wide, 8.0), (x, 8.0)) for x in left]
    start = 7 * tale.world.weeks_before
    return Site(
        "shop", "Shop", "UTC", root, opening=OPEN, floors=(Floor("ground", "Ground floor"),),
        closed=frozenset(FIRST + timedelta(days=start + d) for d in tale.closed),
        cameras=tuple(Camera(c, c, "ground", hz=1.0, view=v) for c, v in zip(CAMERAS, views, strict=True)),
        areas=AREAS, settings=Settings(),
    )  # fmt: skip


def weeks_of(tale: Tale, drawn: Drawn, site: int, root: Path) -> Iterator[tuple[Truth, WeekReport]]:
    """Yield the weeks of a site that are read: what is true, and the page's model. `root` is an empty folder."""
    start = FIRST + timedelta(weeks=tale.world.weeks_before)
    lines = [
        {"at": f"{start}T07:00:00+00:00", "text": "Something moved"} | ({} if k is None else {"area": f"place-{k}"})
        for k in tale.entries
    ]
    log = "".join(json.dumps(line) + "\n" for line in lines)
    (root / "log.jsonl").write_text(log, encoding="utf-8")
    for week in tale.weeks:
        truth = Truth(tale, drawn, site, tale.world.weeks_before + week)
        with Warehouse(site_of(tale, root), FIRST, truth.monday + timedelta(days=6)) as warehouse:
            yield truth, page_model(warehouse, truth)


def page_model(warehouse: Warehouse, truth: Truth) -> WeekReport:
    """Return the product's own model of a week's page, all but its maps, from what was recorded up to that week."""
    for name, rows in _marts(truth).items():
        plant(warehouse, name, pa.Table.from_pylist(rows))
    data = WeekData(warehouse, floor=warehouse.site.floors[0], monday=truth.monday)
    found = LazyAnswers(data)
    since = truth.tale.engine_since

    def engines(site: Site, first: date, last: date) -> tuple[str, ...]:
        new = None if since is None else FIRST + timedelta(days=truth.start + since)
        old = ("acme 1.0",) if new is None or first < new else ()
        return (*old, *(("acme 2.0",) if new is not None and last >= new else ()))

    with mock.patch.object(assemble, "engines", engines), mock.patch.object(trend_weeks, "engines", engines):
        report = assemble._report(data, data.floor, found, None, has_context=False)
        report = finish(add_week_sections(report, data, found))
    return replace(report, maps=())


def _marts(truth: Truth) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of the marts up to the week."""
    n, close_h, seen_h = (a[truth.site] for a in (truth.drawn.n, truth.drawn.violation_h, truth.drawn.exposure_h))
    hours: list[dict[str, Any]] = []
    by_area: list[dict[str, Any]] = []
    by_cell: list[dict[str, Any]] = []
    for d in range(7 * truth.week + 7):
        day = FIRST + timedelta(days=d)
        start_ms = round(datetime(day.year, day.month, day.day, 9, tzinfo=UTC).timestamp() * 1000)
        for c, camera in enumerate(CAMERAS):
            own = [k for k in range(N_AREAS) if camera_of(k) == c]
            is_recorded = truth.is_recorded(own[0], d)
            at = {"floor_id": "ground", "camera_id": camera, "hour_start_ms": start_ms}
            for k in own if is_recorded else []:
                counts = {"n_violations_open": int(n[k, d]), "exposure_open_s": 3600 * seen_h[k, d]}
                by_area.append({**at, "area_id": f"place-{k}", **counts, "violation_open_s": 3600 * close_h[k, d]})
                by_cell.append({**at, "local_date": day, "cx": 40 * k + 2, "cy": 2, **counts})
            hours.append(
                {
                    **at,
                    "camera_no": c,
                    "local_date": day,
                    "local_hour": 9,
                    "fold": 0,
                    "open_s": 3600.0 if truth.is_open(d) else 0.0,
                    "recorded_open_s": 3600.0 if is_recorded else 0.0,
                    "is_inferred": False,
                    "n_violations_open": int(n[own, d].sum()) if is_recorded else None,
                    "exposure_open_s": 3600 * seen_h[own, d].sum() if is_recorded else None,
                    "violation_s": 3600 * close_h[own, d].sum() if is_recorded else None,
                    "violation_open_s": 3600 * close_h[own, d].sum() if is_recorded else None,
                }
            )
    seen = [{"camera_id": c, "floor_id": "ground", "started_ms": 0, "x_m": 1.0} for c in CAMERAS]
    return {"camera_hours": hours, "area_hours": by_area, "cell_hours": by_cell, "violations": seen}
