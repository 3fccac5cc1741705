"""From an adapter's raw batch to the stored tables: the checks, units and pseudonyms that are the same for all formats.

A bad record is rejected with a reason and does not affect good ones. Nothing is invented, and nothing dropped silently.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.ingest.checks.crowds import Crowds
from vsd_analytics.ingest.intake.camera_lives import NOT_THERE, DescribedLives
from vsd_analytics.ingest.intake.pseudonyms import Pseudonyms
from vsd_analytics.ingest.intake.sealed_hours import FORGOTTEN, ClosedTimes
from vsd_analytics.ingest.reading.adapter import RawBatch, Rejected
from vsd_analytics.ingest.reading.raw import Check, rejected, row_json
from vsd_analytics.ingest.reading.reasons import NO_TIME, TOO_MANY
from vsd_analytics.schema import QUALITIES, SCHEMAS, TABLES, TRACKS, TS, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store.erasures import ERASED, KnownErasures, are_erased
from vsd_analytics.store.part_files import CODED
from vsd_analytics.store.seals import SEALED
from vsd_analytics.store.secrets import DayKeys

TRACK_MAX_CHARS = 200
PIXEL_MAX = 1e6
NORMALISED: Final = {
    table: pa.schema([f.with_type(CODED) if f.name in ("camera_id", *TRACKS[table]) else f for f in SCHEMAS[table]])
    for table in TABLES
}
"""`SCHEMAS` with the ids of cameras and tracks as dictionaries: few differ, and a segment is written from them."""
_PAIR_TRACKS = ("track_a", "track_b")
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_ROUNDING_MM = 1e-6  # 1.001 m is 1000.9999999999999 mm in floating point


@dataclass(frozen=True, slots=True)
class Normalised:
    """A batch ready for the store.

    Attributes:
        tables: Rows in `NORMALISED`.
        rejected: Records for quarantine.
        n_dropped: Counts of records left out on purpose, by reason.
    """

    tables: Mapping[TableName, pa.Table]
    rejected: Sequence[Rejected]
    n_dropped: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class Fault:
    """Rows that may not be stored for one reason.

    Attributes:
        reason: Slug.
        detail: One sentence for people.
        rows: The raw rows.
        at: Their places among all rows, from 0.
    """

    reason: str
    detail: str
    rows: pa.Table
    at: np.ndarray


class Normaliser:
    """Normalises the batches of one ingest.

    Args:
        site: The site; its cameras, settings, zone and start of day are used.
        now: The clock, for the latest instant accepted.
        keys: Per-day secrets of track ids; None keeps the engine's ids.
    """

    def __init__(self, site: Site, *, now: datetime, keys: DayKeys | None) -> None:
        self._site = site
        self._pseudonyms = Pseudonyms(site, keys)
        self._closed = ClosedTimes(site, self._pseudonyms)
        self._crowds = Crowds(persons_max=int(site.settings.persons_max), pairs_max=int(site.settings.pairs_max))
        self._settings = site.settings
        self._first_ms = int(datetime(site.settings.earliest_year, 1, 1, tzinfo=UTC).timestamp() * 1000)
        self._last_ms = int((now.timestamp() + site.settings.future_max_s) * 1000)
        self._lives = DescribedLives(site)
        self._erasures = KnownErasures(site.root / "store")
        self._cameras = {c.camera_id: c.camera_id for c in site.cameras}
        for camera in site.cameras:
            self._cameras.update(dict.fromkeys(camera.engine_ids, camera.camera_id))

    def live_at(self, now: datetime) -> None:
        """Move the clock of a live source.

        Args:
            now: From here on instants in [now - live_late_max_s, now + live_ahead_max_s] are accepted.
        """
        self._first_ms = int((now.timestamp() - self._settings.live_late_max_s) * 1000)
        self._last_ms = int((now.timestamp() + self._settings.live_ahead_max_s) * 1000)

    def normalise(self, batch: RawBatch, *, n_whole: int | None = None) -> Normalised:
        """Return the batch's good rows in stored form, its bad rows with reasons, and the counts of rows left out.

        Args:
            batch: The rows an adapter read.
            n_whole: Most bad records to return one by one, including those of the adapter; more of one reason are only
                counted, in one `Rejected`. None = all.
        """
        tables: dict[TableName, pa.Table] = {}
        bad: list[Rejected] = list(batch.rejected)
        dropped = Counter(batch.n_dropped)
        self._closed.refresh()
        self._erasures.refresh()
        for name in TABLES:
            raw = batch.table(name)
            if not raw.num_rows:
                continue
            if self._erasures.every:  # first of all: quarantine would store them
                named = raw.append_column("camera_id", self._camera_ids(raw["camera"]))
                is_erased = are_erased(named, self._erasures.every)
                raw = raw.filter(pc.invert(is_erased))
                dropped[ERASED] += is_erased.true_count
            rows = _good(name, *self._passed(name, raw), bad, n_whole=n_whole)
            if name == "observations":
                rows = self._observations(rows)
            elif name == "pairs":
                rows = self._pairs(rows, dropped)
            rows = _with(rows, {"ts": rows["ts_ms"].cast(TS)})
            tables[name] = pa.table([rows[c] for c in SCHEMAS[name].names], schema=NORMALISED[name])
        if dropped[ERASED] > batch.n_dropped.get(ERASED, 0):
            bad = [_without_text(r) if i < len(batch.rejected) or r.reason == NO_TIME else r for i, r in enumerate(bad)]
        return Normalised(tables, bad, +dropped)

    def faults(self, name: TableName, raw: pa.Table) -> list[Fault]:
        """Return which rows may not be stored, without storing any: for rows that another machine has normalised.

        Args:
            name: Table of the rows.
            raw: Rows in the columns of `RAW_SCHEMAS`.
        """
        self._closed.refresh()
        return self._passed(name, raw)[1]

    def _passed(self, name: TableName, raw: pa.Table) -> tuple[pa.Table, list[Fault]]:
        """Return the rows that pass all checks, and the others with the first reason each."""
        raw = raw.append_column("camera_id", self._camera_ids(raw["camera"]))
        checks = [*self._common_checks(), *self._closed_checks(), *self._checks(name), self._crowds.check(name)]
        faults = list[Fault]()
        at, rows = np.arange(raw.num_rows), raw
        for reason, detail, is_bad in checks:
            mask = pc.fill_null(is_bad(rows), False)
            if not pc.any(mask).as_py():
                continue
            is_faulty = np.asarray(mask)
            faults.append(Fault(reason, detail, rows.filter(mask), at[is_faulty]))
            at, rows = at[~is_faulty], rows.filter(pc.invert(mask))
        return rows, faults

    def _camera_ids(self, cameras: pa.ChunkedArray) -> pa.Array:
        coded = cameras.combine_chunks().dictionary_encode()
        known = [self._cameras.get(c) for c in coded.dictionary.to_pylist()]
        names = list(dict.fromkeys(c for c in known if c is not None))  # a camera may have several engine_ids
        numbers = pa.array([None if c is None else names.index(c) for c in known], pa.int32())
        return pa.DictionaryArray.from_arrays(numbers.take(coded.indices), pa.array(names, pa.string()))

    def _common_checks(self) -> list[Check]:
        first, last = (datetime.fromtimestamp(ms / 1000, tz=UTC).isoformat() for ms in (self._first_ms, self._last_ms))
        shown = ", ".join(list(self._cameras)[:12]) + (", …" if len(self._cameras) > 12 else "")
        return [
            (NO_TIME, "the record has no usable time", lambda r: pc.is_null(r["ts_ms"])),
            (
                "time-out-of-range",
                f"the time is outside {first} to {last}: wrong unit, wrong clock or a camera set to a wrong year",
                lambda r: pc.or_(pc.less(r["ts_ms"], self._first_ms), pc.greater(r["ts_ms"], self._last_ms)),
            ),
            ("no-camera", "the record names no camera and no --camera was given", lambda r: pc.is_null(r["camera"])),
            (
                "unknown-camera",
                f"no [[camera]] of vsd.toml has this id or engine_ids (known: {shown})",
                lambda r: pc.is_null(r["camera_id"]),
            ),
            *([(NOT_THERE, self._lives.detail, self._lives.are_outside)] if self._lives else []),
        ]

    def _closed_checks(self) -> list[Check]:
        if not self._closed.is_anything:
            return []
        return [
            (SEALED, "the records of its hour were purged and its figures are sealed", self._closed.in_sealed_hour),
            (FORGOTTEN, "the key of its day was destroyed: it would count twice", self._closed.in_forgotten_day),
        ]

    def _checks(self, name: TableName) -> list[Check]:
        if name == "frames":
            return [_negative("n_persons", "n_pairs")]
        return self._observation_checks() if name == "observations" else self._pair_checks()

    def _observation_checks(self) -> list[Check]:
        limit = self._settings.coordinate_max_m
        return [
            ("not-a-number", "a coordinate is not a finite number", _not_finite),
            (
                "no-position",
                "the record has neither floor metres nor pixels",
                lambda r: pc.and_(_any(pc.is_null, r, "x_m", "y_m"), _any(pc.is_null, r, "u_px", "v_px")),
            ),
            (
                "out-of-range",
                f"a coordinate is more than {limit:g} m from the origin or {PIXEL_MAX:g} px from the picture",
                lambda r: _or(_beyond(limit, r, "x_m", "y_m"), _beyond(PIXEL_MAX, r, "u_px", "v_px")),
            ),
            _negative("person"),
            *_shared_checks("track"),
        ]

    def _pair_checks(self) -> list[Check]:
        limit = self._settings.coordinate_max_m
        places, distances = ("x_a_m", "y_a_m", "x_b_m", "y_b_m"), ("distance_m", "distance_sd_m")
        return [
            ("not-a-number", "a coordinate or the distance is not a finite number", _not_finite),
            (
                "out-of-range",
                f"a coordinate or the distance exceeds {limit:g} m",
                lambda r: _beyond(limit, r, *places, *distances),
            ),
            (
                "negative-distance",
                "a distance cannot be negative",
                lambda r: _any(lambda values: pc.less(values, 0.0), r, *distances),
            ),
            (
                "no-distance",
                "the pair has neither a distance nor two positions",
                lambda r: pc.and_(pc.is_null(r["distance_m"]), _any(pc.is_null, r, *places)),
            ),
            (
                "same-person",
                "the pair names one person twice",
                lambda r: pc.if_else(
                    pc.and_(pc.is_null(r["track_a"]), pc.is_null(r["track_b"])),
                    pc.equal(r["person_a"], r["person_b"]),
                    pc.equal(r["track_a"], r["track_b"]),
                ),
            ),
            _negative("person_a", "person_b"),
            *_shared_checks(*_PAIR_TRACKS),
        ]

    def _observations(self, rows: pa.Table) -> pa.Table:
        x, y = _millimetres(rows["x_m"]), _millimetres(rows["y_m"])
        is_half = pc.or_(pc.is_null(x), pc.is_null(y))  # one coordinate alone is no place
        nothing = pa.scalar(None, pa.int32())
        columns = {
            "track_id": self._tracks(rows, "track")[0],
            "x_mm": pc.if_else(is_half, nothing, x),
            "y_mm": pc.if_else(is_half, nothing, y),
        }
        for axis in ("u_px", "v_px"):
            quarters = pc.round(pc.multiply(rows[axis], 4.0), round_mode="half_to_even")
            columns[axis] = pc.divide(quarters, 4.0).cast(pa.float32())
        return _with(rows, columns)

    def _pairs(self, rows: pa.Table, dropped: Counter[str]) -> pa.Table:
        dx, dy = pc.subtract(rows["x_a_m"], rows["x_b_m"]), pc.subtract(rows["y_a_m"], rows["y_b_m"])
        apart = pc.sqrt(pc.add(pc.multiply(dx, dx), pc.multiply(dy, dy)))
        rows = _with(rows, {"distance_m": pc.coalesce(rows["distance_m"], apart)})
        is_far = pc.greater(rows["distance_m"], float(self._settings.pair_max_m))
        if n_far := pc.sum(is_far).as_py():
            dropped["pair beyond pair_max_m"] += n_far
            rows = rows.filter(pc.invert(is_far))
        rows = _with(rows, dict(zip(_PAIR_TRACKS, self._tracks(rows, *_PAIR_TRACKS), strict=True)))
        a, b = (rows[track].cast(pa.string()) for track in _PAIR_TRACKS)
        is_swapped = pc.coalesce(pc.greater(a, b), pc.greater(rows["person_a"], rows["person_b"]))
        columns = {}
        for stem in ("person_{}", "track_{}", "x_{}_m", "y_{}_m"):
            a, b = (rows[stem.format(side)].combine_chunks() for side in "ab")
            columns[stem.format("a")], columns[stem.format("b")] = _swapped(a, b, is_swapped)
        for stem in ("x_a", "y_a", "x_b", "y_b"):
            columns[f"{stem}_mm"] = _millimetres(columns[f"{stem}_m"])
        # rounded down, so that "strictly closer than D metres" stays distance_mm < 1000 D
        distance_mm = pc.floor(pc.add(pc.multiply(rows["distance_m"], 1000.0), _ROUNDING_MM))
        columns["distance_mm"] = distance_mm.cast(pa.int32())
        columns["distance_sd_mm"] = _millimetres(rows["distance_sd_m"])
        return _with(rows, columns)

    def _tracks(self, rows: pa.Table, *columns: str) -> list[pa.DictionaryArray]:
        """Return the stored ids of columns with the engine's, which have one dictionary."""
        n = len(columns)
        named = self._pseudonyms.tracks(
            pa.chunked_array([piece for c in columns for piece in rows[c].chunks], pa.string()).combine_chunks(),
            camera_ids=pa.chunked_array(n * rows["camera_id"].chunks, rows["camera_id"].type).combine_chunks(),
            ts_ms=np.tile(rows["ts_ms"].to_numpy(), n),
        )
        return [named.slice(i * rows.num_rows, rows.num_rows) for i in range(n)]


