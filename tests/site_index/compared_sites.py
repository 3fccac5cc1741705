"""JSON files of a dozen made-up sites, two of which differ, one without a camera and one of an older version."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from site_index import many_reports as many
from stats.site_worlds import LAST, SiteWorld, site_floors

NAMES = (
    *("Riverside Store", "Harbour Office", "Central Station", "Old Mill", "Kingsway", "North Gate"),
    *("Abbey Road Museum", "Town Hall", "East Market", "Lakeside Library", "West Pier", "Castle Shop"),
)
WORLD = SiteWorld(
    n_sites=len(NAMES), effects=(1.7, 1 / 1.7), own_sd=0.04, day_sd=(0.1, 0.25), week_sd=(0.0, 0.1), crowding_sd=0.3
)


def write_sites(root: Path, *, n_weeks: int = 10) -> list[Path]:
    """Write a project for each site, with the last weeks of its JSON files; return their folders."""
    floors, _ = site_floors(WORLD, np.random.default_rng(3))
    folders = []
    for k, (floor, name) in enumerate(zip(floors, NAMES, strict=True)):
        folders.append(root / f"site-{k:02d}")
        for monday, entry in list(floor.weeks.items())[-n_weeks:]:
            assert entry.report is not None
            back = (LAST - monday).days // 7
            made = many.report(back=back, address=(f"s{k}", name, "ground", "Ground floor"), value=100 + k, change=0.01)
            recorded, camera = entry.report.coverage, made.coverage.cameras[0]
            cameras = tuple(
                replace(camera, camera_id=f"c{i}", share=c.share, scheduled_h=c.scheduled_h, recorded_h=c.recorded_h)
                for i, c in enumerate(recorded.cameras)
            )
            found = entry.report.close_by_crowding if k != 5 else None
            coverage = replace(made.coverage, share=recorded.share, cameras=cameras)
            many.write(folders[-1], replace(made, coverage=coverage, close_by_crowding=found))
    return folders
