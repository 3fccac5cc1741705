"""The question at the door: is this here already, in any spelling, or a second view of the same floor (W230, W231)?

Records whose key is stored count once in any case. What is left of the first records of a source is compared, by place
and time and without ids, with what is stored for its cameras and the other cameras of their floors, and with the
cameras beside them in the same source. Landmarks of earlier imports, a few places with their times, tell of a recording
that comes again at other times.
"""

from __future__ import annotations

import base64
import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

import numpy as np
import pyarrow as pa

from vsd_analytics.config.file_columns import METRES
from vsd_analytics.geometry.camera_views import view_polygon
from vsd_analytics.ingest.checks.check_case import SourceWarning
from vsd_analytics.ingest.intake.delivery_warnings import (
    SAME_SHARE,
    VIEWS_M,
    by_number,
    other_places,
    other_unit,
    same_again,
    same_beside,
    second_view,
    time_text,
    with_other_times,
)
from vsd_analytics.ingest.intake.recording import (
    COARSE_M,
    FINE_M,
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
    match,
    match_beside,
)
from vsd_analytics.ingest.intake.stored_recordings import (
    KeyedRecords,
    ReadPart,
    Spool,
    at_instants,
    evenly,
    newest_rows,
    on_floors,
    read_part,
    rows_of,
    stored_tables,
    table_of,
)
from vsd_analytics.ingest.intake.unit_changes import change_between, change_within
from vsd_analytics.schema import TableName
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.store.imports import ImportLine, holdings, imports_of
from vsd_analytics.store.store import Store

