"""A shop with staff whose behaviour is not what the rules of `[staff]` assume, as records with the truth beside them.

Cashiers leave their counter for shelves and breaks, an adviser never goes behind it, a cleaner comes before the shop
opens. Visitors lean over the counter, queue along it, run behind it as children do, and sit in the café for two hours.
Places are known to 0.15 m, and the tracker gives people new ids.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vsd_analytics.schema import SCHEMAS
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Area, Camera, Floor, Site
from vsd_analytics.store.store import Store

STEP_S = 2.0
DAY_S = 86_400
MONDAY = datetime(2026, 11, 9, tzinfo=UTC)
OPENS_H, CLOSES_H = 9, 19
RECTS = {"counter": (0.0, 10.0, 6.0, 12.0), "queue": (0.0, 8.0, 6.0, 10.0), "cafe": (14.0, 0.0, 20.0, 5.0)}


@dataclass(frozen=True)
class Shop:
    """What happens in a day.

    Attributes:
        seed: Of everything.
        n_days: Days from Monday on.
        n_visitors: Visitors a day.
        cuts_per_h: How often the tracker gives a person a new id.
        at_counter: Share of a cashier's time behind the counter.
    """

    seed: int = 1
    n_days: int = 1
    n_visitors: int = 250
    cuts_per_h: float = 0.5
    at_counter: float = 0.45


@dataclass(frozen=True)
class Records:
    """Person records, in order of time; one row a record.

    Attributes:
        at_s: Seconds since the Monday.
        track: Number of the track.
        x_m, y_m: Floor metres.
        is_staff: The truth.
    """

    at_s: NDArray[np.float64]
    track: NDArray[np.int64]
    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    is_staff: NDArray[np.bool_]


def site_of(root: Path, **settings: object) -> Site:
    """Return the shop's site."""
    shapes = {name: ((x0, y0), (x1, y0), (x1, y1), (x0, y1)) for name, (x0, y0, x1, y1) in RECTS.items()}
    areas = (
        Area("counter", "Counter", "ground", shapes["counter"], is_staff=True),
        Area("queue", "Queue", "ground", shapes["queue"], has_visits=True, is_queue=True),
        Area("cafe", "Café", "ground", shapes["cafe"], has_visits=True),
    )
    return Site(
        "shop",
        "Shop",
        "UTC",
        root,
        opening=(((OPENS_H * 60, CLOSES_H * 60),),) * 7,
        floors=(Floor("ground", "Ground"),),
        cameras=(Camera("cam", "Cam", "ground", hz=1 / STEP_S),),
        areas=areas,
        settings=Settings().with_values(settings),
    )


def put(site: Site, of: Records, *, only: NDArray[np.bool_] | None = None, tagged: float = 0.0) -> None:
    """Store records, and a heartbeat a frame; the engine knows staff in this share of their records, and no visitor."""
    rows = np.flatnonzero(np.ones(len(of.at_s), np.bool_) if only is None else only)
    ms = (MONDAY.timestamp() * 1000 + of.at_s * 1000).astype(np.int64)
    beats = np.unique(ms)
    stored = {
        "observations": {
            "ts": ms[rows],
            "track_id": np.char.add("t", of.track[rows].astype(str)),
            "x_mm": np.round(of.x_m[rows] * 1000),
            "y_mm": np.round(of.y_m[rows] * 1000),
            "person": np.arange(len(rows)) % 30_000,
            "quality": np.full(len(rows), "metric"),
            **({"is_staff": _tags(of, tagged)[rows]} if tagged else {}),
        },
        "frames": {"ts": beats, "n_persons": np.zeros(len(beats))},
    }
    store = Store(site.root / "store", site_id=site.site_id)
    for name, columns in stored.items():
        n, schema = len(columns["ts"]), SCHEMAS[name]  # type: ignore[index]
        values = {**columns, "camera_id": np.full(n, "cam")}
        arrays = [_array(values[f.name], f) if f.name in values else pa.nulls(n, f.type) for f in schema]
        store.append(name, pa.table(arrays, schema=schema))  # type: ignore[arg-type]
    store.fold()


def _tags(of: Records, share: float) -> NDArray[np.bool_]:
    """Return which records an engine tags that looks at each record anew."""
    return of.is_staff & (np.random.default_rng(1).random(len(of.at_s)) < share)


def _array(values: NDArray[np.generic], field: pa.Field) -> pa.Array:
    if pa.types.is_timestamp(field.type):
        return pa.array(values, pa.int64()).cast(field.type)
    return pa.array(values.tolist(), pa.string()) if values.dtype.kind == "U" else pa.array(values).cast(field.type)


