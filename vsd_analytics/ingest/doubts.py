"""What looks wrong about a source before any of it is stored: each doubt with its reason and what fixes it."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import date, timedelta
from itertools import chain
from typing import Final

import numpy as np

from vsd_analytics.config.file_columns import FILE_BOX, METRES
from vsd_analytics.geometry.picture_size import picture_size
from vsd_analytics.ingest.adapter import IngestOptions
from vsd_analytics.ingest.instants import utc_to_local
from vsd_analytics.ingest.sample import Sample
from vsd_analytics.ingest.table_head import TableHead
from vsd_analytics.ingest.telling_names import OBJECTS, PERSON, VAGUE, ids_like, letters, named_like
from vsd_analytics.ingest.units import LENGTHS, PIXELS, unit_in_name
from vsd_analytics.site.model import Camera, Site

SPEED_MAX_M_S: Final = 8.0
"""Nobody's usual speed: a sprint. Millimetres read as metres give 1,000 m/s, pixels about 100."""
USUAL_SHARE: Final = 0.5
"""Positions beyond `coordinate_max_m` are single bad rows while at least this share is within it."""
SPAN_MAX_M: Final = 200.0
"""Without a plan, positions further apart than this come from a wrong unit rather than from one floor."""
PAIR_MAX_M: Final = 50.0
"""No engine measures mostly pairs further apart than this."""
ROWS_MIN: Final = 10
"""Fewer records show no pattern."""
NEAR_M: Final = 2.0
_DAY_MS, _MINUTE_MS = 86_400_000, 60_000


@dataclass(frozen=True, slots=True)
class Doubt:
    """One thing that looks wrong.

    Attributes:
        code: "W220" to "W226".
        what: What was seen.
        why: Why it matters.
        fix: The option or line of vsd.toml that settles it.
        is_sure: Almost surely wrong: nothing of the source is stored unless the user says so.
        is_note: Good to know, and perhaps as it should be: an ingest does not ask for attention.
    """

    code: str
    what: str
    why: str
    fix: str
    is_sure: bool = False
    is_note: bool = False


@dataclass(frozen=True, slots=True)
class Case:
    """All that a doubt may look at.

    Attributes:
        site: The site.
        options: What the user says, completed from vsd.toml.
        sample: The first records.
        head: The columns, for tables; None for formats without columns of the user's choice.
    """

    site: Site
    options: IngestOptions
    sample: Sample
    head: TableHead | None

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """Return the cameras of the site that records of the sample name."""
        named = set(self.sample.rows["camera"].dropna().unique())
        return tuple(c for c in self.site.cameras if named & {c.camera_id, *c.engine_ids})

    def is_settled_by_where(self, column: str) -> bool:
        """Return whether the user's filter names a column."""
        return self.head is not None and column in self.head.plan.compared


def doubts_of(case: Case) -> tuple[Doubt, ...]:
    """Return what looks wrong, almost sure mistakes first."""
    found = chain.from_iterable(look(case) for look in _LOOKS)
    return tuple(sorted(found, key=lambda doubt: not doubt.is_sure))


def floor_bounds_m(case: Case) -> tuple[float, float, float, float] | None:
    """Return the rectangle of the plans, or of the stated views, of the cameras.

    Least x, largest x, least y, largest y, in metres; None where neither is known for all of them.
    """
    boxes = []
    floors = {f.floor_id: f for f in case.site.floors}
    for camera in case.cameras:
        floor = floors.get(camera.floor_id)
        size = None
        if floor is not None and floor.plan is not None and floor.plan_m_per_px is not None:
            size = picture_size(floor.plan)
        if floor is not None and size is not None and floor.plan_m_per_px is not None:
            (x, y), scale = floor.plan_origin_m, floor.plan_m_per_px
            boxes.append((x, x + size[0] * scale, y, y + size[1] * scale))
        elif camera.view:
            xs, ys = zip(*camera.view, strict=True)
            boxes.append((min(xs), max(xs), min(ys), max(ys)))
        else:
            return None
    if not boxes:
        return None
    low_x, high_x, low_y, high_y = zip(*boxes, strict=True)
    return min(low_x), max(high_x), min(low_y), max(high_y)


