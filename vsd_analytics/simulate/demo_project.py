"""Writes a whole made-up project: `vsd.toml`, plan, calibrations, pictures, change log, engine output, truth."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime, time, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.errors import UsageError, Where
from vsd_analytics.simulate.cameras import CAMERAS, HEIGHT_PX, WIDTH_PX
from vsd_analytics.simulate.frame_messages import day_text, write_messages
from vsd_analytics.simulate.history import ShopHistory, shop_history
from vsd_analytics.simulate.people import MARGIN_S, SimulatedDay, simulate_day
from vsd_analytics.simulate.plan import M_PER_PX, fixtures, plan_svg
from vsd_analytics.simulate.scene_pictures import picture
from vsd_analytics.simulate.shop import AREA_RECTS, AREAS, DEPTH_M, SHOP_AFTER, WIDTH_M
from vsd_analytics.simulate.truth import (
    AreaTruth,
    DemoTruth,
    HourTruth,
    PlantedGap,
    PlantedHotspot,
    PlantedRedesign,
    hours_of,
    in_view,
    violations,
)
from vsd_analytics.site.model import Point

SITE_ID = "quayside"
SITE_NAME = "Quayside Market"
TIMEZONE = "Europe/Rome"
DETAILED_S = 2.0
"""Seconds from frame to frame in detailed weeks."""
COARSE_S = 3.0
"""Seconds from frame to frame in earlier weeks.