def records_of(shop: Shop) -> Records:
    """Return the records of all days."""
    rng = np.random.default_rng(shop.seed)
    found: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], bool]] = []
    for day in range(shop.n_days):
        opens, closes = day * DAY_S + OPENS_H * 3600, day * DAY_S + CLOSES_H * 3600
        found += [
            (*_walk(rng, opens - 900 + late, _cashier(rng, 7.0 * 3600, shop.at_counter)), True)
            for late in (0, 0, 3 * 3600)
        ]
        found.append((*_walk(rng, opens + 600, _browsing(rng, 8.0 * 3600, pause_s=240)), True))
        found.append((*_walk(rng, opens - 5400, _browsing(rng, 4000, pause_s=60)), True))
        starts = rng.uniform(opens, closes - 1800, shop.n_visitors)
        found += [(*_walk(rng, start, _visit(rng), until=closes + 300), False) for start in starts]
    tracks, number = [], 0
    for at, *_ in found:
        cuts = rng.random(len(at)) < shop.cuts_per_h * STEP_S / 3600
        tracks.append(number + np.cumsum(cuts))
        number = int(tracks[-1][-1]) + 1 if len(at) else number
    at_s = np.concatenate([f[0] for f in found])
    order = np.argsort(at_s, kind="stable")
    joined = (at_s, np.concatenate(tracks), *(np.concatenate([f[k] for f in found]) for k in (1, 2)))
    is_staff = np.concatenate([np.full(len(f[0]), f[3]) for f in found])
    return Records(*(of[order] for of in joined), is_staff[order])  # type: ignore[arg-type]


Stops = list[tuple[float, float, float]]
"""Places with the seconds that somebody stays there."""


def _inside(rng: np.random.Generator, name: str) -> tuple[float, float]:
    x0, y0, x1, y1 = RECTS[name]
    return rng.uniform(x0 + 0.3, x1 - 0.3), rng.uniform(y0 + 0.3, y1 - 0.3)


def _cashier(rng: np.random.Generator, for_s: float, share: float) -> Stops:
    stops: Stops = []
    while sum(s[2] for s in stops) < for_s:
        spell = rng.exponential(1200)
        stops += [(*_inside(rng, "counter"), 60.0) for _ in range(int(spell / 60) + 1)]
        stops += _browsing(rng, spell * (1 - share) / share, pause_s=120)
    return stops


def _browsing(rng: np.random.Generator, for_s: float, *, pause_s: float) -> Stops:
    stops: Stops = []
    while sum(s[2] for s in stops) < for_s:
        stops.append((rng.uniform(1, 19), rng.uniform(1, 7.8), rng.exponential(pause_s)))
    return stops


def _visit(rng: np.random.Generator) -> Stops:
    door = (10.0, 0.2, 0.0)
    kind = rng.choice(["buys", "leans", "cafe", "child", "looks", "stays"], p=[0.5, 0.12, 0.12, 0.03, 0.2, 0.03])
    stops = _browsing(rng, rng.lognormal(np.log(600), 0.6), pause_s=45)
    if kind in ("buys", "leans"):
        x = rng.uniform(0.5, 5.5)
        stops += [(x - 0.3 * k, 9.2, rng.exponential(50)) for k in (3, 2, 1)] + [(x, 9.75, rng.uniform(40, 150))]
    if kind == "leans":
        stops += [(x, rng.uniform(10.1, 10.5), rng.exponential(120))]
    if kind == "cafe":
        stops += [(*_inside(rng, "cafe"), rng.uniform(1800, 7800))]
    if kind == "child":
        stops += [(*_inside(rng, "counter"), rng.uniform(5, 80)) for _ in range(5)]
    if kind == "stays":
        stops += _browsing(rng, rng.uniform(7200, 12_000), pause_s=300)
    return [door, *stops, door]


def _walk(
    rng: np.random.Generator, start_s: float, stops: Stops, *, until: float = np.inf
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the instants and places of somebody who goes from stop to stop at 1.1 m/s."""
    place, stay = np.array([s[:2] for s in stops]), np.array([s[2] for s in stops])
    way_s = np.append(0, np.hypot(*np.diff(place, axis=0).T) / 1.1)
    arrives = np.cumsum(way_s) + np.append(0, np.cumsum(stay))[:-1]
    knots = np.column_stack([arrives, arrives + stay]).ravel()
    at = np.arange(np.ceil(start_s / STEP_S), np.floor(min(start_s + knots[-1], until) / STEP_S)) * STEP_S
    x, y = (np.interp(at - start_s, knots, np.repeat(place[:, c], 2)) + rng.normal(0, 0.15, len(at)) for c in (0, 1))
    return at, x, y