def picture_px(case: Case) -> tuple[int, int] | None:
    """Return width and height of the cameras' pictures; None where they are not known or differ."""
    sizes = {c.picture_px for c in case.cameras}
    return sizes.pop() if len(sizes) == 1 else None


def _units(case: Case) -> Iterator[Doubt]:
    """W220: positions that are not metres."""
    names: Mapping[str, str] = {} if case.head is None else case.head.plan.names
    for ours, theirs in names.items():
        unit = unit_in_name(theirs) if theirs.lower() != ours else None
        if ours in LENGTHS and unit == PIXELS:
            yield Doubt(
                "W220",
                f"{ours} is read from {theirs[:80]!r}, which names pixels",
                "pixels are no metres: distances would be hundreds of times too large",
                "--map u_px=...,v_px=... for points of the picture; the camera needs a calibration",
                is_sure=True,
            )
        elif (ours in FILE_BOX or ours in ("u_px", "v_px")) and unit in METRES:
            yield Doubt(
                "W220",
                f"{ours} is read from {theirs[:80]!r}, which names a unit of length",
                "lengths on the floor are no pixels",
                "--map x_m=...,y_m=... : columns that name their unit are converted to metres",
                is_sure=True,
            )
    sample, rows = case.sample, case.sample.rows
    unit = "--unit mm (or cm, ft) if they are lengths; --map u_px=...,v_px=... if they are pixels"
    if sample.is_pairs:
        apart = rows["distance_m"].dropna()
        if len(apart) >= ROWS_MIN and (median := float(apart.median())) > PAIR_MAX_M:
            what = f"half of the pairs are more than {median:,.0f} m apart"
            yield Doubt("W220", what, "distances in millimetres or centimetres look like this", unit, is_sure=True)
    if not sample.has_floor or sample.is_pairs:
        return
    speeds = sample.speeds_m_s()
    if len(speeds) >= ROWS_MIN and (median := float(np.median(speeds))) > SPEED_MAX_M_S:
        what = f"people would move at {median:,.0f} m/s: half of the steps are faster"
        yield Doubt("W220", what, "positions are hardly in metres, or ids change people", unit, is_sure=True)
    is_walking = len(speeds) >= ROWS_MIN and 0 < float(np.median(speeds)) <= SPEED_MAX_M_S
    yield from _far_out(case, unit, is_walking=is_walking)


def _far_out(case: Case, unit: str, *, is_walking: bool) -> Iterator[Doubt]:
    """W220: positions beyond the floor. People who move as fast as people do are in metres, on a large floor."""
    places = case.sample.rows[["x", "y"]].dropna()
    is_stored = (places.abs() <= case.site.settings.coordinate_max_m).all(axis=1)
    if is_stored.mean() >= USUAL_SHARE:  # the others are bad rows, which go to quarantine and say nothing of the unit
        places = places[is_stored]
    if len(places) < ROWS_MIN:
        return
    x, y = places["x"].to_numpy(), places["y"].to_numpy()
    n_ids = case.sample.rows["track"].nunique()
    if len(places) >= 5 * ROWS_MIN and n_ids > 2 and ((x >= 0) & (x <= 1) & (y >= 0) & (y <= 1)).all():
        what = f"{n_ids:,} people would all be within one square metre: every position is between 0 and 1"
        why = "shares of a picture or of a plan look like this"
        fix = "--map u_px=...,v_px=... with --size WIDTHxHEIGHT if they are shares of the picture"
        yield Doubt("W220", what, why, fix, is_sure=True)
        return
    extent = replace(case.sample, rows=places).extent("x", "y", tail=0.05)
    assert extent is not None
    shown = f"x {extent[0]:,.1f} to {extent[1]:,.1f} m, y {extent[2]:,.1f} to {extent[3]:,.1f} m"
    bounds = floor_bounds_m(case)
    if bounds is None:
        if max(extent[1] - extent[0], extent[3] - extent[2]) > SPAN_MAX_M:
            why = f"most floors are smaller than {SPAN_MAX_M:g} m; other units look like this"
            yield Doubt("W220", f"positions reach over {shown}", why, unit, is_sure=not is_walking)
        return
    left, right, low, high = bounds
    outside = f"the plan or view reaches over x {left:,.1f} to {right:,.1f} m, y {low:,.1f} to {high:,.1f} m"

    def share_beyond(more_x: float, more_y: float) -> float:
        is_in = (x >= left - more_x) & (x <= right + more_x) & (y >= low - more_y) & (y <= high + more_y)
        return 1.0 - float(is_in.mean())

    far = share_beyond(max(5.0, (right - left) / 4), max(5.0, (high - low) / 4))
    near = share_beyond(NEAR_M, NEAR_M)
    if far > 0.5:
        what = f"{far:.0%} of the positions are far outside the floor: {shown}"
        yield Doubt("W220", what, outside, f"{unit}; or correct plan_origin_m and plan_m_per_px", is_sure=True)
    elif near > 0.1:
        what = f"{near:.0%} of the positions are outside the floor: {shown}"
        yield Doubt("W220", what, outside, f"{unit}; or correct plan_origin_m and plan_m_per_px")


