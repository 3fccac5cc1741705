"""The first records of a source as arrays, from which mistakes can be seen before anything is stored."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from vsd_analytics.ingest.reading.adapter import RawBatch

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Extent = tuple[float, float, float, float]
"""Least and largest value of one axis, then of the other."""

SAMPLE_ROWS = 50_000
STEP_MAX_S = 60.0
"""Longest time between two records of a track from which a speed is taken."""
LIFE_STEPS: Final = 10
"""A track that is not seen for so many of its usual steps has ended."""


@dataclass(frozen=True, eq=False)
class Texts:
    """A column of texts as numbers, which compare faster.

    Attributes:
        names: The different texts, in the order of the file.
        no: Index of each record's text in `names`; -1 = missing.
    """

    names: Sequence[str]
    no: Ints

    @classmethod
    def of(cls, column: pa.ChunkedArray) -> Texts:
        """Return the numbers of a column."""
        coded = column.combine_chunks().dictionary_encode()
        no = coded.indices.fill_null(-1).to_numpy(zero_copy_only=False)
        return cls(coded.dictionary.to_pylist(), no.astype(np.int64))

    def at(self, row: int) -> str | None:
        """Return the text of one record."""
        no = self.no[row]
        return None if no < 0 else self.names[no]

    def is_in(self, names: Iterable[str]) -> Bools:
        """Return which records have one of some texts."""
        wanted = set(names)
        return np.isin(self.no, [no for no, name in enumerate(self.names) if name in wanted])

    @property
    def counts(self) -> Ints:
        """Return the number of records of each text."""
        return np.bincount(self.no[self.no >= 0], minlength=len(self.names))


@dataclass(frozen=True, eq=False)
class Ways:
    """Records of people with ids by camera, track and time.

    Attributes:
        row: Index of each record in its sample.
        camera_no, track_no, ts_ms: As `camera.no`, `track.no` and `ts_ms` of the sample.
        places: As `floor_m` or `picture_px` of the sample.
        is_metric: Whether these are metres.
    """

    row: Ints
    camera_no: Ints
    track_no: Ints
    ts_ms: Ints
    places: Floats
    is_metric: bool

    def __len__(self) -> int:
        """Return the number of records."""
        return len(self.row)

    def where(self, is_wanted: Bools) -> Ways:
        """Return some of the records."""
        if is_wanted.all():
            return self
        chosen = is_wanted
        return Ways(
            self.row[chosen],
            self.camera_no[chosen],
            self.track_no[chosen],
            self.ts_ms[chosen],
            self.places[chosen],
            self.is_metric,
        )

    @cached_property
    def is_first(self) -> Bools:
        """Return which records are the first ones of their tracks."""
        return is_new(self.camera_no, self.track_no)

    @cached_property
    def is_again(self) -> Bools:
        """Return which records have camera, track and time of the record before."""
        return ~(self.is_first | is_new(self.ts_ms))

    @cached_property
    def steps_ms(self) -> Floats:
        """Return the times since the record before of the same track; NaN for the first ones."""
        return np.where(self.is_first, np.nan, np.diff(self.ts_ms.astype(float), prepend=0))

    @cached_property
    def usual_ms(self) -> float:
        """Return the median of `steps_ms`; NaN where nobody is seen twice."""
        steps_ms = self.steps_ms[~self.is_first]
        return float(np.median(steps_ms)) if len(steps_ms) else math.nan

    @cached_property
    def is_begun(self) -> Bools:
        """Return which records begin a life: the first ones, and those that come after more than `LIFE_STEPS`.

        An id that comes again after a long time is somebody else's, or the same person's next visit.
        """
        return self.is_first | (self.steps_ms > LIFE_STEPS * self.usual_ms)


@dataclass(frozen=True, eq=False)
class Sample:
    """Records of the head of one source; person records, or pair records where there are no others.

    What several looks ask for is computed once: looking at a short file takes longer than reading it.

    Attributes:
        camera, track: Names of the cameras, and ids of the people; of a pair both ids.
        zone: Zone that each record's time was read in; missing where it had an offset.
        ts_ms: UTC milliseconds.
        line: Line or record number in the source.
        floor_m, picture_px: Places, shape (n, 2), NaN = missing; of a pair the floor metres of the first person.
        distance_m: Distance of a pair; NaN for person records.
        places_m: Distance of a pair's positions, likewise.
        is_pairs: Whether they are pair records.
        n_rejected: Records that cannot be used.
        n_dropped: Records left out on purpose, by reason.
        is_whole: Whether the source has no more records.
    """

    camera: Texts
    track: Texts
    zone: Texts
    ts_ms: Ints
    line: Ints
    floor_m: Floats
    picture_px: Floats
    distance_m: Floats
    places_m: Floats
    is_pairs: bool
    n_rejected: int
    n_dropped: Counter[str]
    is_whole: bool

    @property
    def n(self) -> int:
        """Return the number of records."""
        return len(self.ts_ms)

    @cached_property
    def has_floor(self) -> bool:
        """Return whether records have floor metres."""
        return not np.isnan(self.floor_m[:, 0]).all()

    @property
    def places(self) -> Floats:
        """Return `floor_m`, or `picture_px` without floor metres."""
        return self.floor_m if self.has_floor else self.picture_px

    @property
    def has_ids(self) -> bool:
        """Return whether records have ids of people."""
        return bool(self.track.names)

    @cached_property
    def n_instants(self) -> int:
        """Return the number of different times."""
        return len(np.unique(self.ts_ms))

    @cached_property
    def picture_side_px(self) -> float:
        """Return the longer side of the extent of all pixels; 0 without any."""
        left, right, top, bottom = extent(self.picture_px) or (0.0, 0.0, 0.0, 0.0)
        return max(right - left, bottom - top)

    @cached_property
    def by_frame(self) -> Ints:
        """Return the order of the records by camera and time."""
        return np.lexsort((self.ts_ms, self.camera.no))

    @cached_property
    def frame_no(self) -> Ints:
        """Return the number of each record's frame: the frames are counted by camera and time."""
        frame_no = np.empty(self.n, dtype=np.int64)
        frame_no[self.by_frame] = np.cumsum(is_new(self.camera.no[self.by_frame], self.ts_ms[self.by_frame])) - 1
        return frame_no

    @cached_property
    def tracked(self) -> Ways:
        """Return the records with a track id."""
        order = np.lexsort((self.ts_ms, self.track.no, self.camera.no))
        return self._ways(order[self.track.no[order] >= 0])

    @cached_property
    def ways(self) -> Ways:
        """Return the records with a track id and a place."""
        return self.tracked.where(is_known(self.tracked.places))

    @cached_property
    def picture_ways(self) -> Ways:
        """Return the records with a track id and pixels."""
        if not self.has_floor:
            return self.ways
        ways = replace(self.tracked, places=self.picture_px[self.tracked.row], is_metric=False)
        return ways.where(is_known(ways.places))

    def _ways(self, row: Ints) -> Ways:
        places = self.places[row]
        return Ways(row, self.camera.no[row], self.track.no[row], self.ts_ms[row], places, self.has_floor)

    @cached_property
    def speeds_m_s(self) -> Floats:
        """Return the speeds between successive records of one track, metres a second, of steps up to `STEP_MAX_S`."""
        return _speeds_m_s(self.ways.where(self.ways.camera_no >= 0), step_min_s=0.0)

    @cached_property
    def walked_m_s(self) -> Floats:
        """Return such speeds between the first records of each second in the file: jitter is no speed."""
        ways = self.ways.where(self.ways.camera_no >= 0)
        starts = np.flatnonzero(ways.is_first | is_new(ways.ts_ms // 1000))
        return _speeds_m_s(self._ways(np.minimum.reduceat(ways.row, starts)) if len(ways) else ways, step_min_s=0.5)

    @cached_property
    def n_second(self) -> int:
        """Return how many records a fold would leave out: their camera, time and track, and another place."""
        ways = self.tracked
        if not ways.is_again.any():
            return 0
        several = ways.is_again | np.roll(ways.is_again, -1)  # also the first one of those with one key
        row, key = ways.row[several], np.cumsum(~ways.is_again)[several]
        places = [self.distance_m] if self.is_pairs else [self.floor_m, self.picture_px]
        different = pd.DataFrame(np.column_stack([key, *(p[row] for p in places)])).drop_duplicates()
        return len(different) - different[0].nunique()

    def lives_s(self) -> Floats:
        """Return for each life of a track (`Ways.is_begun`) the seconds from its first to its last record."""
        ways = self.tracked
        return np.asarray((ways.ts_ms[is_last(ways.is_begun)] - ways.ts_ms[ways.is_begun]) / 1000)

    def interval_s(self) -> float | None:
        """Return the median seconds between successive frames of one camera; None with fewer than two frames."""
        camera, ts_ms = self.camera.no[self.by_frame], self.ts_ms[self.by_frame]
        is_frame = is_new(camera, ts_ms)
        steps_ms = np.diff(ts_ms[is_frame])[~is_new(camera[is_frame])[1:]]
        return float(np.median(steps_ms)) / 1000 if len(steps_ms) else None


def _speeds_m_s(ways: Ways, *, step_min_s: float) -> Floats:
    step_s, way_m = ways.steps_ms[1:] / 1000, np.hypot(*np.diff(ways.places, axis=0).T)
    is_step = (step_s > step_min_s) & (step_s <= STEP_MAX_S)
    return np.asarray(way_m[is_step] / step_s[is_step])


def is_new(*columns: NDArray[Any]) -> Bools:
    """Return which rows of some columns differ from the row before; the first one does."""
    is_first = np.ones(len(columns[0]), dtype=bool)
    is_first[1:] = np.logical_or.reduce([column[1:] != column[:-1] for column in columns])
    return is_first


def is_last(is_first: Bools) -> Bools:
    """Return which rows are the last of their groups, from which are the first."""
    return np.roll(is_first, -1)


def is_known(places: Floats) -> Bools:
    """Return which places have both coordinates."""
    return ~(np.isnan(places[:, 0]) | np.isnan(places[:, 1]))


def extent(places: Floats, *, tail: float = 0.01) -> Extent | None:
    """Return the percentiles near the ends of places, shape (n, 2); None without places.

    Between two records the inner one is taken, so that a single wild position of a small file does not show.
    """
    values = places[is_known(places)]
    if not len(values):
        return None
    low = np.quantile(values, tail, axis=0, method="higher")
    high = np.quantile(values, 1 - tail, axis=0, method="lower")
    (left, bottom), (right, top) = np.sort([low, high], axis=0).tolist()  # of two records the low end is the larger
    return left, right, bottom, top


def sample_of(batches: Sequence[RawBatch], *, is_whole: bool, n_last: int | None = None) -> Sample:
    """Return the sample of some batches of a source: the first `SAMPLE_ROWS` records, or the last `n_last`."""
    is_pairs = not any(b.table("observations").num_rows for b in batches)
    parts = [b.table("pairs" if is_pairs else "observations") for b in batches]
    whole = pa.concat_tables(parts) if parts else RawBatch().table("pairs")
    table = whole.slice(0, SAMPLE_ROWS) if n_last is None else whole.slice(max(0, whole.num_rows - n_last))
    if table["ts_ms"].null_count:
        table = table.filter(pc.is_valid(table["ts_ms"]))
    nothing = np.full(table.num_rows, np.nan)

    def places(across: str, up: str) -> Floats:
        return np.column_stack([table[across].to_numpy(), table[up].to_numpy()])

    if is_pairs:
        track = pc.binary_join_element_wise(table["track_a"], table["track_b"], " / ")
        floor_m = places("x_a_m", "y_a_m")
        picture_px = np.column_stack([nothing, nothing])
        places_m = np.hypot(*(floor_m - places("x_b_m", "y_b_m")).T)
        measured_m = table["distance_m"].to_numpy()
        distance_m = np.where(np.isnan(measured_m), places_m, measured_m)
    else:
        track = table["track"]
        floor_m, picture_px = places("x_m", "y_m"), places("u_px", "v_px")
        distance_m = places_m = nothing
    return Sample(
        camera=Texts.of(table["camera"]),
        track=Texts.of(track),
        zone=Texts.of(table["zone"]),
        ts_ms=table["ts_ms"].to_numpy(),
        line=table["line"].to_numpy(),
        floor_m=floor_m,
        picture_px=picture_px,
        distance_m=distance_m,
        places_m=places_m,
        is_pairs=is_pairs,
        n_rejected=sum(r.n for b in batches for r in b.rejected),
        n_dropped=sum((Counter(b.n_dropped) for b in batches), Counter()),
        is_whole=is_whole and sum(p.num_rows for p in parts) <= SAMPLE_ROWS,
    )


FAR_M: Final = 2.0
"""Errors of a position in one frame are shorter."""
FAR_SHARE: Final = 0.2
"""Share of the extent of all pixels that nobody crosses in one step."""


def steps(sample: Sample, ways: Ways, *, fast_m_s: float) -> tuple[Bools, Bools]:
    """Return which records come by a step, and by which of these nobody walks.

    Args:
        sample: The records.
        ways: Those of them with an id and a place.
        fast_m_s: A step on the floor is a jump from this speed on.

    Returns:
        For each record of `ways` whether it is a step (the record before it is of the same track, and at most
        `STEP_MAX_S` older), and whether it is a jump (the step is far, and on the floor also faster than `fast_m_s`).
    """
    step_s = ways.steps_ms / 1000
    way = np.hypot(*np.diff(ways.places, axis=0, prepend=0).T)
    is_step = (step_s > 0) & (step_s <= STEP_MAX_S)
    if ways.is_metric:
        is_far = (way > FAR_M) & (way > fast_m_s * step_s)
    else:
        is_far = (way > FAR_SHARE * sample.picture_side_px) & (sample.picture_side_px > 0)
    return is_step, is_step & is_far
