"""Two weeks of a busy floor of 24 by 16 m, for the size of the page; run it to see sizes by number of violations."""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np

from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.share.merged import merge_small_counts
from vsd_analytics.planner import cell_counts
from vsd_analytics.planner.hour_counts import HourPanel
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData

WIDTH, DEPTH, HOURS, DAYS, CAMERAS = 24, 16, 13, 7, 4
SPOTS = ((6, 5, 2.2, 6.0), (17, 10, 1.6, 4.0), (12, 13, 1.0, 3.0), (20, 3, 1.4, 3.0))


def planner(base: PlannerData, *, n_violations: int, below: int = 5) -> PlannerData:
    """Return a page's data with about so many violations in two weeks, seen by four cameras that overlap a little."""
    rng = np.random.default_rng(5)
    assert base.shown is not None
    weeks = [_week(base, rng, n_violations / 2, below) for _ in range(2)]
    n_places = len(base.places)
    history = _panel(rng, 5 * DAYS, n_places, n_violations / 2 * 5, below)
    cameras = tuple(replace(base.cameras[0], camera_id=f"cam-{k}") for k in range(CAMERAS))
    places = tuple(replace(p, cameras=(True,) * CAMERAS) for p in base.places)
    shown = replace(base.shown, extent=(0.0, 0.0, float(WIDTH), float(DEPTH)))
    return replace(
        base, cameras=cameras, places=places, shown=shown, history=history, comparable=(True,) * CAMERAS,
        walkable=None, seen=None, changes=(),
        week=weeks[0], before=weeks[1],
    )  # fmt: skip


def _week(base: PlannerData, rng: Any, n: float, below: int) -> Any:
    panel = _panel(rng, DAYS, len(base.places), n, below)
    x, y = np.meshgrid(np.arange(2 * WIDTH) / 2 + 0.25, np.arange(2 * DEPTH) / 2 + 0.25)
    where = 0.25 + sum(h * np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * s * s)) for a, b, s, h in SPOTS)
    mean = where[None] * _profile()[:, None, None]
    counts = rng.poisson(mean / mean.sum() * n)
    stood_s = rng.gamma(2.0, mean / mean.sum() * n * 6.0)
    owner = np.where(x < WIDTH / 2, 0, 1) + np.where(y < DEPTH / 2, 0, 2)
    slot, row, column = (a.ravel() for a in np.indices(counts.shape))
    camera = owner[row, column]
    strays = rng.random(camera.size) < 0.05  # overlapping views share a few cells
    camera = np.where(strays, (camera + 1) % CAMERAS, camera)
    keys = np.stack((camera, slot, column, row, slot // HOURS, np.zeros_like(slot)))
    lies, stands = counts.ravel() > 0, stood_s.ravel() > 0.1
    grid = cell_counts.CellGrid(0, 0, WIDTH, DEPTH)
    exposure = np.rint(stood_s.ravel() * 10).astype(np.int64)
    close = np.rint(exposure * rng.random(exposure.size) * 0.4).astype(np.int64)
    tracks = np.maximum(1, exposure // 40)
    quarter = rng.multinomial(counts.sum(axis=0), [0.25] * 4)
    y_of, x_of = np.repeat(np.arange(2 * DEPTH), 2 * WIDTH), np.tile(np.arange(2 * WIDTH), 2 * DEPTH)
    fine = np.concatenate(
        [
            np.stack((owner.ravel(), (2 * y_of + k // 2) * 4 * WIDTH + 2 * x_of + k % 2, quarter[..., k].ravel()))
            for k in range(4)
        ],
        axis=1,
    )
    fine = fine[:, np.lexsort((fine[1], fine[0]))]
    cells = cell_counts.WeekCells(
        violations=cell_counts._merged(keys[:, lies], [counts.ravel()[lies]], grid=grid, across=2, mask=Mask(below)),
        fine=fine[:, fine[2] >= below],
        time=cell_counts._merged(
            keys[:, stands],
            [tracks[stands], exposure[stands], close[stands]],
            grid=grid,
            across=2,
            mask=Mask(below),
            is_square=True,
        ),
        unit_ms=100,
        excess=base.week.cells.excess if base.week.cells is not None else None,  # type: ignore[arg-type]
    )  # fmt: skip
    return replace(base.week, panel=panel, cells=cells)


def _profile() -> Any:
    hour = np.tile(np.sin(np.linspace(0.5, 2.8, HOURS)) + 0.3, DAYS)
    return hour * np.repeat([1, 1, 1, 1, 1.2, 1.5, 0.8], HOURS)


def _panel(rng: Any, n_days: int, n_places: int, n: float, below: int) -> HourPanel:
    slots = np.arange(n_days * HOURS)
    shape = (n_places, CAMERAS, slots.size)
    profile = np.resize(_profile(), slots.size)
    counts = rng.poisson(np.broadcast_to(profile / profile.sum() * n / n_places / CAMERAS, shape))
    day = slots // HOURS
    given = np.stack(
        [
            [merge_small_counts(row[None], groups=(day,), mask=Mask(below)).values[0] for row in place]
            for place in counts
        ]
    )
    full = np.full((CAMERAS, slots.size), 3_600_000)
    return HourPanel(
        day=day, weekday=day % 7, hour=8 + slots % HOURS, fold=np.zeros_like(slots), recorded_ms=full,
        is_counted=np.ones_like(full, dtype=np.bool_), n=given, exposure_ms=given * 9_100,
        close_ms=given * 3_000,
    )  # fmt: skip


def main() -> None:
    """Print the size of the page and the time it takes, for the planted floor's page filled with made-up violations."""
    import tempfile
    from pathlib import Path

    from planner import planted_shop as planted

    with tempfile.TemporaryDirectory() as folder:
        base = planted.known(planted.build(Path(folder) / "shop"))
        for n in (20_000, 200_000, 2_000_000, 20_000_000):
            began = time.perf_counter()
            page = render_planner(planner(base, n_violations=n))
            print(f"{n:>10,} violations  {len(page.encode()) / 1000:6.0f} KB  {time.perf_counter() - began:5.1f} s")
            if len(sys.argv) > 1:
                Path(sys.argv[1], f"dense-{n}.html").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