def _cameras(case: Case) -> Iterator[Doubt]:
    """W221: a column of cameras that is not read."""
    if case.head is None or "camera_id" in case.head.plan.theirs:
        return
    for column in named_like(case.head.values, "camera"):
        values = case.head.values[column]
        if len(values) < 2 or case.is_settled_by_where(column):
            continue
        if len(values) > 50 and len(values) > sum(values.values()) / 10:  # such as the picture's file name
            continue
        shown = ", ".join(value[:20] for value, _ in values.most_common(4))
        yield Doubt(
            "W221",
            f"{column[:80]!r} names {len(values)} cameras ({shown}), and all rows go to {case.options.camera}",
            "people of several places would be counted as if they stood together",
            f"--map camera_id={column} (and engine_ids in vsd.toml), or --where \"{_quoted(column)} = '...'\"",
            is_sure=True,
        )


def _classes(case: Case) -> Iterator[Doubt]:
    """W222: rows that are no people."""
    if case.head is None or case.sample.is_pairs:
        return
    if any(letters(column) not in VAGUE for column in named_like(case.head.plan.compared, "class")):
        return  # who filters by the class's name need not filter by its number as well
    for column in named_like(case.head.values, "class"):
        values = case.head.values[column]
        others = [value for value in values if not _is_person(value)]
        if not others or case.is_settled_by_where(column):
            continue
        words = {letters(value) for value in values}
        if letters(column) in VAGUE and not words & (PERSON | OBJECTS):
            continue
        people = [value for value in values if _is_person(value)]
        wanted = people[0] if people else "person"
        is_sure = len(values) > 1 or bool(words & OBJECTS) or not all(v.isdecimal() for v in others)
        n_others = sum(values[value] for value in others)
        yield Doubt(
            "W222",
            f"{column[:80]!r} has other values than persons: {', '.join(v[:20] for v in others[:5])} "
            f"({n_others:,} of {sum(values.values()):,} rows)",
            "every row would count as a person",
            f'--where "{_quoted(column)} = {wanted if wanted.isdecimal() else repr(wanted)}"',
            is_sure=is_sure,
        )


def _is_person(value: str) -> bool:
    """Return whether a class is people: a word for them, also with a number behind it, or class 0 of COCO."""
    return letters(value) in PERSON or value in ("0", "0.0")


def _zones(case: Case) -> Iterator[Doubt]:
    """W223: times without an offset, in a zone that nobody stated."""
    site, sample = case.site, case.sample
    if case.options.zone is not None or not sample.n:
        return
    stated = {name for c in site.cameras if c.has_clock for name in (c.camera_id, *c.engine_ids)}
    is_assumed = (sample.zones != "") & ~sample.rows["camera"].isin(stated).to_numpy()
    if not is_assumed.any():
        return
    zone = str(sample.zones[is_assumed][0])
    ts_ms = sample.rows["ts_ms"].to_numpy()[is_assumed].astype(np.int64)
    written = utc_to_local(ts_ms, zone)
    here, there = utc_to_local(ts_ms, site.timezone), written
    if (here == there).all():
        return
    as_read, as_local = (f"{_clock(int(local.min()))} to {_clock(int(local.max()))}" for local in (here, there))
    shares = ""
    if site.opening is not None:
        open_as_read, open_as_local = open_share(here, site), open_share(there, site)
        shares = f"; {open_as_read:.0%} and {open_as_local:.0%} of the records would be in opening hours"
    camera = next((c.camera_id for c in (*case.cameras, *site.cameras)), "cam-1")
    yield Doubt(
        "W223",
        f"times have no offset and are taken as {zone}: in {site.timezone} they are {as_read}",
        f"if they are on the clock of the site, they are {as_local}{shares}",
        f'--zone {site.timezone} or --zone {zone}; for good: clock = "{site.timezone}" under [[camera]] {camera}',
    )