def _shared_checks(*tracks: str) -> list[Check]:
    return [
        (
            "long-track-id",
            f"a track id is longer than {TRACK_MAX_CHARS} characters",
            lambda r: _any(lambda t: pc.greater(pc.utf8_length(t), TRACK_MAX_CHARS), r, *tracks),
        ),
        (
            "unknown-quality",
            f"quality is not one of {', '.join(QUALITIES)}",
            lambda r: pc.invert(pc.is_in(r["quality"], pa.array(QUALITIES))),
        ),
    ]


def _negative(*columns: str) -> Check:
    return (
        "negative-number",
        "a count, or the number of a person in its frame, is negative",
        lambda rows: _any(lambda values: pc.less(values, 0), rows, *columns),
    )


def _good(
    name: TableName, rows: pa.Table, faults: Sequence[Fault], bad: list[Rejected], *, n_whole: int | None
) -> pa.Table:
    """Return the rows that passed; append the others to `bad`."""
    shown = [c for c in rows.column_names if c not in ("line", "camera_id")]
    for fault in faults:
        n_rows = fault.rows.num_rows
        n_single = n_rows if n_whole is None else min(n_rows, max(0, n_whole - len(bad)))
        n_more = n_rows - n_single  # these become one record with a count, shown by the first of them
        for i, row in enumerate(fault.rows.slice(0, n_single + (n_more > 0)).to_pylist()):
            as_json = row_json({c: row[c] for c in shown if row[c] is not None})
            row["ts_ms"] = _readable(row["ts_ms"])
            text = ", ".join(f"{c}={row[c]}" for c in shown if row[c] is not None and c != "zone")
            record = rejected(row["line"], reason=fault.reason, detail=fault.detail, record=text)
            n = 1 if i < n_single else n_more
            # a row of a crowded frame must not be replayed: on its own it would pass the check
            is_whole = fault.reason != TOO_MANY
            bad.append(replace(record, table=name, row=as_json, n=n) if is_whole else replace(record, n=n))
    return rows


