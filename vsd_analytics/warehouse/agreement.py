"""Whether vsd.toml still describes what is stored: its cameras, their floors and lives, and where its areas lie.

Figures are made of records by what vsd.toml says today. A deleted camera would take its past out of every figure, and a
camera with another floor would carry its past there. So nothing is computed until both agree.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from datetime import date, datetime, timedelta

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.errors import ConfigError, StoreError, VsdError, Where
from vsd_analytics.geometry.camera_views import Bounds, plan_bounds, view_polygon
from vsd_analytics.schema import TABLES
from vsd_analytics.site.model import Area, Camera, Floor, Site
from vsd_analytics.store.camera_floors import FILE as FLOORS
from vsd_analytics.store.camera_floors import note_floors, noted_floors
from vsd_analytics.store.erasures import RecordScope, rows_in_scope
from vsd_analytics.store.layout import HOUR_MS, Part, list_days
from vsd_analytics.store.seals import FOLDER, Seals
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.camera_days import day_path, day_units, read_days, weeks_of_days
from vsd_analytics.warehouse.factfiles import damaged_facts
from vsd_analytics.warehouse.owner_spans import FOREVER_MS, camera_life
from vsd_analytics.warehouse.sealed import SealedRange, sealed_range
from vsd_analytics.warehouse.units import PartIndex

CODE = "E321"
FILE = "vsd.toml"
SAMPLED_PARTS = 24
"""Files of person records whose extent is read where neither plan nor views tell how far a floor reaches."""
FARTHEST_M = 100.0
"""Corners of an area may lie this far, and three times the size of all that is known, beyond what is known."""
UNITS_M = {"centimetres": 0.01, "millimetres": 0.001, "feet": 0.3048}
"""Units in which corners are given by mistake, in metres."""


def refuse_disagreement(site: Site, cameras_of: Mapping[int, Collection[str]], sealed: SealedRange) -> None:
    """Raise ConfigError E321 where vsd.toml does not describe what is stored of some UTC days; else note the floors.

    Args:
        site: The project.
        cameras_of: Cameras with records by UTC day number.
        sealed: Hours whose records were purged and whose facts stay.
    """
    if problems := disagreements(site, cameras_of, sealed):
        n = len(problems)
        raise ConfigError(
            f"{FILE} does not describe what is stored",
            code=CODE,
            problems=tuple(problems),
            where=Where(FILE),
            why="figures of days that are over would change without a word",
            fix=f"change {FILE} as {'it says' if n == 1 else 'they say'} above; docs/camera-life.md",
        )
    floors = {camera.camera_id: camera.floor_id for camera in site.cameras}
    described = {floor.floor_id for floor in site.floors}
    note_floors(site.root / "store", {c: floors[c] for c in _present(cameras_of, sealed)}, described=described)


def disagreements(site: Site, cameras_of: Mapping[int, Collection[str]], sealed: SealedRange) -> list[VsdError]:
    """Return what vsd.toml does not describe, each with the lines that repair it; see `refuse_disagreement`."""
    noted = noted_floors(site.root / "store")
    cameras = {camera.camera_id: camera for camera in site.cameras}
    problems: list[VsdError] = []
    for camera_id in _present(cameras_of, sealed):
        camera = cameras.get(camera_id)
        if camera is None:
            problems.append(_undescribed(site, camera_id))
        elif moved := _moved(site, camera, noted.get(camera_id)):
            problems.append(moved)
        elif outside := _outside_life(site, camera, cameras_of, sealed):
            problems.append(outside)
    return [*problems, *areas_off(site)]


def stored_disagreements(site: Site) -> list[VsdError]:
    """Return what vsd.toml does not describe of everything stored; nothing is computed or written.

    Raises:
        StoreError: E302, E313, a file is damaged.
    """
    store = Store(site.root / "store", site_id=site.site_id)
    try:
        return _stored_disagreements(site, store)
    except (pa.ArrowException, UnicodeDecodeError) as error:
        store.refuse_damaged()
        raise damaged_facts(error) from None


def _stored_disagreements(site: Site, store: Store) -> list[VsdError]:
    index = PartIndex(store, first_hour=None, last_hour=None)
    units = {unit.number: unit for unit in day_units(index, index.hours(), site=site)}
    paths = weeks_of_days(site).joined_paths({number: day_path(site, unit) for number, unit in units.items()})
    known = read_days(site, [units[number] for number, path in paths.items() if path.exists()])
    cameras_of: dict[int, Collection[str]] = {number: day.cameras for number, day in known.items()}
    for number in units.keys() - known.keys():
        cameras_of[number] = {c for t in TABLES for part in units[number].parts[t] for c in _cameras_in(part)}
    return disagreements(site, cameras_of, sealed_range(site, None, None))


def _cameras_in(part: Part) -> list[str]:
    with pq.ParquetFile(part.path) as file:
        cameras: list[str] = pc.unique(file.read(columns=["camera_id"])["camera_id"]).to_pylist()
    return cameras


def _present(cameras_of: Mapping[int, Collection[str]], sealed: SealedRange) -> list[str]:
    """Return the cameras with records, in order."""
    return sorted({c for of_day in (*cameras_of.values(), *(u.last_ms for u in sealed.hours.values())) for c in of_day})


def _local_days(site: Site, camera_id: str) -> tuple[date, date]:
    """Return the first and last local day of everything stored of a camera; UTC hours are not looked into."""
    store, which = Store(site.root / "store", site_id=site.site_id), RecordScope(camera_id, -(2**53), 2**53)
    parts = sorted(part for table in TABLES for part in store.parts(table))
    ends = (next((p.hour for p in order if rows_in_scope(p.path, which)), None) for order in (parts, reversed(parts)))
    sealed = Seals(site.root / FOLDER, site_id=site.site_id).between(None, None)
    hours = [h for h in ends if h is not None] + [h for h, unit in sealed.items() if camera_id in unit.last_ms]
    first, last = (datetime.fromtimestamp(s, tz=site.zone) for s in (min(hours) * 3600, max(hours) * 3600 + 3599))
    return first.date(), last.date()


def _undescribed(site: Site, camera_id: str) -> VsdError:
    floor = noted_floors(site.root / "store").get(camera_id)
    floor_id = floor if floor in {f.floor_id for f in site.floors} else site.floors[0].floor_id
    of_floor = f'\nfloor = "{floor_id}"' if len(site.floors) > 1 else ""
    first, last = _local_days(site, camera_id)
    lines = f'[[camera]]\nid = "{camera_id}"\nname = "{camera_id}"{of_floor}\nto = "{last + timedelta(days=1)}"'
    return StoreError(
        f"records of camera {camera_id!r} are stored, and no [[camera]] describes it",
        code=CODE,
        why=f"its records of {first} to {last} would be missing from every figure; a camera that is taken down gets a "
        "last day and keeps its [[camera]]",
        fix=f"add its [[camera]] again, with its homography if it had one:\n{lines}\nor, to delete its records for "
        f"good: vsd purge --camera {camera_id} --range {first}..{last}",
    )


def _moved(site: Site, camera: Camera, noted: str | None) -> VsdError | None:
    # a floor that is described no longer was renamed: the camera hangs where it hung
    if noted in (None, camera.floor_id) or noted not in {f.floor_id for f in site.floors}:
        return None
    _, last = _local_days(site, camera.camera_id)
    return StoreError(
        f"camera {camera.camera_id!r} was on floor {noted!r} when its records came, and is on {camera.floor_id!r} now",
        code=CODE,
        why="its past would move to the other floor with it",
        fix=f'give its [[camera]] these lines:\nfloor = "{noted}"\nto = "{last + timedelta(days=1)}"\nand describe '
        "the camera at its new place in a [[camera]] with another id. If it always hung there, delete the note of the "
        f"wrong floor: rm store/{FLOORS}",
    )


def _outside_life(
    site: Site, camera: Camera, cameras_of: Mapping[int, Collection[str]], sealed: SealedRange
) -> VsdError | None:
    from_ms, to_ms = camera_life(site, camera)
    if (from_ms, to_ms) == (-FOREVER_MS, FOREVER_MS):
        return None
    is_late = _is_recorded(site, camera, cameras_of, sealed, to_ms, FOREVER_MS)
    if not is_late and not _is_recorded(site, camera, cameras_of, sealed, -FOREVER_MS, from_ms):
        return None
    first, last = _local_days(site, camera.camera_id)
    key, stated, day = ("to", camera.end_day, last) if is_late else ("from", camera.first_day, first)
    end = day + timedelta(days=1) if is_late else day
    outside = f"{stated}..{day}" if is_late else f"{day}..{(stated or day) - timedelta(days=1)}"
    return StoreError(
        f'camera {camera.camera_id!r} has records of {day}, and vsd.toml gives it {key} = "{stated}"',
        code=CODE,
        why="these records would count, and the hours of their day would not",
        fix=f'{key} = "{end}" in its [[camera]], or, to delete them for good: '
        f"vsd purge --camera {camera.camera_id} --range {outside}",
    )


def _is_recorded(
    site: Site,
    camera: Camera,
    cameras_of: Mapping[int, Collection[str]],
    sealed: SealedRange,
    first_ms: int,
    after_ms: int,
) -> bool:
    """Tell whether a camera has records in [first_ms, after_ms)."""
    if any(first_ms <= unit.last_ms.get(camera.camera_id, after_ms) < after_ms for unit in sealed.hours.values()):
        return True
    which = RecordScope(camera.camera_id, first_ms, after_ms)
    store = Store(site.root / "store", site_id=site.site_id)
    for number, cameras in cameras_of.items():
        first, last = max(number * 24, first_ms // HOUR_MS), min(number * 24 + 23, (after_ms - 1) // HOUR_MS)
        if camera.camera_id in cameras and first <= last:
            parts = (part for table in TABLES for part in store.parts(table, first_hour=first, last_hour=last))
            if any(rows_in_scope(part.path, which) for part in parts):
                return True
    return False


def areas_off(site: Site) -> Iterator[VsdError]:
    """Yield an error for each area that lies where its floor cannot be."""
    for floor in site.floors:
        areas = [a for a in site.areas if a.floor_id == floor.floor_id]
        known = _known_floor(site, floor) if areas else None
        if known is None:
            continue
        for area in areas:
            reach, is_plan = known
            if _lies_off(area.polygon, reach, is_plan):
                yield _area_off(area, reach, is_plan)


def _known_floor(site: Site, floor: Floor) -> tuple[Bounds, bool] | None:
    """Return how far a floor reaches, and whether a plan says so; None where nothing tells."""
    if (plan := plan_bounds(floor)) is not None:
        return plan, True
    cameras = [c for c in site.cameras if c.floor_id == floor.floor_id]
    views = [view_polygon(c, calibration=c.calibrations[-1] if c.calibrations else None) for c in cameras]
    boxes = [view.bounds for view in views if view is not None and not view.is_empty]
    boxes += _places(site)
    if not boxes:
        return None
    x0, y0, x1, y1 = (tuple(ends) for ends in zip(*boxes, strict=True))
    return (min(x0), min(y0), max(x1), max(y1)), False


def _places(site: Site) -> list[Bounds]:
    """Return the extents of the floor positions in the last files of person records, of all floors."""
    store = Store(site.root / "store", site_id=site.site_id)
    parts: list[Part] = []
    for day in reversed(list_days(store.root, "observations", site.site_id)):
        parts += store.parts("observations", first_hour=day * 24, last_hour=day * 24 + 23)
        if len(parts) >= SAMPLED_PARTS:
            break
    return [box for part in parts[:SAMPLED_PARTS] if (box := _extent(part)) is not None]


def _extent(part: Part) -> Bounds | None:
    metadata = pq.read_metadata(part.path)
    ends: dict[str, list[float]] = {"x_mm": [], "y_mm": []}
    for i in range(metadata.num_row_groups):
        for at in range(metadata.num_columns):
            column = metadata.row_group(i).column(at)
            noted = column.statistics
            if column.path_in_schema in ends and noted is not None and noted.has_min_max:
                ends[column.path_in_schema] += [noted.min / 1000, noted.max / 1000]
    if not ends["x_mm"] or not ends["y_mm"]:
        return None
    return min(ends["x_mm"]), min(ends["y_mm"]), max(ends["x_mm"]), max(ends["y_mm"])


def _lies_off(corners: Iterable[tuple[float, float]], known: Bounds, is_plan: bool) -> bool:
    """Tell whether corners lie where no floor can be.

    Off a plan: no corner box in common with it, or a corner farther from it than the plan is long. Without a plan: a
    corner farther from all that is known than `FARTHEST_M` and three times its size.
    """
    xs, ys = zip(*corners, strict=True)
    x0, y0, x1, y1 = known
    size = max(x1 - x0, y1 - y0)
    slack = size if is_plan else FARTHEST_M + 3 * size
    if min(xs) < x0 - slack or max(xs) > x1 + slack or min(ys) < y0 - slack or max(ys) > y1 + slack:
        return True
    return is_plan and (max(xs) < x0 or min(xs) > x1 or max(ys) < y0 or min(ys) > y1)


def _area_off(area: Area, known: Bounds, is_plan: bool) -> VsdError:
    reach = "x from {0:g} to {2:g} m and y from {1:g} to {3:g} m".format(*(round(v, 1) for v in known))
    fix = f"give the corners in metres of the floor, which has {reach}"
    for unit, metres in UNITS_M.items():
        corners = [[round(x * metres, 3), round(y * metres, 3)] for x, y in area.polygon]
        x0, y0, x1, y1 = known
        if all(x0 - 1 <= x <= x1 + 1 and y0 - 1 <= y <= y1 + 1 for x, y in corners):
            fix = f"if the corners are in {unit}, write in [[area]] {area.area_id!r}:\npolygon = {corners}"
            break
    return StoreError(
        f"area {area.area_id!r} lies off floor {area.floor_id!r}",
        code=CODE,
        why=f"{'the plan' if is_plan else 'what cameras see or recorded'} has {reach}, so nobody could ever be in it",
        fix=fix,
    )
