"""From an adapter's raw batch to the stored tables: the checks, units and pseudonyms that are the same for all formats.

Bad records are rejected with a reason, never fatal to good ones; nothing else is invented or dropped.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.ingest.adapter import RawBatch, Rejected
from vsd_analytics.schema import QUALITIES, SCHEMAS, TABLES, TableName
from vsd_analytics.site import Site
from vsd_analytics.store.secrets import DayKeys, pseudonym

QUARTER_MS = 900_000
TRACK_MAX_CHARS = 200
PIXEL_MAX = 1e6

Check = tuple[str, str, Callable[[pd.DataFrame], "pd.Series[bool]"]]


@dataclass(frozen=True, slots=True)
class Normalised:
    """A batch ready for the store.

    Attributes:
        tables: Rows in `SCHEMAS`.
        rejected: Records for quarantine.
        n_dropped: Counts of records left out on purpose, by reason.
    """

    tables: Mapping[TableName, pa.Table]
    rejected: Sequence[Rejected]
    n_dropped: Mapping[str, int]


class Normaliser:
    """Normalises the batches of one ingest.

    Args:
        site: The site; its cameras, settings, zone and start of day are used.
        now: The clock, for the latest instant accepted.
        keys: Per-day secrets of track ids; None keeps the engine's ids.
    """

    def __init__(self, site: Site, *, now: datetime, keys: DayKeys | None) -> None:
        self._site = site
        self._keys = keys
        self._settings = site.settings
        self._first_ms = int(datetime(site.settings.earliest_year, 1, 1, tzinfo=UTC).timestamp() * 1000)
        self._last_ms = int((now.timestamp() + site.settings.future_max_s) * 1000)
        self._cameras = {c.camera_id: c.camera_id for c in site.cameras}
        for camera in site.cameras:
            self._cameras.update(dict.fromkeys(camera.engine_ids, camera.camera_id))
        self._days: dict[int, date] = {}
        self._names: dict[tuple[str, date, str], str] = {}

    def normalise(self, batch: RawBatch) -> Normalised:
        """Return the batch's good rows in stored form, its bad rows with reasons, and what was left out on purpose."""
        tables: dict[TableName, pa.Table] = {}
        rejected: list[Rejected] = list(batch.rejected)
        dropped: dict[str, int] = dict(batch.n_dropped)
        for name in TABLES:
            raw = batch.table(name)
            if not raw.num_rows:
                continue
            rows = raw.to_pandas(types_mapper={pa.int32(): pd.Int32Dtype(), pa.int64(): pd.Int64Dtype()}.get)
            rows["not_finite"] = _not_finite(raw)
            rows["camera_id"] = rows["camera"].map(self._cameras)
            rows, bad = _split(rows, [*self._common_checks(), *_CHECKS[name](self)])
            rejected += bad
            if name == "pairs":
                rows = self._pairs(rows, dropped)
            else:
                rows = self._observations(rows) if name == "observations" else rows
            tables[name] = _stored(name, rows)
        return Normalised(tables, rejected, dropped)

    def _common_checks(self) -> list[Check]:
        first, last = (datetime.fromtimestamp(ms / 1000, tz=UTC).isoformat() for ms in (self._first_ms, self._last_ms))
        return [
            ("no-time", "the record has no usable time", lambda r: r["ts_ms"].isna()),
            (
                "time-out-of-range",
                f"the time lies outside {first} to {last}: wrong unit, wrong clock or a camera set to a wrong year",
                lambda r: (r["ts_ms"] < self._first_ms) | (r["ts_ms"] > self._last_ms),
            ),
            ("no-camera", "the record names no camera and no --camera was given", lambda r: r["camera"].isna()),
            (
                "unknown-camera",
                f"no [[camera]] of vsd.toml has this id or engine_ids (known: {', '.join(list(self._cameras)[:12])})",
                lambda r: r["camera_id"].isna(),
            ),
        ]

    def observation_checks(self) -> list[Check]:
        """Return the checks of person records."""
        limit = self._settings.coordinate_max_m
        return [
            (
                "not-a-number",
                "a coordinate is not a finite number",
                lambda r: r["not_finite"],
            ),
            (
                "no-position",
                "the record has neither floor metres nor pixels",
                lambda r: (r["x_m"].isna() | r["y_m"].isna()) & (r["u_px"].isna() | r["v_px"].isna()),
            ),
            (
                "out-of-range",
                f"a coordinate lies more than {limit:g} m from the origin or {PIXEL_MAX:g} px from the picture",
                lambda r: _beyond(r, limit, "x_m", "y_m") | _beyond(r, PIXEL_MAX, "u_px", "v_px"),
            ),
            *_shared_checks("track"),
        ]

    def pair_checks(self) -> list[Check]:
        """Return the checks of pair records."""
        limit = self._settings.coordinate_max_m
        coordinates = ("x_a_m", "y_a_m", "x_b_m", "y_b_m")
        return [
            (
                "not-a-number",
                "a coordinate or the distance is not a finite number",
                lambda r: r["not_finite"],
            ),
            (
                "out-of-range",
                f"a coordinate or the distance exceeds {limit:g} m",
                lambda r: _beyond(r, limit, *coordinates, "distance_m", "distance_sd_m"),
            ),
            (
                "negative-distance",
                "a distance cannot be negative",
                lambda r: ((r["distance_m"] < 0) | (r["distance_sd_m"] < 0)).fillna(False),
            ),
            (
                "no-distance",
                "the pair has neither a distance nor two positions",
                lambda r: r["distance_m"].isna() & r[list(coordinates)].isna().any(axis=1),
            ),
            (
                "same-person",
                "the pair names one person twice",
                lambda r: ((r["track_a"] == r["track_b"]) & r["track_a"].notna()).fillna(False)
                | (r["track_a"].isna() & r["track_b"].isna() & (r["person_a"] == r["person_b"])),
            ),
            *_shared_checks("track_a", "track_b"),
        ]

    def _observations(self, rows: pd.DataFrame) -> pd.DataFrame:
        rows["track_id"] = self._pseudonyms(rows, "track")
        for axis in ("x", "y"):
            rows[f"{axis}_mm"] = _millimetres(rows[f"{axis}_m"])
        half = rows["x_mm"].isna() | rows["y_mm"].isna()
        rows.loc[half, ["x_mm", "y_mm"]] = pd.NA
        for axis in ("u", "v"):
            rows[f"{axis}_px"] = (np.rint(rows[f"{axis}_px"].astype("float64") * 4) / 4).astype("float32")
        return rows

    def _pairs(self, rows: pd.DataFrame, dropped: dict[str, int]) -> pd.DataFrame:
        computed = np.hypot(rows["x_a_m"] - rows["x_b_m"], rows["y_a_m"] - rows["y_b_m"])
        rows["distance_m"] = rows["distance_m"].fillna(computed)
        far = rows["distance_m"] > self._settings.pair_max_m
        if far.any():
            dropped["pair beyond pair_max_m"] = dropped.get("pair beyond pair_max_m", 0) + int(far.sum())
            rows = rows[~far].reset_index(drop=True)
        for side in ("a", "b"):
            rows[f"track_{side}"] = self._pseudonyms(rows, f"track_{side}")
        known = rows["track_a"].notna() & rows["track_b"].notna()
        swap = ((rows["track_a"] > rows["track_b"]) & known) | ((rows["person_a"] > rows["person_b"]) & ~known)
        for stem in ("person_{}", "track_{}", "x_{}_m", "y_{}_m"):
            a, b = stem.format("a"), stem.format("b")
            rows[a], rows[b] = rows[a].mask(swap, rows[b]), rows[b].mask(swap, rows[a])
        for column in ("x_a", "y_a", "x_b", "y_b", "distance", "distance_sd"):
            rows[f"{column}_mm"] = _millimetres(rows[f"{column}_m"])
        return rows

    def _pseudonyms(self, rows: pd.DataFrame, column: str) -> pd.Series[str]:
        """Return track ids, keyed by camera and site day (`[privacy] pseudonyms`); empty ids are missing."""
        tracks = rows[column].where(rows[column] != "")
        if self._keys is None:
            return tracks
        quarters = (rows["ts_ms"] // QUARTER_MS).astype("int64")
        frame = pd.DataFrame({"camera": rows["camera_id"], "day": quarters.map(self._site_day), "track": tracks})
        combos = frame.dropna().drop_duplicates()
        for camera, day, track in combos.itertuples(index=False):
            if (camera, day, track) not in self._names:
                self._names[camera, day, track] = pseudonym(self._keys.key(day), camera_id=camera, engine_track=track)
        names = pd.Series(
            {key: self._names[key] for key in combos.itertuples(index=False, name=None)}, dtype="object"
        )
        if names.empty:
            return tracks
        index = pd.MultiIndex.from_frame(frame)
        return pd.Series(names.reindex(index).to_numpy(), index=rows.index, dtype="object")

    def _site_day(self, quarter: int) -> date:
        day = self._days.get(quarter)
        if day is None:
            local = datetime.fromtimestamp(quarter * QUARTER_MS / 1000, tz=self._site.zone).replace(tzinfo=None)
            day = self._days[quarter] = (local - timedelta(minutes=self._site.day_starts_min)).date()
        return day


def _shared_checks(*tracks: str) -> list[Check]:
    return [
        (
            "long-track-id",
            f"a track id is longer than {TRACK_MAX_CHARS} characters",
            lambda r: pd.concat([r[t].str.len() > TRACK_MAX_CHARS for t in tracks], axis=1).any(axis=1),
        ),
        (
            "unknown-quality",
            f"quality is not one of {', '.join(QUALITIES)}",
            lambda r: ~r["quality"].isin(QUALITIES),
        ),
    ]


_CHECKS: Mapping[TableName, Callable[[Normaliser], list[Check]]] = {
    "frames": lambda _: [],
    "observations": Normaliser.observation_checks,
    "pairs": Normaliser.pair_checks,
}


def _split(rows: pd.DataFrame, checks: list[Check]) -> tuple[pd.DataFrame, list[Rejected]]:
    """Return the rows that pass all checks, and the others with the first reason each."""
    rejected: list[Rejected] = []
    for reason, detail, is_bad in checks:
        bad = is_bad(rows).fillna(True).astype(bool)
        if bad.any():
            columns = [c for c in rows.columns if c not in ("line", "camera_id", "not_finite")]
            for values, line in zip(
                rows.loc[bad, columns].itertuples(index=False), rows.loc[bad, "line"], strict=True
            ):
                text = ", ".join(f"{c}={v}" for c, v in zip(columns, values, strict=True) if not pd.isna(v))
                rejected.append(Rejected(int(line), reason, detail, text[:500]))
            rows = rows[~bad]
    return rows.reset_index(drop=True), rejected


def _not_finite(raw: pa.Table) -> np.ndarray:
    """Return, per row, whether a number is NaN or infinite (null is missing, not wrong)."""
    bad = np.zeros(raw.num_rows, dtype=bool)
    for column in raw.schema:
        if pa.types.is_floating(column.type):
            bad |= ~pc.fill_null(pc.is_finite(raw[column.name]), True).to_numpy()
    return bad


def _beyond(rows: pd.DataFrame, limit: float, *columns: str) -> pd.Series[bool]:
    return (rows[list(columns)].abs() > limit).any(axis=1)


def _millimetres(metres: pd.Series[float]) -> pd.Series[int]:
    return np.rint(metres.astype("float64") * 1000).astype("Int32")


def _stored(name: TableName, rows: pd.DataFrame) -> pa.Table:
    schema = SCHEMAS[name]
    arrays = []
    for column in schema:
        values = rows["ts_ms"] if column.name == "ts" else rows[column.name]
        arrays.append(pa.array(values, type=pa.int64() if column.name == "ts" else column.type, from_pandas=True).cast(column.type))
    return pa.table(arrays, schema=schema)