def _without_text(record: Rejected) -> Rejected:
    """Return a rejected record of unknown time as its line and reason: it lies among records that were erased."""
    detail = f"{record.detail}; its text is not stored, because records beside it were {ERASED}"
    return replace(record, detail=detail, text="", whole=None, row=None)


def _readable(ts_ms: int | None) -> str | None:
    """Return an instant as ISO text where the calendar reaches, else its milliseconds."""
    if ts_ms is None:
        return None
    try:
        return f"{ts_ms} ({(_EPOCH + timedelta(milliseconds=ts_ms)).isoformat(timespec='milliseconds')})"
    except OverflowError:
        return f"{ts_ms}"


def _any(check: Callable[[pa.ChunkedArray], pa.ChunkedArray], rows: pa.Table, *columns: str) -> pa.ChunkedArray:
    """Return which rows have a column that `check` is true for; null is not."""
    return _or(*(check(rows[c]) for c in columns))


def _or(*masks: pa.ChunkedArray) -> pa.ChunkedArray:
    result = pc.fill_null(masks[0], False)
    for mask in masks[1:]:
        result = pc.or_(result, pc.fill_null(mask, False))
    return result


def _not_finite(rows: pa.Table) -> pa.ChunkedArray:
    """Return which rows have a number that is NaN or infinite (null is missing, not wrong)."""
    floats = [c.name for c in rows.schema if pa.types.is_floating(c.type)]
    return _any(lambda values: pc.invert(pc.is_finite(values)), rows, *floats)


