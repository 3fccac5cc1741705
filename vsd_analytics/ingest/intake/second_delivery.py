"""The question at the door: is this here already, in any spelling, or a second view of the same floor (W230, W231)?

Records whose key is stored count once in any case. What is left of the first records of a source is compared, by place
and time and without ids, with what is stored for its cameras and the other cameras of their floors, and with the
cameras beside them in the same source. Landmarks of earlier imports, a few places with their times, tell of a recording
that comes again at other times.
"""

from __future__ import annotations

import base64
import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Final

import numpy as np
import pyarrow as pa

from vsd_analytics.config.file_columns import METRES
from vsd_analytics.geometry.camera_views import view_polygon
from vsd_analytics.ingest.checks.check_case import SourceWarning
from vsd_analytics.ingest.intake.recording import (
    COARSE_M,
    SHARE_MIN,
    UNSHIFTED_MS,
    Floats,
    Ints,
    Match,
    Near,
    Recording,
    best_match,
    fine_m,
    key_of,
    lags_of,
)
from vsd_analytics.ingest.intake.stored_recordings import (
    KeyedRecords,
    evenly,
    newest_rows,
    rows_of,
    stored_rows,
    table_of,
)
from vsd_analytics.ingest.intake.unit_changes import UnitChange, change_between, change_within
from vsd_analytics.schema import TableName
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.store.imports import ImportLine, holdings, imports_of
from vsd_analytics.store.store import Store

SAMPLE_MAX: Final = 6_000
"""Records that are looked for."""
CAMERA_MAX: Final = 900
"""Those of one camera."""
DENSE_MAX: Final = 20_000
"""Records in succession, in which landmarks are looked for."""
RECORDS_MIN: Final = 20
"""Fewer records show nothing."""
SAME_SHARE: Final = 0.8
"""From this share of the records on it is the same recording; below it, a part of it."""
SURE: Final = 0.5
"""Least excess for another camera, another unit and other times."""
VIEW_SHARE, VIEW_M = 0.1, 0.5
"""Least excess of people whom two cameras see, within half a metre."""
LAG_MAX_S: Final = 90.0
"""Longest shift of times that is looked for among records of the same times."""
AROUND_S: Final = 340.0
CAMERAS_MAX: Final = 20
LANDMARKS: Final = 32
FINE_OF_MARKS_M: Final = 0.03
LANDMARKS_MIN: Final = 6
IMPORTS_MAX: Final = 100
"""Newest imports whose landmarks are looked for."""
MOVED_M: Final = 0.0101
MOVED_MIN, MOVED_SHARE = 10, 0.5
_OTHER_UNITS: Final = tuple(f for u in ("ft", "yd", "in", "cm", "mm") for f in (1 / METRES[u], METRES[u]))

Tables = Mapping[TableName, pa.Table]


