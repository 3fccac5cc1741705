"""Writes the made-up canteen as a project: `vsd.toml`, plan, change log, engine output."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import NamedTuple
from zoneinfo import ZoneInfo

import numpy as np

from vsd_analytics.simulate.canteen import (
    AREAS,
    DEPTH_M,
    FIXTURES,
    INTERVAL_S,
    REDESIGN_AREA,
    REDESIGN_TEXT,
    TIMEZONE,
    WIDTH_M,
    canteen_day,
)
from vsd_analytics.simulate.demo_project import mondays_until, week_name
from vsd_analytics.simulate.frame_messages import messages_text, write_messages
from vsd_analytics.simulate.history import MIN_WEEKS
from vsd_analytics.simulate.shop import polygon

SITE_ID = "canteen"
SITE_NAME = "Canteen"
CAMERA = "cam-1"
OPEN_DAYS = 5
_M_PER_PX = 0.025


class MadeUpWeeks(NamedTuple):
    """What was written.

    Attributes:
        weeks: Names of the ISO weeks.
        n_messages: Frame messages.
        n_person_records: Persons in all of them.
    """

    weeks: tuple[str, ...]
    n_messages: int
    n_person_records: int


def write_canteen_project(
    folder: Path,
    *,
    seed: int = 1,
    weeks: int = 2,
    last_week: str = "2026-W46",
    progress: Callable[[int, int], None] | None = None,
) -> MadeUpWeeks:
    """Make a project folder with a made-up canteen: one camera, open from 12 to 14 on Monday to Friday.

    The same arguments give the same bytes. The waiting places were marked before the last week began; with eight weeks
    or more, four weeks earlier.

    Args:
        folder: Project folder; made when missing.
        seed: Seed of the world.
        weeks: ISO weeks to make, the last being `last_week`.
        last_week: Last week, such as "2026-W46".
        progress: Called after each day with days done and days in all.

    Raises:
        UsageError: An argument is out of range (E101).
    """
    mondays = mondays_until(last_week, weeks)
    moved = mondays[-1] - timedelta(weeks=4 if weeks >= MIN_WEEKS else 0)
    moved_at = datetime.combine(moved, time(7), ZoneInfo(TIMEZONE))
    (folder / "plans").mkdir(parents=True, exist_ok=True)
    (folder / "plans" / "canteen.svg").write_text(_plan_svg(), encoding="utf-8")
    (folder / "vsd.toml").write_text(_toml(), encoding="utf-8")
    entry = {"at": moved_at.isoformat(), "text": REDESIGN_TEXT, "area": REDESIGN_AREA}
    (folder / "log.jsonl").write_text(json.dumps(entry) + "\n", encoding="utf-8")
    n_messages = n_persons = 0
    for i, monday in enumerate(mondays):
        for k in range(OPEN_DAYS):
            counts = _write_day(folder / "engine", monday + timedelta(days=k), seed=seed, is_after=monday >= moved,
                              first_seq=n_messages)  # fmt: skip
            n_messages, n_persons = n_messages + counts[0], n_persons + counts[1]
            if progress is not None:
                progress(OPEN_DAYS * i + k + 1, OPEN_DAYS * weeks)
    return MadeUpWeeks(tuple(week_name(m) for m in mondays), n_messages, n_persons)


def _write_day(folder: Path, day: date, *, seed: int, is_after: bool, first_seq: int) -> tuple[int, int]:
    rows = canteen_day(day, seed=seed, is_marked=is_after)
    n_frames = len(rows.frame_ms)
    messages = messages_text(
        CAMERA,
        rows.frame_ms,
        seq=first_seq + np.arange(n_frames, dtype=np.int64),
        counts=np.bincount(rows.frame, minlength=n_frames),
        track=rows.person,
        x_m=rows.x_m,
        y_m=rows.y_m,
    )
    write_messages(folder / f"{CAMERA}_{day.isoformat()}.jsonl.zst", messages.text)
    return messages.n_messages, messages.n_persons


def _plan_svg() -> str:
    """Return the outer walls, with a door at the left and one at the right; one unit is one plan pixel."""
    width, depth = WIDTH_M / _M_PER_PX, DEPTH_M / _M_PER_PX
    low, high = depth - 3 / _M_PER_PX, depth - 1 / _M_PER_PX
    right = width - 2
    wall = f"M2 {low:g}V2H{right:g}V{low:g}M{right:g} {high:g}V{depth - 2:g}H2V{high:g}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{depth:g}" '
        f'viewBox="0 0 {width:g} {depth:g}">\n'
        f'<path d="{wall}" fill="none" stroke="#4a4f57" stroke-width="4"/>\n</svg>\n'
    )


def _toml() -> str:
    blocks = [
        "# A made-up canteen. Floor coordinates are metres from its lower left corner, x to the right, y up.",
        f'[site]\nid = "{SITE_ID}"\nname = "{SITE_NAME}"\ntimezone = "{TIMEZONE}"\n'
        'opening = { mon-fri = "12:00-14:00" }\ndistance_m = 2.0',
        f'[[floor]]\nid = "ground"\nname = "Ground floor"\nplan = "plans/canteen.svg"\nplan_m_per_px = {_M_PER_PX}\n'
        "plan_origin_m = [0.0, 0.0]",
        f'[[camera]]\nid = "{CAMERA}"\nname = "Ceiling"\nfloor = "ground"\nhz = {1 / INTERVAL_S:.4f}',
    ]
    for area_id, (name, rect) in AREAS.items():
        blocks.append(f'[[area]]\nid = "{area_id}"\nname = "{name}"\npolygon = {_corners(rect)}')
    for fixture_id, (name, kind, rect) in FIXTURES.items():
        blocks.append(f'[[fixture]]\nid = "{fixture_id}"\nname = "{name}"\nkind = "{kind}"\npolygon = {_corners(rect)}')
    return "\n\n".join(blocks) + "\n"


def _corners(rect: tuple[float, float, float, float]) -> str:
    return "[" + ", ".join(f"[{x:g}, {y:g}]" for x, y in polygon(rect)) + "]"