SAMPLE_MAX: Final = 6_000
"""Records that are looked for."""
KNOWN_MAX: Final = 500
"""Those that are looked for first: where all are stored, so are hardly less than 99 % of the records."""
CAMERA_MAX: Final = 900
"""Those of one camera."""
DENSE_MAX: Final = 20_000
"""Records in succession, in which landmarks are looked for."""
RECORDS_MIN: Final = 20
"""Fewer records show nothing."""
SURE: Final = 0.5
"""Least excess for another camera, another unit and other times."""
VIEW_SHARE: Final = 0.1
"""Least excess of people whom two cameras see."""
CLEAR_M, EQUAL_SHARE, SAME_INSTANT_S = 0.03, 0.97, 0.005
"""Two cameras that see one person are hardly ever this near, and so many of their places never equal."""
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
    _read: ReadPart = field(default_factory=lambda: lru_cache(maxsize=2)(read_part), init=False)
    # each batch of a source lies in the hours of the one before
    _spool: Spool = field(init=False)

    def __post_init__(self) -> None:
        self._spool = Spool(self.import_id)

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
        rows = self._stored(table, asked.recording)
        if not any(part.num_rows for part in rows) or self._is_known(table, asked, rows):
            return []
        stored = rows_of(self.site, table, rows, keyed_ms=asked.recording.ts_ms)
        warnings = []
        if (elsewhere := _other_places(self.site, asked, stored)) is not None:
            warnings.append(elsewhere)
        fresh = asked.at(~np.isin(asked.key, stored.key[stored.key != 0]))
        for camera in _cameras(self.site, fresh.recording):
            here = fresh.recording.of_camera(camera.camera_id).some(CAMERA_MAX)
            if len(here) >= RECORDS_MIN:
                warnings += self._of_camera(camera, here, stored)
        return warnings[:3]

    def _stored(self, table: TableName, here: Recording) -> list[pa.Table]:
        return stored_tables(self.site, self.stores, table, here, around_s=AROUND_S, spool=self._spool, read=self._read)

    def _is_known(self, table: TableName, asked: KeyedRecords, rows: Sequence[pa.Table]) -> bool:
        """Return whether some of the records are all stored as they are: the same file again needs no closer look."""
        some = asked.at(np.linspace(0, len(asked.recording) - 1, min(KNOWN_MAX, len(asked.recording))).astype(np.int64))
        ts_ms = some.recording.ts_ms
        stored = rows_of(self.site, table, at_instants(rows, ts_ms), keyed_ms=ts_ms)
        return bool(np.isin(some.key, stored.key).all()) and _other_places(self.site, some, stored, share=0.0) is None

    def _of_camera(self, camera: Camera, here: Recording, stored: KeyedRecords) -> list[SourceWarning]:
        there = stored.recording
        own = there.of_camera(camera.camera_id)
        others = [c for c in self._without_views(camera) if c.camera_id in there.cameras]
        numbers = frozenset(there.cameras.index(c.camera_id) for c in others)
        close = there.of_cameras(numbers | {_no(there, camera.camera_id)})
        fine = fine_m(here, close)
        marks = own.some(300) if len(own) else close.some(300)
        lags = [0, *(lag for lag, n in lags_of(Near(here, side_m=fine), marks.ts_ms, marks.places,
                                               within_m=fine, longest_s=LAG_MAX_S) if n >= 5)]  # fmt: skip
        matched = best_match(here, close, lags_ms=lags, distances_m=[fine])
        if matched is not None and not _is_own(camera, here, matched):
            is_again = _is_own_again(matched) if _has_own(matched, camera) else _is_other_again(here, close, matched)
            matched = matched if is_again else None
        if matched is None:
            matched = best_match(here, own, lags_ms=lags, distances_m=[max(fine, COARSE_M)])
            if matched is not None and not (_is_own(camera, here, matched) or _is_own_again(matched)):
                matched = None
        if (matched is None or matched.share < SAME_SHARE) and (beside := match_beside(here, own)) is not None:
            shifted, away_m = beside
            if _is_there(shifted, SURE) and (matched is None or shifted.share > 1.2 * matched.share):
                return [same_beside(self.site, shifted, away_m)]
        if matched is not None:
            return [same_again(self.site, camera, here, matched)]
        for factor in _OTHER_UNITS:
            scaled = Recording(here.ts_ms, here.places / factor, here.camera, here.track, here.owner, here.cameras)
            within = min(max(fine / factor, fine), COARSE_M)
            matched = best_match(scaled, own, lags_ms=lags[:1], distances_m=[within])
            if matched is not None and _is_there(matched, SURE):
                return [same_again(self.site, camera, here, matched, factor=factor)]
        seen = there.of_cameras(numbers)
        return [self._second_view(camera, here, matched)] if (matched := _seen_by(here, seen)) is not None else []

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
            rows = self._stored(table, shifted)
            stored = rows_of(self.site, table, rows, keyed_ms=np.zeros(0, dtype=np.int64)).recording
            matched = best_match(shifted, stored, lags_ms=[0], distances_m=[fine_m(here, stored)])
            if matched is not None and _is_there(matched, SURE / 2):
                return [with_other_times(self.site, line, matched, lag_ms)]
        return []

    def _beside_each_other(self, asked: Recording, dense: KeyedRecords) -> Iterator[SourceWarning]:
        """Compare the cameras of a source with each other."""
        done: set[str] = set()
        for camera in _cameras(self.site, asked) if len(asked.cameras) > 1 else ():
            done.add(camera.camera_id)
            recording = dense.recording
            others = [c for c in self._without_views(camera) if c.camera_id in recording.cameras]
            numbers = [recording.cameras.index(c.camera_id) for c in others if c.camera_id not in done]
            there = recording.of_cameras(frozenset(numbers))
            here = recording.of_camera(camera.camera_id).some(CAMERA_MAX)
            if len(here) < RECORDS_MIN or not len(there):
                continue
            if (matched := _seen_by(here, there)) is not None:
                yield self._second_view(camera, here, matched)
                return

    def _other_units(self, table: TableName, dense: KeyedRecords) -> Iterator[SourceWarning]:
        """Compare the spread and speed of each camera's people with what is stored of it, and within the source."""
        recording = dense.recording.at(dense.is_metric)
        for camera in _cameras(self.site, recording):
            here = recording.of_camera(camera.camera_id)
            change = change_within(here)
            if change is not None:
                yield other_unit(camera, change, f"from {time_text(self.site, change.from_ms)} on", is_inside=True)
                return
            past = self._past(table, camera, here)
            change = None if past is None else change_between(past, here)
            if change is not None:
                yield other_unit(camera, change, "beside those that are stored", is_inside=False)
                return

    def _past(self, table: TableName, camera: Camera, here: Recording) -> Recording | None:
        """Return records of the camera that are stored nearest to some others; None = there are none."""
        rows = newest_rows(
            self.site,
            self.stores,
            table,
            camera,
            int(here.ts_ms[0]) if len(here) else 0,
            self._spool,
            self._read,
        )
        return None if rows is None else rows.recording.at(rows.is_metric)

    def _second_view(self, camera: Camera, here: Recording, matched: Match) -> SourceWarning:
        has_view = {c.camera_id: self._has_view(c.camera_id) for c in self.site.cameras}
        return second_view(camera, here, matched, has_view=has_view)

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