@dataclass
class Door:
    """Compares the records of one source with what is stored.

    Attributes:
        site: The site.
        stores: Stores of its records, and of what the command has read before.
        import_id: The import of the source; "" = a dry run.
    """

    site: Site
    stores: Sequence[Store]
    import_id: str
    _kept: KeyedRecords | None = field(default=None, init=False)

    def look(self, head: Sequence[Tables]) -> list[SourceWarning]:
        """Return what is stored already of the first records, or seen by a second camera."""
        table = _table_of_all(head)
        rows = [t[table] for t in head if table in t and t[table].num_rows]
        if not rows:
            return []
        asked = rows_of(self.site, table, evenly(rows, SAMPLE_MAX))
        first = [pa.concat_tables(rows).slice(0, DENSE_MAX)]
        dense = rows_of(self.site, table, first, keyed_ms=np.zeros(0, dtype=np.int64))
        self._kept = dense
        if len(asked.recording) < RECORDS_MIN:
            return []
        warnings = self._beside_stored(table, asked)
        if not any(warning.code == "W230" for warning in warnings):
            warnings += self._at_other_times(table, asked, dense.recording)
        return [*warnings, *self._beside_each_other(asked.recording, dense), *self._other_units(table, dense)]

    def landmarks(self) -> str:
        """Return a few places of the first records with their times, as text: those where people are seldom."""
        if self._kept is None or len(self._kept.recording) < RECORDS_MIN:
            return ""
        recording = self._kept.recording
        squares = np.floor(recording.places / 0.1).astype(np.int64)
        _, of_row, n = np.unique(key_of(squares), return_inverse=True, return_counts=True)
        n_there = n[of_row.ravel()]
        seldom = recording.at(n_there <= np.quantile(n_there, 0.3)).some(LANDMARKS)
        packed = np.column_stack([seldom.ts_ms, np.rint(seldom.places * 1000).astype(np.int64)])
        return base64.b64encode(packed.astype("<i8").tobytes()).decode()

    def look_late(self, tables: Tables) -> list[str]:
        """Return what is stored already of later records, which are stored by then, as notes."""
        table = table_of(tables)
        if table not in tables or not tables[table].num_rows:
            return []
        asked = rows_of(self.site, table, evenly([tables[table]], SAMPLE_MAX // 4))
        back = f"; take it back: vsd purge --import {self.import_id}" if self.import_id else ""
        return [
            f"W229: of records behind the first ones, {w.what} ({w.code}): {w.why}; {w.fix}{back}"
            for w in self._beside_stored(table, asked)
        ]

    def _beside_stored(self, table: TableName, asked: KeyedRecords) -> list[SourceWarning]:
        """Compare records with those that are stored at their times."""
        stored = stored_rows(self.site, self.stores, table, asked.recording, around_s=AROUND_S, but=self.import_id)
        if not len(stored.recording):
            return []
        warnings = []
        if (moved := _other_places(asked, stored)) is not None:
            warnings.append(moved)
        fresh = asked.at(~np.isin(asked.key, stored.key[stored.key != 0]))
        for camera in _cameras(self.site, fresh.recording):
            here = fresh.recording.of_camera(camera.camera_id).some(CAMERA_MAX)
            n_all = int((asked.recording.camera == asked.recording.cameras.index(camera.camera_id)).sum())
            if len(here) >= RECORDS_MIN:
                warnings += self._of_camera(
                    camera, here, stored, share=len(here) / max(len(here), min(n_all, CAMERA_MAX))
                )
        return warnings[:3]

    def _of_camera(self, camera: Camera, here: Recording, stored: KeyedRecords, *, share: float) -> list[SourceWarning]:
        there = stored.recording
        own = there.of_camera(camera.camera_id)
        others = [c for c in self._without_views(camera) if c.camera_id in there.cameras]
        is_other = np.isin(there.camera, [there.cameras.index(c.camera_id) for c in others])
        close = there.at(is_other | (there.camera == _no(there, camera.camera_id)))
        fine = fine_m(here, close)
        marks = own.some(300) if len(own) else close.some(300)
        lags = [0, *(lag for lag, n in lags_of(Near(here, side_m=fine), marks.ts_ms, marks.places,
                                               within_m=fine, longest_s=LAG_MAX_S) if n >= 5)]  # fmt: skip
        found = best_match(here, close, lags_ms=lags, distances_m=[fine])
        if found is not None and (
            _is_own(camera, here, found) or _is_there(found, SHARE_MIN if _has_own(found, camera) else SURE)
        ):
            return [self._again(camera, here, found)]
        found = best_match(here, own, lags_ms=lags, distances_m=[max(fine, COARSE_M)])
        if found is not None and (_is_own(camera, here, found) or _is_there(found, SHARE_MIN)):
            return [self._again(camera, here, found)]
        for factor in _OTHER_UNITS:
            scaled = Recording(here.ts_ms, here.places / factor, here.camera, here.track, here.owner, here.cameras)
            within = min(max(fine / factor, fine), COARSE_M)
            found = best_match(scaled, own, lags_ms=lags[:1], distances_m=[within])
            if found is not None and _is_there(found, SURE):
                return [self._again(camera, here, found, factor=factor)]
        seen = there.at(is_other)
        return [self._second_view(camera, here, found)] if (found := _seen_by(here, seen)) is not None else []

    def _again(self, camera: Camera, here: Recording, found: Match, *, factor: float = 1.0) -> SourceWarning:
        other, record = found.other, found.record[found.is_near]
        names = [other.cameras[no] for no in np.unique(other.camera[record]).tolist()]
        owners = [other.owners[no] for no in _by_number(other.owner[record])]
        near_ms = here.ts_ms[found.is_near]
        of_whom = f"camera{'' if len(names) == 1 else 's'} {', '.join(names)}"
        as_whom = "" if camera.camera_id in names else f" and comes as camera {camera.camera_id}"
        how = "" if abs(found.lag_ms) < 5 else f", {found.lag_ms / 1000:+g} s apart"
        if factor != 1:
            how += f", and {factor:.3g} times as large"
        if found.share >= SAME_SHARE:
            purges = [f"`vsd purge --import {owner}`" for owner in owners[:5] if owner]
            instead = (
                f"; to have it in place of what is stored: {', '.join(purges)}, and import again" if purges else ""
            )
            return SourceWarning(
                f"the same recording is stored already, for {of_whom}{as_whom}: {found.share:.0%} of its records are "
                f"at the same places at the same times{how}",
                "people would be counted twice",
                f"leave it out{instead}",
                is_sure=True,
                code="W230",
            )
        first, last = _time(self.site, near_ms.min()), _time(self.site, near_ms.max())
        return SourceWarning(
            f"a part of it is stored already, for {of_whom}{as_whom}: {found.share:.0%} of its records, from {first} "
            f"to {last}, are at the same places at the same times{how}",
            "people would be counted twice in that time",
            "cut the file there, and import the rest",
            is_sure=True,
            code="W230",
        )

    def _at_other_times(self, table: TableName, asked: KeyedRecords, dense: Recording) -> list[SourceWarning]:
        """Compare records with earlier imports, whatever the times of these are, by their landmarks."""
        lines = [line for line in imports_of(self.site.root / "store").values() if line.landmarks]
        lines = [line for line in lines if not line.is_taken_back and line.id != self.import_id][-IMPORTS_MAX:]
        if not lines or len(dense) < RECORDS_MIN:
            return []
        held: Mapping[str, object] | None = None
        near = Near(dense, side_m=max(0.03, fine_m(dense)))
        for line in reversed(lines):
            marks_ms, marks = _marks(line)
            within_m = max(fine_m(dense), FINE_OF_MARKS_M)
            lags = lags_of(near, marks_ms, marks, within_m=min(within_m, near.side_m), n_most=2)
            if not lags or lags[0][1] < LANDMARKS_MIN or (len(lags) > 1 and lags[1][1] > lags[0][1] / 2):
                continue
            if held is None:
                held = holdings(Store(self.site.root / "store", site_id=self.site.site_id))
            lag_ms = lags[0][0]
            if line.id not in held or abs(lag_ms) <= 1000 * LAG_MAX_S / 2:
                continue
            here = asked.recording.some(CAMERA_MAX)
            shifted = Recording(here.ts_ms - lag_ms, here.places, here.camera, here.track, here.owner, here.cameras)
            stored = stored_rows(self.site, self.stores, table, shifted, around_s=AROUND_S, but=self.import_id)
            found = best_match(shifted, stored.recording, lags_ms=[0], distances_m=[fine_m(here, stored.recording)])
            if found is not None and _is_there(found, SURE / 2):
                return [_with_other_times(line, found, lag_ms)]
        return []

    def _beside_each_other(self, asked: Recording, dense: KeyedRecords) -> Iterator[SourceWarning]:
        """Compare the cameras of a source with each other."""
        done: set[str] = set()
        for camera in _cameras(self.site, asked) if len(asked.cameras) > 1 else ():
            done.add(camera.camera_id)
            recording = dense.recording
            others = [c for c in self._without_views(camera) if c.camera_id in recording.cameras]
            numbers = [recording.cameras.index(c.camera_id) for c in others if c.camera_id not in done]
            there = recording.at(np.isin(recording.camera, numbers))
            here = recording.of_camera(camera.camera_id).some(CAMERA_MAX)
            if len(here) < RECORDS_MIN or not len(there):
                continue
            if (found := _seen_by(here, there)) is not None:
                yield self._second_view(camera, here, found)
                return

    def _other_units(self, table: TableName, dense: KeyedRecords) -> Iterator[SourceWarning]:
        """Compare the spread and speed of each camera's people with what is stored of it, and within the source."""
        recording = dense.recording.at(dense.is_metric)
        for camera in _cameras(self.site, recording):
            here = recording.of_camera(camera.camera_id)
            change = change_within(here)
            if change is not None:
                yield _other_unit(camera, change, f"from {_time(self.site, change.from_ms)} on", is_inside=True)
                return
            past = self._past(table, camera, here)
            change = None if past is None else change_between(past, here)
            if change is not None:
                yield _other_unit(camera, change, "beside those that are stored", is_inside=False)
                return

    def _past(self, table: TableName, camera: Camera, here: Recording) -> Recording | None:
        """Return records of the camera that are stored nearest to some others; None = there are none."""
        rows = newest_rows(
            self.site, self.stores, table, camera, int(here.ts_ms[0]) if len(here) else 0, self.import_id
        )
        return None if rows is None else rows.recording.at(rows.is_metric)

    def _second_view(self, camera: Camera, here: Recording, found: Match) -> SourceWarning:
        other = found.other
        no = _by_number(other.camera[found.record[found.is_near]])[0]
        name = other.cameras[no]
        lines = [
            f'under [[camera]] id = "{c}": view = {view}'
            for c, view in ((camera.camera_id, _view(here)), (name, _view(other.at(other.camera == no))))
            if not self._has_view(c)
        ]
        return SourceWarning(
            f"cameras {camera.camera_id} and {name} see the same people: {found.share:.0%} of the records of "
            f"{camera.camera_id} are within {VIEW_M:g} m of one of {name}, and {found.chance:.0%} at other times",
            "without views, whoever is seen by both counts twice in all figures, until vsd.toml has them",
            f"say in vsd.toml what each camera sees: {'; '.join(lines)}",
            code="W231",
        )

    def _without_views(self, camera: Camera) -> list[Camera]:
        """Return the other cameras of a floor beside which it may count people twice."""
        same_floor = [c for c in self.site.cameras if c.floor_id == camera.floor_id and c is not camera]
        if not self._has_view(camera.camera_id):
            return same_floor
        return [c for c in same_floor if not self._has_view(c.camera_id)]

    def _has_view(self, camera_id: str) -> bool:
        camera = next(c for c in self.site.cameras if c.camera_id == camera_id)
        calibration = camera.calibrations[-1] if camera.calibrations else None
        return view_polygon(camera, calibration=calibration) is not None


def _other_unit(camera: Camera, change: UnitChange, where: str, *, is_inside: bool) -> SourceWarning:
    """Return the warning of positions that are larger by the factor of a unit, or smaller: W220."""
    unit, is_larger = change.unit, change.factor > 1
    before, after = change.speeds_m_s
    if is_inside:
        part = "the later part" if is_larger else "the earlier part"
        fix = f"cut the file there, and import {part} with --unit {unit}"
    elif is_larger:
        fix = f"--unit {unit}"
    else:
        fix = f"take the stored ones back, and import them with --unit {unit}: vsd imports, vsd purge --import ID"
    return SourceWarning(
        f"{where}, positions of camera {camera.camera_id} are {change.factor:.3g} times as large, and half of the "
        f"steps faster than {after:.2g} m/s in place of {before:.2g} m/s",
        f"one camera sees one floor: one of the two is in {unit}",
        fix,
        is_sure=True,
        code="W220",
    )


def _with_other_times(line: ImportLine, found: Match, lag_ms: int) -> SourceWarning:
    return SourceWarning(
        f"the same recording is stored already, with other times: import {line.id}; {found.share:.0%} of the records "
        f"are at the same places {_span(lag_ms)} {'later' if lag_ms > 0 else 'earlier'}",
        "people would be at the same places again, and be counted twice",
        f"take the first import back with `vsd purge --import {line.id}`, and import again",
        is_sure=True,
        code="W230",
    )


def _span(lag_ms: int) -> str:
    seconds = abs(lag_ms) / 1000
    for unit, name in ((86400, "days"), (3600, "hours"), (60, "minutes")):
        count = round(seconds / unit)
        if count and math.isclose(seconds, count * unit, abs_tol=1):
            return f"{count} {name[:-1] if count == 1 else name}"
    return f"{seconds:,.1f} s"


def _seen_by(here: Recording, there: Recording) -> Match | None:
    """Return how many people one other camera sees, of several; None where it is none."""
    found = best_match(here, there, lags_ms=[0], distances_m=[VIEW_M])
    if found is None or not _is_there(found, VIEW_SHARE):
        return None
    no = _by_number(found.other.camera[found.record[found.is_near]])[0]
    # the people of many cameras together are near by chance more often
    found = best_match(here, there.at(there.camera == no), lags_ms=[0], distances_m=[VIEW_M])
    return found if found is not None and _is_there(found, VIEW_SHARE) else None


def _is_there(found: Match, least: float) -> bool:
    """Return whether so many records are there as nobody meets by chance."""
    n = len(found.is_near)
    is_more = found.share >= 1.5 * found.chance or found.excess >= SURE
    return found.excess >= least and found.excess * n >= RECORDS_MIN / 2 and is_more


def _is_own(camera: Camera, here: Recording, found: Match) -> bool:
    """Return whether nearly everybody is where the same camera has somebody at the same time: no camera sees two there.

    This tells of people who do not move, whom other times have at the same places.
    """
    if abs(found.lag_ms) > UNSHIFTED_MS or found.within_m > COARSE_M:
        return False
    own_ms = found.other.of_camera(camera.camera_id).ts_ms
    if not len(own_ms):
        return False
    at = np.searchsorted(own_ms, here.ts_ms).clip(0, len(own_ms) - 1)
    away_ms = np.minimum(np.abs(own_ms[at] - here.ts_ms), np.abs(own_ms[at - 1] - here.ts_ms))
    is_seen = away_ms <= 1000
    return int(is_seen.sum()) >= RECORDS_MIN and bool(found.is_near[is_seen].mean() >= 0.9)


def _has_own(found: Match, camera: Camera) -> bool:
    record = found.record[found.is_near]
    own = _no(found.other, camera.camera_id)
    return bool(len(record)) and bool(np.mean(found.other.camera[record] == own) > 0.2)


def _no(recording: Recording, camera_id: str) -> int:
    return recording.cameras.index(camera_id) if camera_id in recording.cameras else -2


def _by_number(numbers: Ints) -> list[int]:
    """Return different numbers, the most frequent first."""
    values, n = np.unique(numbers, return_counts=True)
    return list(values[np.argsort(-n, kind="stable")].tolist())


def _other_places(asked: KeyedRecords, stored: KeyedRecords) -> SourceWarning | None:
    """Return the warning of a corrected export: most records that are stored already come at other places now."""
    has_track = asked.recording.track >= 0
    keys, at = np.unique(stored.key, return_index=True)
    no = np.searchsorted(keys, asked.key)
    no[no == len(keys)] = 0
    both = np.flatnonzero(has_track & (keys[no] == asked.key) & (asked.key != 0))
    there = at[no[both]]
    apart = np.abs(asked.recording.places[both] - stored.recording.places[there]).max(axis=1) if len(both) else both
    moved = there[np.asarray(apart) > MOVED_M]
    if len(both) < MOVED_MIN or len(moved) <= MOVED_SHARE * len(both):
        return None
    owner = stored.recording.owners[_by_number(stored.recording.owner[moved])[0]]
    remedy = f"--import {owner}" if owner else "--camera and --range, then the import again"
    return SourceWarning(
        f"{len(moved):,} of {len(both):,} records that were compared are stored already, at other places, and their "
        "first places stay",
        "a corrected export changes nothing while the first one is there",
        f"vsd purge {remedy} puts the new places in",
        code="W230",
    )


def _cameras(site: Site, recording: Recording) -> list[Camera]:
    return [c for c in site.cameras if c.camera_id in recording.cameras][:CAMERAS_MAX]


def _view(recording: Recording) -> str:
    """Return the rectangle of nearly all places as the value of `view`."""
    low, high = np.quantile(recording.places, [0.005, 0.995], axis=0)
    (left, bottom), (right, top) = np.floor(low * 10 - 1) / 10, np.ceil(high * 10 + 1) / 10
    corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    return "[" + ", ".join(f"[{x:.1f}, {y:.1f}]" for x, y in corners) + "]"


def _time(site: Site, ms: int) -> str:
    return datetime.fromtimestamp(int(ms) / 1000, tz=UTC).astimezone(site.zone).isoformat(sep=" ", timespec="seconds")


def _marks(line: ImportLine) -> tuple[Ints, Floats]:
    with contextlib.suppress(ValueError):
        packed = np.frombuffer(base64.b64decode(line.landmarks), dtype="<i8").reshape(-1, 3)
        return packed[:, 0].astype(np.int64), packed[:, 1:] / 1000
    return np.zeros(0, dtype=np.int64), np.zeros((0, 2))


def _table_of_all(head: Sequence[Tables]) -> TableName:
    return "observations" if any(table_of(tables) == "observations" for tables in head) else "pairs"