def _beyond(limit: float, rows: pa.Table, *columns: str) -> pa.ChunkedArray:
    return _any(lambda values: pc.greater(pc.abs(values), float(limit)), rows, *columns)


def _millimetres(metres: pa.ChunkedArray) -> pa.ChunkedArray:
    return pc.round(pc.multiply(metres, 1000.0), round_mode="half_to_even").cast(pa.int32())


def _swapped(a: pa.Array, b: pa.Array, is_swapped: pa.ChunkedArray) -> tuple[pa.ChunkedArray, pa.ChunkedArray]:
    """Return two columns with their values exchanged in some rows; dictionaries are one and the same."""
    of_a, of_b = (ends.indices if pa.types.is_dictionary(ends.type) else ends for ends in (a, b))
    first, second = pc.if_else(is_swapped, of_b, of_a), pc.if_else(is_swapped, of_a, of_b)
    if not pa.types.is_dictionary(a.type):
        return first, second
    first, second = (
        pa.DictionaryArray.from_arrays(numbers.combine_chunks(), a.dictionary) for numbers in (first, second)
    )
    return first, second


def _with(rows: pa.Table, columns: Mapping[str, pa.ChunkedArray | pa.Array]) -> pa.Table:
    """Return a table with columns replaced or added."""
    return pa.table({**dict(zip(rows.column_names, rows.columns, strict=True)), **columns})