An interval of 3 s counts 2 % fewer violations in this world than one of 2 s; 4 s counts 9 % fewer, which would look
like a change of the shop.
"""
HOTSPOT_AREA, REDESIGN_AREA = "checkout-queue", "entrance"
REDESIGN_TEXT = "Seasonal display moved from the door"
OUTAGE_CAMERA = "cam-3"


@dataclass(frozen=True, slots=True)
class _Planted:
    """Instants of what is planted, in the last week but for `earlier` and, with a history, the move."""

    moved_at: datetime
    outage: PlantedGap
    missing: PlantedGap
    low_data: PlantedGap
    earlier: tuple[PlantedGap, ...] = ()

    @property
    def gaps(self) -> tuple[PlantedGap, ...]:
        return self.outage, self.missing, self.low_data, *self.earlier


def write_demo_project(
    folder: Path,
    *,
    seed: int = 1,
    weeks: int = 2,
    last_week: str = "2026-W46",
    detailed_weeks: int = 2,
    progress: Callable[[int, int], None] | None = None,
) -> DemoTruth:
    """Make a project folder with a made-up shop and some weeks of engine output.

    The same arguments give the same bytes. Writes `vsd.toml`, `plans/`, `calibration/`, `pictures/`, `log.jsonl`,
    `engine/<camera>_<date>.jsonl.zst` (VSD frame messages, one file per camera and day) and `truth.json`. The last week
    contains an outage of one camera, an hour without data, an hour with little data, and a display that was moved
    before it began. With eight weeks or more there is a history (`simulate.history`); then the display was moved four
    weeks earlier.

    Args:
        folder: Project folder; made when missing.
        seed: Seed of the world.
        weeks: ISO weeks to make, the last being `last_week`.
        last_week: Last week, such as "2026-W46".
        detailed_weeks: How many of the last weeks have a frame every 2 s. Earlier weeks, and all weeks of a history,
            have one every 3 s and are about a third smaller. `vsd.toml` gives `hz` only if all have one every 2 s.
        progress: Called after each day with days done and days in all.

    Returns:
        What is planted and true; also in `truth.json`.

    Raises:
        UsageError: An argument is out of range (E101), or the folder already holds a project (E104).
    """
    mondays = mondays_until(last_week, weeks)
    if detailed_weeks < 1:
        raise UsageError(
            f"at least one week must be detailed, not {detailed_weeks}", fix="use detailed_weeks=1 or more"
        )
    if (folder / "vsd.toml").exists() or (folder / "engine").exists():
        raise UsageError(
            f"{folder} already holds a project",
            code="E104",
            where=Where(str(folder)),
            fix="choose a new or empty folder",
        )
    intervals = [DETAILED_S if weeks - i <= detailed_weeks else COARSE_S for i in range(weeks)]
    planted = _planted(mondays[-1])
    past = shop_history(mondays, cameras=tuple(c.camera_id for c in CAMERAS), timezone=TIMEZONE)
    if past is not None:
        intervals = [COARSE_S] * weeks
        planted = replace(planted, moved_at=past.moved_at, earlier=past.gaps)
    _write_site(
        folder,
        hz=1 / DETAILED_S if set(intervals) == {DETAILED_S} else None,
        closed=past.closed if past is not None else (),
        moved_at=planted.moved_at,
    )
    _write_log(folder / "log.jsonl", planted, past)

    sequence = dict.fromkeys((c.camera_id for c in CAMERAS), 0)
    hours: list[HourTruth] = []
    areas: list[AreaTruth] = []
    spots: NDArray[np.float64] = np.zeros((0, 2))
    n_messages = n_persons = 0
    for i, (monday, interval_s) in enumerate(zip(mondays, intervals, strict=True)):
        by_day, open_h = [], 0.0
        days = simulate_week(monday, seed=seed, interval_s=interval_s, moved_at=planted.moved_at, past=past)
        for k, day in enumerate(days):
            for camera in CAMERAS:
                camera_id = camera.camera_id
                messages = day_text(
                    day, camera, seed=seed, first_seq=sequence[camera_id], lost=_lost(day, camera_id, planted.gaps)
                )
                sequence[camera_id] += day.n_frames
                n_messages, n_persons = n_messages + messages.n_messages, n_persons + messages.n_persons
                write_messages(folder / "engine" / f"{camera_id}_{day.day.isoformat()}.jsonl.zst", messages.text)
            by_day.append(violations(in_view(day)))
            hours += hours_of(day)
            open_h += (day.closes - day.opens).total_seconds() / 3600
            if progress is not None:
                progress(7 * i + k + 1, 7 * weeks)
        week = week_name(monday)
        counts = {area: sum(int(v.inside(rect).sum()) for v in by_day) for area, rect in AREA_RECTS.items()}
        counts["floor"] = sum(len(v.frame) for v in by_day)
        areas += [AreaTruth(week, area, n, open_h) for area, n in counts.items()]
        hot = [v.inside(AREA_RECTS[HOTSPOT_AREA]) for v in by_day]
        spots = np.concatenate([np.stack([v.x_m[h], v.y_m[h]], axis=1) for v, h in zip(by_day, hot, strict=True)])

    truth = DemoTruth(
        seed=seed,
        weeks=tuple(week_name(m) for m in mondays),
        frame_interval_s=tuple(intervals),
        hotspot=_hotspot(areas[-len(AREA_RECTS) - 1 :], spots),
        outage=planted.outage,
        low_data=planted.low_data,
        missing=planted.missing,
        redesign=PlantedRedesign(
            planted.moved_at, REDESIGN_AREA, REDESIGN_TEXT, _effect(areas, REDESIGN_AREA, planted.moved_at)
        ),
        areas=tuple(areas),
        hours=tuple(hours),
        n_messages=n_messages,
        n_person_records=n_persons,
        idle=_idle(areas, past),
        lost=planted.earlier,
        closed=past.closed if past is not None else (),
    )
    truth.write(folder / "truth.json")
    return truth


def simulate_week(
    monday: date,
    *,
    seed: int = 1,
    interval_s: float = DETAILED_S,
    moved_at: datetime | None = None,
    past: ShopHistory | None = None,
) -> Iterator[SimulatedDay]:
    """Simulate the days of a week in opening hours.

    Args:
        monday: First local date.
        seed: Seed of the world.
        interval_s: Seconds from frame to frame.
        moved_at: When the display moves to its new place; None = never.
        past: How busy the shop was, and when it was closed; None = always alike, never closed.

    Yields:
        True positions, day by day.
    """
    for k in range(7):
        day = monday + timedelta(days=k)
        if past is not None and day in past.closed:
            continue
        opens, closes = opening(day)
        moved = moved_at is not None and opens >= moved_at
        busy = past.busy(day) if past is not None else 1.0
        yield simulate_day(opens, closes=closes, seed=seed, interval_s=interval_s, display_moved=moved, busy=busy)


def opening(day: date) -> tuple[datetime, datetime]:
    """Return opening and closing of the made-up shop on a local date: 08:00-21:00, Sundays 10:00-18:00."""
    start, end = (10, 18) if day.weekday() == 6 else (8, 21)
    zone = ZoneInfo(TIMEZONE)
    return datetime.combine(day, time(start), zone), datetime.combine(day, time(end), zone)


def mondays_until(last_week: str, weeks: int) -> list[date]:
    """Return the first days of so many ISO weeks, in order.

    Raises:
        UsageError: E101, there is no such week, or too many are asked for.
    """
    if not 1 <= weeks <= 520:
        raise UsageError(f"the number of weeks must be 1 to 520, not {weeks}", fix="use weeks=2")
    match = re.fullmatch(r"(\d{4})-W(\d{2})", last_week)
    try:
        last = date.fromisocalendar(int(match[1]), int(match[2]), 1) if match else None
        first = last - timedelta(weeks=weeks - 1) if last else None
    except (ValueError, OverflowError):
        first = last = None
    if first is None or last is None:
        raise UsageError(f"{last_week!r} is no ISO week", why="weeks are written like 2026-W46", fix='use "2026-W46"')
    return [first + timedelta(weeks=i) for i in range(weeks)]


def week_name(monday: date) -> str:
    """Return the name of an ISO week, such as "2026-W46"."""
    year, week, _ = monday.isocalendar()
    return f"{year}-W{week:02d}"


def _planted(monday: date) -> _Planted:
    def at(weekday: int, hour: int, minute: int = 0) -> datetime:
        return datetime.combine(monday + timedelta(days=weekday), time(hour, minute), ZoneInfo(TIMEZONE))

    every = tuple(c.camera_id for c in CAMERAS)
    return _Planted(
        moved_at=at(0, 6, 30),
        outage=PlantedGap((OUTAGE_CAMERA,), at(3, 13), at(4, 10)),
        missing=PlantedGap(every, at(1, 20), at(1, 21)),
        low_data=PlantedGap(every, at(6, 10) - timedelta(seconds=MARGIN_S), at(6, 10, 35)),
    )


def _lost(day: SimulatedDay, camera_id: str, gaps: tuple[PlantedGap, ...]) -> NDArray[np.bool_]:
    at_ms = day.frame_ms
    lost = np.zeros(day.n_frames, dtype=np.bool_)
    for gap in gaps:
        if camera_id in gap.cameras:
            lost |= (at_ms >= gap.start.timestamp() * 1000) & (at_ms < gap.end.timestamp() * 1000)
    return lost


def _hotspot(last: list[AreaTruth], spots: NDArray[np.float64]) -> PlantedHotspot:
    counts = {a.area_id: a.violations for a in last}
    inside, floor_m2 = free_area_m2(AREA_RECTS[HOTSPOT_AREA]), free_area_m2((0.0, 0.0, WIDTH_M, DEPTH_M))
    n = counts[HOTSPOT_AREA]
    elsewhere = (counts["floor"] - n) / (floor_m2 - inside)
    x, y = spots.mean(axis=0) if len(spots) else (0.0, 0.0)
    return PlantedHotspot(HOTSPOT_AREA, round(float(x), 2), round(float(y), 2), round(n / inside / elsewhere, 3))


def free_area_m2(rect: tuple[float, float, float, float]) -> float:
    """Return the free floor inside a rectangle, on a 5 cm raster, with the display in its new place."""
    xs, ys = np.meshgrid(np.arange(rect[0] + 0.025, rect[2], 0.05), np.arange(rect[1] + 0.025, rect[3], 0.05))
    return float(SHOP_AFTER.is_free(xs, ys).sum()) * 0.05**2


def _effect(areas: list[AreaTruth], area_id: str, at: datetime) -> float | None:
    """Return the rate of an area in the week of an instant over that of the week before."""
    rates = {a.week: a.violations / a.open_h for a in areas if a.area_id == area_id}
    now, before = (rates.get(week_name((at - timedelta(weeks=back)).date()), 0.0) for back in (0, 1))
    return round(now / before, 3) if before > 0 else None


def _idle(areas: list[AreaTruth], past: ShopHistory | None) -> PlantedRedesign | None:
    if past is None or past.idle.area_id is None:
        return None
    at, area_id = past.idle.at, past.idle.area_id
    return PlantedRedesign(at, area_id, past.idle.text, _effect(areas, area_id, at))


def _write_log(path: Path, planted: _Planted, past: ShopHistory | None) -> None:
    entries: tuple[dict[str, str | None], ...] = (
        {"at": planted.moved_at.isoformat(), "text": REDESIGN_TEXT, "area": REDESIGN_AREA},
        {
            "at": planted.missing.start.isoformat(),
            "text": "Network work for an hour, all cameras off.",
            "area": None,
        },
    )
    if past is not None:
        older = ({"at": e.at.isoformat(), "text": e.text, "area": e.area_id} for e in past.log)
        entries = tuple(sorted((*entries, *older), key=lambda e: datetime.fromisoformat(str(e["at"]))))
    path.write_text("".join(json.dumps(e) + "\n" for e in entries), encoding="utf-8")


def _write_site(folder: Path, *, hz: float | None, closed: Sequence[date], moved_at: datetime) -> None:
    """Write `vsd.toml` and the files it names."""
    for name in ("plans", "calibration", "pictures"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / "plans" / "ground.svg").write_text(plan_svg(), encoding="utf-8")
    for camera in CAMERAS:
        rows = "\n".join(" ".join(f"{value:.10g}" for value in row) for row in camera.homography)
        (folder / "calibration" / f"{camera.camera_id}.txt").write_text(f"{rows}\n", encoding="utf-8")
        (folder / "pictures" / f"{camera.camera_id}.png").write_bytes(picture(camera, SHOP_AFTER))
    (folder / "vsd.toml").write_text(_toml(hz, closed, moved_at), encoding="utf-8")


def _toml(hz: float | None, closed: Sequence[date], moved_at: datetime | None = None) -> str:
    blocks = [
        "# A made-up shop. Floor coordinates are metres from its lower left corner, x to the right, y up.",
        f'[site]\nid = "{SITE_ID}"\nname = "{SITE_NAME}"\ntimezone = "{TIMEZONE}"\n'
        'opening = { mon-sat = "08:00-21:00", sun = "10:00-18:00" }\ndistance_m = 2.0'
        + (f"\nclosed = {json.dumps([day.isoformat() for day in closed])}" if closed else ""),
        f'[[floor]]\nid = "ground"\nname = "Ground floor"\nplan = "plans/ground.svg"\nplan_m_per_px = {M_PER_PX}\n'
        "plan_origin_m = [0.0, 0.0]",
        "[report]\nhour_steps = [0, 100, 200, 300, 400]   # a busy shop: the timetable's colours start higher",
    ]
    rate = f"\nhz = {hz}" if hz else ""
    blocks += [
        f'[[camera]]\nid = "{camera.camera_id}"\nname = "{camera.name}"\nfloor = "ground"\n'
        f'homography = "calibration/{camera.camera_id}.txt"\n'
        f'picture = "pictures/{camera.camera_id}.png"   # {WIDTH_PX} x {HEIGHT_PX} px{rate}'
        for camera in CAMERAS
    ]
    for area in AREAS:
        blocks.append(
            f'[[area]]\nid = "{area.area_id}"\nname = "{area.name}"\nfloor = "{area.floor_id}"\n'
            f"polygon = {_corners(area.polygon)}"
        )
    for fixture in fixtures(moved_at):
        blocks.append(
            f'[[fixture]]\nid = "{fixture.fixture_id}"\nname = "{fixture.name}"\nfloor = "{fixture.floor_id}"\n'
            f"polygon = {_corners(fixture.polygon)}\n"
            + (f'kind = "{fixture.kind}"\n' if fixture.kind != "shelf" else "")
            + ("movable = true\n" if fixture.is_movable else "")
            + f"height_m = {fixture.height_m:g}\n"
            + (f"from = {fixture.valid_from.isoformat()}\n" if fixture.valid_from else "")
            + (f"to = {fixture.valid_to.isoformat()}\n" if fixture.valid_to else "")
        )
    return "\n\n".join(block.strip() for block in blocks) + "\n"


def _corners(polygon: Sequence[Point]) -> str:
    return "[" + ", ".join(f"[{x:g}, {y:g}]" for x, y in polygon) + "]"