def _seen_by(here: Recording, there: Recording) -> Match | None:
    """Return how many people one other camera sees, of several; None where it is none."""
    here, there = on_floors(here), on_floors(there)
    matched = best_match(here, there, lags_ms=[0], distances_m=VIEWS_M)
    if matched is None or not _is_there(matched, VIEW_SHARE):
        return None
    no = by_number(matched.other.camera[matched.record[matched.is_near]])[0]
    # the people of many cameras together are near by chance more often
    matched = best_match(here, there.at(there.camera == no), lags_ms=[0], distances_m=VIEWS_M)
    return matched if matched is not None and _is_there(matched, VIEW_SHARE) else None


def _is_own_again(matched: Match) -> bool:
    """Return whether it is a recording of the camera again: of coarse places, lags are tried until many are near."""
    is_tried = matched.within_m > COARSE_M and abs(matched.lag_ms) >= 5
    return _is_there(matched, SURE if is_tried else SHARE_MIN)


def _is_other_again(here: Recording, close: Recording, matched: Match) -> bool:
    """Return whether it is the recording of other cameras again, and no second view of the same people.

    Two cameras that round coarsely have somebody at one place, too, but places that were rounded alike are equal.
    """
    if abs(matched.lag_ms) <= UNSHIFTED_MS and matched.within_m > CLEAR_M:
        equal = match(here, Near(close, side_m=FINE_M), lag_ms=matched.lag_ms, within_m=FINE_M, around_s=SAME_INSTANT_S)
        if equal.share < EQUAL_SHARE and (matched.within_m > COARSE_M or here.rounding_m() == close.rounding_m()):
            return False
    return _is_there(matched, SURE)


def _is_there(matched: Match, least: float) -> bool:
    """Return whether so many records are there as nobody meets by chance."""
    n = len(matched.is_near)
    is_more = matched.share >= 1.5 * matched.chance or matched.excess >= SURE
    return matched.excess >= least and matched.excess * n >= RECORDS_MIN / 2 and is_more


def _is_own(camera: Camera, here: Recording, matched: Match) -> bool:
    """Return whether nearly everybody is where the same camera has somebody at the same time: no camera sees two there.

    This tells of people who do not move, whom other times have at the same places.
    """
    if abs(matched.lag_ms) > UNSHIFTED_MS or matched.within_m > COARSE_M:
        return False
    own_ms = matched.other.of_camera(camera.camera_id).ts_ms
    if not len(own_ms):
        return False
    at = np.searchsorted(own_ms, here.ts_ms).clip(0, len(own_ms) - 1)
    away_ms = np.minimum(np.abs(own_ms[at] - here.ts_ms), np.abs(own_ms[at - 1] - here.ts_ms))
    is_seen = away_ms <= 1000
    return int(is_seen.sum()) >= RECORDS_MIN and bool(matched.is_near[is_seen].mean() >= 0.9)


def _has_own(matched: Match, camera: Camera) -> bool:
    record = matched.record[matched.is_near]
    own = _no(matched.other, camera.camera_id)
    return bool(len(record)) and bool(np.mean(matched.other.camera[record] == own) > 0.2)


def _no(recording: Recording, camera_id: str) -> int:
    return recording.cameras.index(camera_id) if camera_id in recording.cameras else -2


def _other_places(
    site: Site, asked: KeyedRecords, stored: KeyedRecords, *, share: float = MOVED_SHARE
) -> SourceWarning | None:
    """Return the warning of records whose time and id are stored at other places, where most of these are."""
    has_track = asked.recording.track >= 0
    keys, at = np.unique(stored.key, return_index=True)
    no = np.searchsorted(keys, asked.key)
    no[no == len(keys)] = 0
    both = np.flatnonzero(has_track & (keys[no] == asked.key) & (asked.key != 0))
    if len(both) < MOVED_MIN:
        return None
    there = at[no[both]]
    apart_m = np.abs(asked.recording.places[both] - stored.recording.places[there]).max(axis=1)
    is_moved = apart_m > MOVED_M
    if is_moved.mean() <= share:
        return None
    owner = stored.recording.owners[by_number(stored.recording.owner[there[is_moved]])[0]]
    return other_places(site, apart_m[is_moved], len(both), owner)


def _cameras(site: Site, recording: Recording) -> list[Camera]:
    return [c for c in site.cameras if c.camera_id in recording.cameras][:CAMERAS_MAX]


def _marks(line: ImportLine) -> tuple[Ints, Floats]:
    with contextlib.suppress(ValueError):
        packed = np.frombuffer(base64.b64decode(line.landmarks), dtype="<i8").reshape(-1, 3)
        return packed[:, 0].astype(np.int64), packed[:, 1:] / 1000
    return np.zeros(0, dtype=np.int64), np.zeros((0, 2))


def _table_of_all(head: Sequence[Tables]) -> TableName:
    return "observations" if any(table_of(tables) == "observations" for tables in head) else "pairs"
