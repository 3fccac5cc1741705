"""The first records of a source as arrays, from which mistakes can be seen before anything is stored."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
import pyarrow as pa

from vsd_analytics.ingest.adapter import RawBatch

SAMPLE_ROWS = 50_000
STEP_MAX_S = 60.0
"""Longest time between two records of a track from which a speed is taken."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Records of the head of one source; person records, or pair records where there are no others.

    What several looks ask for is computed once: looking at a short file takes longer than reading it.

    Attributes:
        rows: Columns `camera ts_ms track x y u v` of person records, with `line`: metres, pixels, NaN = missing. Pair
            records have `distance_m`, `places_m` (the distance of their positions) and as `track` both ids.
            `camera_no` and `track_no` are numbers for cameras and tracks, which compare faster than texts; -1 =
            missing.
        zones: Zone that each record's time was read in, "" where it had an offset.
        is_pairs: Whether they are pair records.
        n_rejected: Records that cannot be used.
        n_dropped: Records left out on purpose, by reason.
        is_whole: Whether the source has no more records.
    """

    rows: pd.DataFrame
    zones: np.ndarray
    is_pairs: bool
    n_rejected: int
    n_dropped: Counter[str]
    is_whole: bool

    @property
    def n(self) -> int:
        """Return the number of records."""
        return len(self.rows)

    @cached_property
    def has_floor(self) -> bool:
        """Return whether records have floor metres."""
        return bool(self.rows["x"].notna().any())

    @cached_property
    def has_ids(self) -> bool:
        """Return whether records have ids of people."""
        return bool((self.rows["track_no"] >= 0).any())

    @cached_property
    def n_tracks(self) -> int:
        """Return the number of different track ids."""
        return int(self.rows.loc[self.rows["track_no"] >= 0, "track_no"].nunique())

    @cached_property
    def zone_names(self) -> list[str]:
        """Return the different texts of `zones`."""
        return sorted(map(str, pd.unique(self.zones)))

    def extent(self, across: str, up: str, *, tail: float = 0.01) -> tuple[float, float, float, float] | None:
        """Return the percentiles near the ends of two columns: least and largest of the first, then of the second.

        Between two records the inner one is taken, so that a single wild position of a small file does not show.
        """
        values = self.rows[[across, up]].to_numpy(dtype=float)
        values = values[~np.isnan(values).any(axis=1)]
        if not len(values):
            return None
        low = np.quantile(values, tail, axis=0, method="higher")
        high = np.quantile(values, 1 - tail, axis=0, method="lower")
        ends = np.sort([low, high], axis=0)  # of two records the low end is the larger
        (left, bottom), (right, top) = ends.tolist()
        return left, right, bottom, top

    @cached_property
    def tracked(self) -> pd.DataFrame:
        """Return the records with a track id by camera, track and time."""
        key = ["camera_no", "track_no", "ts_ms"]
        rows = self.rows.loc[self.rows["track_no"] >= 0, [*key, "x", "y", "u", "v"]]
        return rows.sort_values(key, kind="stable")

    def placed(self, across: str, up: str) -> pd.DataFrame:
        """Return `camera_no track_no ts_ms` and two axes of `tracked`, without the records that lack a place."""
        rows = self.tracked[["camera_no", "track_no", "ts_ms", across, up]]
        return rows[rows[across].notna() & rows[up].notna()]

    def speeds_m_s(self, *, step_min_s: float = 0.0) -> np.ndarray:
        """Return the speeds between successive records of one track, in metres a second.

        Args:
            step_min_s: One record in each so many seconds is taken, so that jitter does not look like speed.

        Returns:
            Speeds of steps of at most `STEP_MAX_S`.
        """
        if step_min_s not in self._speeds_m_s:
            self._speeds_m_s[step_min_s] = self._speeds(step_min_s)
        return self._speeds_m_s[step_min_s]

    @cached_property
    def _speeds_m_s(self) -> dict[float, np.ndarray]:
        """Return the speeds that were asked for, by `step_min_s`."""
        return {}

    def _speeds(self, step_min_s: float) -> np.ndarray:
        rows = self.placed("x", "y")
        rows = rows[rows["camera_no"] >= 0]
        key = ["camera_no", "track_no"]
        if step_min_s and len(rows):  # of each slot the first in the file
            slots = np.column_stack([rows[key], rows["ts_ms"] // (step_min_s * 1000)])
            starts = np.flatnonzero(np.r_[True, (np.diff(slots, axis=0) != 0).any(axis=1)])
            firsts = np.minimum.reduceat(rows.index.to_numpy(), starts)
            rows = rows.loc[firsts]
        is_same = (np.diff(rows[key].to_numpy(), axis=0) == 0).all(axis=1)
        step_s = np.diff(rows["ts_ms"].to_numpy()) / 1000
        way_m = np.hypot(*np.diff(rows[["x", "y"]].to_numpy(), axis=0).T)
        is_step = is_same & (step_s > step_min_s / 2) & (step_s <= STEP_MAX_S)
        return np.asarray(way_m[is_step] / step_s[is_step])

    @cached_property
    def n_second(self) -> int:
        """Return how many records a fold would leave out: their camera, time and track, and another place."""
        place = ["distance_m"] if self.is_pairs else ["x", "y", "u", "v"]
        key = ["camera_no", "ts_ms", "track_no"]
        rows = self.rows[self.rows["track_no"] >= 0]
        rows = rows[rows.duplicated(key, keep=False)]
        is_second = rows.duplicated(key) & ~rows.duplicated([*key, *place])
        return int(is_second.sum())

    def lives_s(self) -> np.ndarray:
        """Return for each track the seconds from its first to its last record."""
        rows = self.rows[self.rows["track_no"] >= 0]
        times = rows.groupby(["camera_no", "track_no"], sort=False)["ts_ms"]
        return np.asarray((times.max() - times.min()).to_numpy() / 1000)

    def interval_s(self) -> float | None:
        """Return the median seconds between successive frames of one camera; None with fewer than two frames."""
        frames = self.rows[["camera_no", "ts_ms"]].drop_duplicates().sort_values(["camera_no", "ts_ms"])
        steps = frames["ts_ms"].diff()[frames["camera_no"].diff() == 0]
        return None if steps.empty else float(steps.median()) / 1000


def sample_of(batches: Sequence[RawBatch], *, is_whole: bool, n_last: int | None = None) -> Sample:
    """Return the sample of some batches of a source: the first `SAMPLE_ROWS` records, or the last `n_last`."""
    name = "observations" if any(b.table("observations").num_rows for b in batches) else "pairs"
    parts = [b.table("pairs" if name == "pairs" else "observations") for b in batches]
    whole = pa.concat_tables(parts) if parts else RawBatch().table("observations")
    table = whole.slice(0, SAMPLE_ROWS) if n_last is None else whole.slice(max(0, whole.num_rows - n_last))
    column = {c: table[c].to_pandas() for c in table.column_names}
    nothing = pd.Series(np.full(table.num_rows, np.nan))
    columns = {"camera": column["camera"], "ts_ms": column["ts_ms"], "line": column["line"]}
    if name == "pairs":
        apart = np.hypot(column["x_a_m"] - column["x_b_m"], column["y_a_m"] - column["y_b_m"])
        both = column["track_a"].str.cat(column["track_b"], sep=" / ") if table.num_rows else nothing
        columns |= {"track": both, "distance_m": column["distance_m"].fillna(apart), "places_m": apart}
        columns |= {"x": column["x_a_m"], "y": column["y_a_m"], "u": nothing, "v": nothing}
    else:
        columns |= {"track": column["track"], "distance_m": nothing, "places_m": nothing}
        columns |= {"x": column["x_m"], "y": column["y_m"], "u": column["u_px"], "v": column["v_px"]}
    columns |= {f"{name}_no": pd.factorize(columns[name])[0] for name in ("camera", "track")}
    rows = pd.DataFrame(columns)
    is_timed = rows["ts_ms"].notna().to_numpy()
    return Sample(
        rows[is_timed].reset_index(drop=True),
        column["zone"].fillna("").to_numpy()[is_timed],
        name == "pairs",
        sum(r.n for b in batches for r in b.rejected),
        sum((Counter(b.n_dropped) for b in batches), Counter()),
        is_whole and sum(p.num_rows for p in parts) <= SAMPLE_ROWS,
    )
