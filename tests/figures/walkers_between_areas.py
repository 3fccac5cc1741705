"""People who walk from area to area along a corridor, put straight into a small store."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from report import ingested_worlds as w
from warehouse.small_projects import DAY, HOUR, T0, Person, beats, make_site, put

from vsd_analytics.config.project import load_site
from vsd_analytics.site.model import Area, Site

ROUND, SHORT, RARE = ("door", "bread", "till", "door"), ("door", "wine", "door"), ("door", "till", "door")
HOSTILE = "<b>Bread</b>"
AREAS = ("door", "bread", "wine", "till")
WALK_M = 4.0
"""From an area to the next along the corridor; areas are 2 m wide."""


def site_with_areas(root: Path, **settings: object) -> Site:
    """Return a site with four areas along a corridor, the first one a door."""
    areas = tuple(
        Area(
            name, name.title(), "ground", ((x, 0), (x + 2, 0), (x + 2, 2), (x, 2)),
            has_visits=True, is_door=name == "door",
        )
        for name, x in ((name, k * WALK_M) for k, name in enumerate(AREAS))
    )  # fmt: skip
    return replace(make_site(root, **settings), areas=areas)  # type: ignore[arg-type]


def walk(way: Sequence[str], start_ms: int, track: str, *, lost_after_s: int | None = None) -> Iterator[Person]:
    """Return somebody who stays 3 s in each area and walks beside the areas in between, 1 m a second, at 1 Hz.

    From `lost_after_s` on, the person has another track id.
    """
    places: list[tuple[float, float]] = []
    for k, name in enumerate(way):
        x = AREAS.index(name) * WALK_M + 1
        if k:
            before = AREAS.index(way[k - 1]) * WALK_M + 1
            steps = max(1, round(abs(x - before)))
            places += [(before + (x - before) * i / steps, 3.0) for i in range(steps + 1)]
        places += [(x, 1.0)] * 3
    for s, (x, y) in enumerate(places):
        is_lost = lost_after_s is not None and s >= lost_after_s
        yield Person(start_ms + s * 1000, f"{track}-2" if is_lost else track, round(x * 1000), round(y * 1000))


def week_of_walkers(root: Path) -> Path:
    """Write a project with a week of walkers: two routes, a rare one, every tenth person lost."""
    areas = {
        n: (HOSTILE if n == "bread" else n.title(), (k * WALK_M, 0, k * WALK_M + 2, 2)) for k, n in enumerate(AREAS)
    }
    text = w.toml(cameras=("cam",), areas=areas, opening='{ mon-sun = "09:00-10:00" }')
    for n in AREAS:
        door = "\ndoor = true" if n == "door" else ""
        text = text.replace(f'id = "{n}"\n', f'id = "{n}"\nvisits = true{door}\n')
    (root / "vsd.toml").write_text(text, encoding="utf-8")
    rng = np.random.default_rng(5)
    rows: list[Person] = []
    for d in range(7):
        for k in range(40):
            way = RARE if (d, k) in ((1, 3), (2, 5)) else ROUND if rng.random() < 0.6 else SHORT
            lost = int(rng.integers(4, 20)) if rng.random() < 0.1 else None
            rows += walk(way, T0 + d * DAY + k * 80_000, f"{d}-{k}", lost_after_s=lost)
        rows += beats(T0 + d * DAY, T0 + d * DAY + HOUR)
    put(load_site(root), rows)
    return root
