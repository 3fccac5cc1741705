"""People who walk from area to area along a corridor, put straight into a small store."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from warehouse.small_projects import Person, make_site

from vsd_analytics.site.model import Area, Site

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