def _clock(local_ms: int) -> str:
    day = date(1970, 1, 1) + timedelta(days=local_ms // _DAY_MS) if abs(local_ms) < 2**47 else None
    minutes = local_ms % _DAY_MS // _MINUTE_MS
    return f"{day} {minutes // 60:02d}:{minutes % 60:02d}"


def open_share(local_ms: np.ndarray, site: Site) -> float:
    """Return the share of local times in opening hours; the small hours belong to the day before where it is open."""
    if site.opening is None:
        return 1.0
    days, minutes = local_ms // _DAY_MS, local_ms % _DAY_MS / _MINUTE_MS
    closed = {(day - date(1970, 1, 1)).days for day in site.closed}
    is_open = np.zeros(len(local_ms), dtype=bool)
    for back in (0, 1):
        weekday = (days - back + 3) % 7  # 1970-01-01 was a Thursday
        is_closed = np.isin(days - back, list(closed))
        for day, spans in enumerate(site.opening):
            for start, end in spans:
                at = minutes + back * 24 * 60
                is_open |= (weekday == day) & ~is_closed & (at >= start) & (at < end)
    return float(is_open.mean()) if len(is_open) else 0.0


def _merging(case: Case) -> Iterator[Doubt]:
    """W224: records that a fold leaves out, because times are too coarse."""
    sample = case.sample
    if sample.n < ROWS_MIN or case.options.period_s is not None:
        return
    ts_ms = sample.rows["ts_ms"].to_numpy().astype(np.int64)
    zones = [zone for zone in np.unique(sample.zones) if zone]
    local = utc_to_local(ts_ms, zones[0]) if len(zones) == 1 and (sample.zones != "").all() else ts_ms
    n_second, n_instants = sample.n_second(), len(np.unique(ts_ms))
    share = n_second / sample.n
    if case.head is not None and "ts" in case.head.plan.theirs and not (local % _DAY_MS).any():
        times = named_like(case.head.ignored, "time")
        theirs = case.head.plan.names["ts"]
        yield Doubt(
            "W224",
            "all times are midnight: ts seems to be a date without the time of day",
            f"{n_second:,} of {sample.n:,} rows would be left out as second sightings; the others would be one frame",
            f"--map ts={theirs}+{times[0] if times else 'TIME'}",
            is_sure=True,
        )
    elif share > 0.5:
        is_coarse = not (local % _MINUTE_MS).any()
        why = "a person has one place at a time; " + (
            "the times are whole minutes, so that frames of one minute cannot be distinguished"
            if is_coarse
            else "the times are days since 1899, as Excel counts them: export them as text"
            if 20_000_000 < np.median(ts_ms) < 80_000_000
            else "the times are too coarse, or the ids belong to several people"
        )
        fix = "export times with seconds and parts of seconds; or keep one record of each period: --period "
        yield Doubt(
            "W224",
            f"{n_second:,} of {sample.n:,} rows would be left out as second sightings",
            why,
            fix + ("60" if is_coarse else "1"),
            is_sure=True,
        )
    elif case.head is not None and not (local % _MINUTE_MS).any() and not sample.has_ids and sample.n >= 5 * n_instants:
        yield Doubt(
            "W224",
            f"the times are whole minutes: {sample.n:,} rows have {n_instants:,} different times",
            "all rows of a minute would be one frame, and all their people close to each other at once",
            "export times with seconds; if there is one frame a minute: --period 60",
            is_sure=True,
        )
    elif share > 0.05:
        yield Doubt(
            "W224",
            f"{n_second:,} of {sample.n:,} rows would be left out as second sightings",
            "a person has one place at a time; the times may be too coarse, or ids belong to several people",
            "export times with parts of seconds; --period N keeps one record of each period",
        )


def _ids(case: Case) -> Iterator[Doubt]:
    """W225: no ids, or ids that do not last."""
    sample = case.sample
    if sample.is_pairs or not sample.n:
        return
    why = "a violation needs the same two people for 3 seconds; records, person-hours and maps are not concerned"
    like = [] if case.head is None else ids_like(case.head.ignored)
    named = f"--map {shlex.quote('track_id=' + (like[0] if like else '...'))}"
    if case.head is not None and not sample.has_ids:
        what = "there are no track ids: violations cannot be counted"
        fix = named if like else "export the tracker's ids, and map them: --map track_id=..."
        yield Doubt("W225", what, why, fix, is_note=not like)
        return
    if sample.has_ids:
        n_records = sample.rows["track"].value_counts()
        n_frames = sample.rows["ts_ms"].nunique()
        if len(n_records) >= 2 * ROWS_MIN and n_frames >= 3 and float((n_records == 1).mean()) > 0.9:
            what = f"{len(n_records):,} track ids, and nearly each has one record: they do not last"
            yield Doubt("W225", what, why, f"map the id of the track, not of the detection or row: {named}")


def _pixels(case: Case) -> Iterator[Doubt]:
    """W226: positions in the picture that are no pixels of it."""
    sample = case.sample
    places = sample.rows[["u", "v"]].dropna()
    if len(places) < 3 or sample.has_floor:
        return
    names = {} if case.head is None else case.head.plan.names
    centre = [theirs for ours, theirs in names.items() if ours in ("left", "top") and "cent" in theirs.lower()]
    if centre:
        what = f"a box's corner is read from {centre[0][:80]!r}, which names its centre"
        fix = "--map center_x=...,center_y=...,width=...,height=..."
        yield Doubt("W226", what, "foot points would be half a box away", fix, is_sure=True)
    u, v = places["u"].to_numpy(), places["v"].to_numpy()
    size = picture_px(case)
    if ((u >= -0.1) & (u <= 1.1) & (v >= -0.1) & (v <= 1.1)).all():
        shown = "1280x720" if size is None else f"{size[0]}x{size[1]}"
        yield Doubt(
            "W226",
            "all positions are between 0 and 1: shares of the picture, not pixels",
            "everybody would stand on one pixel",
            f"--size {shown} (width and height of the picture) converts them",
            is_sure=True,
        )
        return
    if size is None or len(places) < ROWS_MIN:
        return
    width, height = size
    beyond = float(((u < -0.02 * width) | (u > 1.02 * width) | (v < -0.02 * height) | (v > 1.1 * height)).mean())
    is_percent = u.max() <= 100 and v.max() <= 100 and min(size) >= 300
    if is_percent and max(u.max(), v.max()) > 20:
        yield Doubt(
            "W226",
            f"all positions are between 0 and 100, and the picture has {width} x {height} pixels: percents of it?",
            "everybody would stand in its upper left corner",
            "export pixels, or shares of 0 to 1 with --size",
            is_sure=True,
        )
        return
    is_corner = np.quantile(u, 0.99) < 0.05 * width and np.quantile(v, 0.99) < 0.05 * height
    if beyond > 0.1 or is_corner:
        extent = sample.extent("u", "v")
        assert extent is not None
        where = f"u {extent[0]:,.0f} to {extent[1]:,.0f}, v {extent[2]:,.0f} to {extent[3]:,.0f}"
        yield Doubt(
            "W226",
            f"positions do not fit the picture of {width} x {height} pixels: {where}",
            "the engine's pictures may have another resolution, or the positions another unit",
            "calibrate with the resolution that the engine works at; --map x_m=...,y_m=... if they are metres",
            is_sure=beyond > 0.5 or is_corner,
        )


def _quoted(column: str) -> str:
    """Return a column as `--where` names it."""
    is_plain = column.replace("_", "a").isalnum() and not column[:1].isdigit()
    return column if is_plain else f'\\"{column}\\"'


_LOOKS: tuple[Callable[[Case], Iterator[Doubt]], ...] = (
    _units,
    _cameras,
    _classes,
    _zones,
    _merging,
    _ids,
    _pixels,
)
