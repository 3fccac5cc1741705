"""The maps of a floor: where people are, are close, are at risk, and are closer than chance would have them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from planted_floors import site_of
from planted_marts import plant

from vsd_analytics.answer import Reason
from vsd_analytics.figures.floor_days import NO_FLOOR, NO_POSITIONS
from vsd_analytics.figures.maps import CellMap, burden_map, cell_maps, excess_map, exposure_map, risk_map
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording.reasons import reason_text

FIRST = date(2026, 11, 9)
SIZE_M = (16.0, 12.0)
FRAMES = 3000
"""Frames of an hour; each stands for 1.2 s."""
FRAME_S = 3600 / FRAMES


@dataclass(frozen=True)
class Hour:
    """One camera-hour of people placed anew in every frame."""

    camera_id: str
    day: date
    hour: int
    recorded_s: float
    at: np.ndarray  # of every person: frame, x, y
    is_close: np.ndarray


def anywhere(rng: np.random.Generator, n: int) -> np.ndarray:
    """Return n places, each as likely as any other."""
    return rng.uniform((0, 0), SIZE_M, (n, 2))


def at_the_counter(rng: np.random.Generator, n: int) -> np.ndarray:
    """Return n places, three of four in a square of 4 m, and the rest anywhere."""
    inside = rng.random(n) < 0.75
    return np.where(inside[:, None], rng.uniform((6, 4), (10, 8), (n, 2)), anywhere(rng, n))


def hour_of(
    seed: int,
    *,
    layout: Any = anywhere,
    mean: float = 4.0,
    stick: float = 0.0,
    day: date = FIRST,
    hour: int = 9,
    camera_id: str = "cam",
    recorded: float = 1.0,
) -> Hour:
    """Return an hour with Poisson many people in a frame, each placed independently of the others.

    With `stick`, of those in the left 6 m of the floor that share brings somebody along, 0.7 m away.
    """
    rng = np.random.default_rng(seed)
    n = rng.poisson(mean, int(FRAMES * recorded))
    frame = np.repeat(np.arange(len(n)), n)
    place = layout(rng, len(frame))
    if stick:
        leads = (place[:, 0] < 6) & (rng.random(len(frame)) < stick)
        turn = rng.uniform(0, 2 * np.pi, leads.sum())
        beside = (place[leads] + 0.7 * np.stack((np.cos(turn), np.sin(turn)), axis=1)).clip((0, 0), SIZE_M)
        frame, place = np.concatenate((frame, frame[leads])), np.concatenate((place, beside))
        order = np.argsort(frame, kind="stable")
        frame, place = frame[order], place[order]
    close = np.zeros(len(frame), dtype=bool)
    for k in range(1, 40):  # neighbours in the list, as far as they are in the same frame
        same = frame[k:] == frame[:-k]
        if not same.any():
            break
        near = same & (np.hypot(*(place[k:] - place[:-k]).T) < 2.0)
        close[k:] |= near
        close[:-k] |= near
    return Hour(camera_id, day, hour, 3600 * recorded, np.column_stack((frame, place)), close)


@contextmanager
def planted(site: Site, hours: list[Hour], *, knows: tuple[str, ...] = ("people", "distances")) -> Iterator[Warehouse]:
    """Open a warehouse whose marts hold these hours."""
    camera_hours, cells, crowding = [], [], []
    for h in hours:
        start = round(datetime(h.day.year, h.day.month, h.day.day, h.hour, tzinfo=UTC).timestamp() * 1000)
        person_s = len(h.at) * FRAME_S
        seen = (
            person_s if "people" in knows else None,
            h.is_close.sum() * FRAME_S if "distances" in knows else None,
        )
        camera_hours.append((h.camera_id, 0, "ground", start, h.day, h.hour, 3600.0, h.recorded_s, *seen))
        n = np.bincount(h.at[:, 0].astype(int), minlength=FRAMES).astype(float)
        if person_s:
            crowding.append((h.camera_id, "ground", start, person_s, float((n * (n - 1) / 2).sum()) * FRAME_S))
        index = np.floor(h.at[:, 1:] / 0.25).astype(int)
        of, number = np.unique(index, axis=0, return_inverse=True)
        stood, close = (np.bincount(number.ravel(), weights=w) * FRAME_S for w in (np.ones(len(index)), h.is_close))
        if "places" not in knows and knows != ("people", "distances"):
            continue
        cells += [
            ("ground", h.camera_id, start, h.day, int(cx), int(cy), float(a), float(b))
            for (cx, cy), a, b in zip(of, stood, close, strict=True)
        ]
    columns = {
        "camera_hours": (
            *("camera_id", "camera_no", "floor_id", "hour_start_ms", "local_date", "local_hour", "open_s"),
            *("recorded_open_s", "exposure_open_s", "violation_s"),
        ),
        "cell_hours": (
            *("floor_id", "camera_id", "hour_start_ms", "local_date", "cx", "cy"),
            *("exposure_open_s", "violation_open_s"),
        ),
        "crowding_hours": ("camera_id", "floor_id", "hour_start_ms", "person_s", "copresent_pair_s"),
    }
    made = {"camera_hours": camera_hours, "cell_hours": cells, "crowding_hours": crowding}
    days = [h.day for h in hours] or [FIRST]
    with Warehouse(site, min(days), max(days)) as warehouse:
        for name, names in columns.items():
            values = zip(*made[name], strict=True) if made[name] else [()] * len(names)
            types = {"camera_id": pa.string(), "floor_id": pa.string()}
            table = pa.table({c: pa.array(v, types.get(c)) for c, v in zip(names, map(list, values), strict=True)})
            plant(warehouse, name, table)
        yield warehouse


def value_at(found: CellMap, x_m: float, y_m: float) -> float:
    """Return the value of the cell at a place."""
    assert found.grid is not None
    assert found.values is not None
    cell = found.grid.cell_m
    return float(found.values[int(y_m // cell) - found.grid.cy, int(x_m // cell) - found.grid.cx])


def inner(found: CellMap, x_m: tuple[float, float], y_m: tuple[float, float]) -> np.ndarray:
    """Return the known values of the cells between two places."""
    assert found.grid is not None
    assert found.values is not None
    rows, columns = np.indices(found.grid.shape)
    x, y = found.grid.x_m(columns), found.grid.y_m(rows)
    chosen = (x > x_m[0]) & (x < x_m[1]) & (y > y_m[0]) & (y < y_m[1])
    return found.values[chosen & np.isfinite(found.values)]


@pytest.mark.parametrize("mean", [0.8, 3.0, 12.0])
@pytest.mark.parametrize("layout", [anywhere, at_the_counter])
def test_people_who_mix_at_random_give_one_everywhere(tmp_path: Path, layout: Any, mean: float) -> None:
    """However many there are, and wherever the room draws them."""
    site = site_of(tmp_path)
    hours = [hour_of(10 * d + h, layout=layout, mean=mean, day=FIRST + timedelta(days=d), hour=9 + h)
             for d in range(3) for h in range(4)]  # fmt: skip
    with planted(site, hours) as warehouse:
        found = excess_map(warehouse, floor=site.floors[0])
    assert found.observed_h is not None
    assert found.expected_h is not None
    assert found.observed_h.sum() / found.expected_h.sum() == pytest.approx(1.0, abs=0.05)
    if mean < 1:  # too few are expected in any one cell
        return
    values = inner(found, (1, 15), (1, 11))
    assert np.median(values) == pytest.approx(1.0, abs=0.06)
    assert (np.abs(values - 1) < 0.35).mean() > 0.9


def test_a_crowd_that_comes_at_noon_is_no_excess(tmp_path: Path) -> None:
    """Ten times as many people at one hour of the day, who stand elsewhere than the others do."""
    site = site_of(tmp_path)
    hours = [hour_of(10 * d + h, layout=at_the_counter if h == 3 else anywhere, mean=20 if h == 3 else 2,
                     day=FIRST + timedelta(days=d), hour=9 + h) for d in range(3) for h in range(4)]  # fmt: skip
    with planted(site, hours) as warehouse:
        found = excess_map(warehouse, floor=site.floors[0])
    assert np.median(inner(found, (6, 10), (4, 8))) == pytest.approx(1.0, abs=0.05)
    assert np.median(inner(found, (12, 15), (1, 11))) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("n_known", [2, 0])
def test_hours_of_which_company_is_unknown_are_neither_observed_nor_expected(tmp_path: Path, n_known: int) -> None:
    site = site_of(tmp_path)
    hours = [hour_of(h, mean=12, hour=9 + h) for h in range(3)]
    with planted(site, hours[:2]) as warehouse:
        two = excess_map(warehouse, floor=site.floors[0])
    with planted(site, hours) as warehouse:
        warehouse.con.execute(
            "delete from crowding_hours where hour_start_ms >= "
            "(select min(hour_start_ms) + 3600000 * $n from camera_hours)",
            {"n": n_known},
        )
        found = excess_map(warehouse, floor=site.floors[0])
    if not n_known:
        assert (found.state, found.values) == ("not_enough_data", None)
        return
    assert found.observed_h is not None
    assert two.observed_h is not None
    assert found.observed_h.sum() == pytest.approx(two.observed_h.sum())
    assert np.median(inner(found, (2, 14), (2, 10))) == pytest.approx(1.0, abs=0.1)


def test_a_sticky_place_gives_its_ratio_and_the_rest_of_the_room_does_not(tmp_path: Path) -> None:
    """The ratio is worked out anew from the frames: share of person-time close, over 1 - exp(-mean neighbours)."""
    site = site_of(tmp_path)
    hours = [hour_of(d, stick=0.3, day=FIRST + timedelta(days=d)) for d in range(14)]
    with planted(site, hours) as warehouse:
        found = excess_map(warehouse, floor=site.floors[0])
    x, y = (np.concatenate([h.at[:, k] for h in hours]) for k in (1, 2))
    close = np.concatenate([h.is_close for h in hours])
    n_frames = FRAMES * len(hours)
    around = np.hypot(x - 3, y - 6) < 2.5  # middle of the sticky part: everybody within reach of these 0.5 m
    middle = np.hypot(x - 3, y - 6) < 0.5
    per_m2 = around.sum() / (np.pi * 2.5**2) / n_frames
    n = np.concatenate([np.bincount(h.at[:, 0].astype(int), minlength=FRAMES) for h in hours])
    others = (n * (n - 1)).sum() / n.sum() / n.mean()  # others in view, over the mean number of people
    true = close[middle].mean() / -np.expm1(-others * per_m2 * np.pi * 2.0**2)
    assert true > 1.3
    assert np.median(inner(found, (2, 4), (4, 8))) == pytest.approx(true, rel=0.05)
    assert np.median(inner(found, (10, 15), (1, 11))) == pytest.approx(1.0, abs=0.12)
    assert found.is_clear is not None
    assert found.grid is not None
    columns = found.grid.x_m(np.nonzero(found.is_clear)[1])
    assert len(columns) > 50
    assert columns.max() < 8


def test_with_few_days_no_cell_is_called_clear(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    with planted(site, [hour_of(1, stick=0.5)]) as warehouse:
        assert excess_map(warehouse, floor=site.floors[0]).is_clear is None


def test_where_hardly_anything_is_expected_there_is_no_ratio(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    with planted(site, [hour_of(1, mean=0.3)]) as warehouse:
        found = cell_maps(warehouse, floor=site.floors[0])
    assert found.excess.values is not None
    assert np.isnan(found.excess.values).all()
    assert found.exposure.values is not None
    assert np.isfinite(found.exposure.values).any()


def test_exposure_and_burden_are_per_square_metre_and_hour_whatever_the_cells(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    hours = [hour_of(d, mean=6, day=FIRST + timedelta(days=d)) for d in range(2)]
    person_s = np.mean([len(h.at) * FRAME_S for h in hours])
    close_s = np.mean([h.is_close.sum() * FRAME_S for h in hours])
    for cell_m in (0.25, 0.5, 1.0):
        with planted(site, hours) as warehouse:
            exposure = exposure_map(warehouse, floor=site.floors[0], cell_m=cell_m)
            burden = burden_map(warehouse, floor=site.floors[0], cell_m=cell_m)
        assert exposure.values is not None
        assert burden.values is not None
        assert np.nansum(exposure.values) * cell_m**2 == pytest.approx(person_s)
        assert np.nansum(burden.values) * cell_m**2 == pytest.approx(close_s)
        assert exposure.denominator == burden.denominator == 2.0


def test_a_camera_that_was_down_does_not_pale_its_part(tmp_path: Path) -> None:
    """Two cameras see half the floor each; one recorded one day of four."""
    cameras = (Camera("cam", "Cam", "ground"), Camera("cam-2", "Cam 2", "ground"))
    site = site_of(tmp_path, cameras=cameras)
    left = lambda rng, n: rng.uniform((0, 0), (8, 12), (n, 2))  # noqa: E731
    right = lambda rng, n: rng.uniform((8, 0), (16, 12), (n, 2))  # noqa: E731
    hours = [hour_of(d, layout=left, day=FIRST + timedelta(days=d)) for d in range(4)]
    hours += [hour_of(9, layout=right, camera_id="cam-2")]
    hours += [hour_of(20 + d, layout=right, camera_id="cam-2", day=FIRST + timedelta(days=d), recorded=0.3)
              for d in (1, 2)]  # fmt: skip  # too little of these hours to enter rates
    with planted(site, hours) as warehouse:
        found = cell_maps(warehouse, floor=site.floors[0], cell_m=1.0)
    assert found.exposure.denominator == 5.0
    assert np.mean(inner(found.exposure, (1, 7), (1, 11))) == pytest.approx(150, rel=0.05)  # 4 people on 96 m2
    assert np.mean(inner(found.exposure, (9, 15), (1, 11))) == pytest.approx(150, rel=0.05)
    assert np.median(inner(found.excess, (2, 6), (2, 10))) == pytest.approx(1.0, abs=0.1)
    assert np.median(inner(found.excess, (10, 14), (2, 10))) == pytest.approx(1.0, abs=0.15)


def test_risk_is_a_share_of_person_time(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    hour = hour_of(1, mean=24)
    with planted(site, [hour]) as warehouse:
        found = risk_map(warehouse, floor=site.floors[0], cell_m=2.0)
    assert found.values is not None
    known = found.values[np.isfinite(found.values)]
    assert ((known > 0) & (known < 1)).all()
    inside = (np.abs(hour.at[:, 1] - 8) < 5) & (np.abs(hour.at[:, 2] - 6) < 3)
    assert np.mean(inner(found, (3, 13), (3, 9))) == pytest.approx(hour.is_close[inside].mean(), abs=0.02)


def test_where_hardly_anybody_was_no_risk_is_known(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    with planted(site, [hour_of(1, mean=0.02)]) as warehouse:
        found = risk_map(warehouse, floor=site.floors[0])
    assert found.values is not None
    assert np.isnan(found.values).all()


@pytest.mark.parametrize(
    ("knows", "reason"),
    [((), NO_POSITIONS), (("distances",), NO_POSITIONS), (("people",), NO_FLOOR)],
)
def test_what_the_engine_does_not_send_is_not_measurable(
    tmp_path: Path, knows: tuple[str, ...], reason: Reason
) -> None:
    site = site_of(tmp_path)
    with planted(site, [hour_of(1)], knows=knows) as warehouse:
        found = cell_maps(warehouse, floor=site.floors[0])
    for one in (found.burden, found.risk, found.excess):
        assert (one.state, one.reason, one.values) == ("not_measurable", reason, None)


def test_people_without_distances_still_have_a_map_of_exposure(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    with planted(site, [hour_of(1)], knows=("people", "places")) as warehouse:
        found = cell_maps(warehouse, floor=site.floors[0])
    assert found.exposure.state == "ok"
    assert found.burden.state == "not_measurable"


def test_without_records_there_is_no_map(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    with Warehouse(site, FIRST, FIRST) as warehouse:
        found = cell_maps(warehouse, floor=site.floors[0])
    for one in (found.exposure, found.burden, found.risk, found.excess):
        assert (one.state, reason_text(one.reason)) == (
            "not_enough_data",
            "nothing or too little was recorded in opening hours",
        )
