"""Track ids as they are stored: keyed hashes that link nobody across cameras or site days, or the engine's own."""

from __future__ import annotations

from collections.abc import Callable, Container
from datetime import date, datetime, timedelta
from functools import cache

import numpy as np
import pyarrow as pa

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.ingest.instants import QUARTER_MS
from vsd_analytics.site.model import Site
from vsd_analytics.store.day_chain import read_chain
from vsd_analytics.store.secrets import DayKeys, namer

NAMES_MAX = 500_000


def keys_of(site: Site) -> DayKeys | None:
    """Return the keys that name the tracks of a project; None where it keeps the engine's ids.

    Raises:
        StoreError: E320, the project is a node and has not joined its site: its own keys would give people a second
            pseudonym.
    """
    if not site.settings.pseudonyms:
        return None
    folder = site.root / "secrets"
    if site.node is not None and read_chain(folder) is None:
        raise StoreError(
            f"the node {site.node!r} has not joined its site",
            code="E320",
            where=Where(str(folder)),
            why="with keys of its own, a person that two nodes see would count twice",
            fix="at the site: vsd node invite --out join.json; carry the file here; then: vsd node join join.json",
        )
    return DayKeys(folder)


class Pseudonyms:
    """Names the tracks of one ingest.

    Args:
        site: Its zone and start of day are used.
        keys: Per-day secrets; None keeps the engine's ids.
    """

    def __init__(self, site: Site, keys: DayKeys | None) -> None:
        self._site = site
        self._keys = keys
        self._days: dict[int, date] = {}
        self._names: dict[tuple[str, date, str], str] = {}

    def tracks(self, engine_tracks: pa.Array, *, camera_ids: pa.Array, ts_ms: np.ndarray) -> pa.Array:
        """Return stored track ids, one a row; an empty id is missing.

        Args:
            engine_tracks: The engine's ids, strings.
            camera_ids: Our camera ids, strings without nulls.
            ts_ms: UTC milliseconds.
        """
        coded = engine_tracks.dictionary_encode()
        tracks = [t or None for t in coded.dictionary.to_pylist()]
        keys = self._keys
        if keys is None:
            return pa.array(tracks, pa.string()).take(coded.indices)
        # camera, day and track of each row as one number: few of them differ, and only these are hashed
        cameras = camera_ids.dictionary_encode()
        quarters = pa.array(ts_ms // QUARTER_MS).dictionary_encode()
        days = [self._site_day(q) for q in quarters.dictionary.to_pylist()]
        different_days = sorted(set(days))
        day_of_row = np.array([different_days.index(d) for d in days], dtype=np.int64)[np.asarray(quarters.indices)]
        track_of_row = np.asarray(coded.indices.fill_null(len(tracks)), dtype=np.int64)
        shape = (len(cameras.dictionary), len(different_days), len(tracks) + 1)
        numbers = np.ravel_multi_index((np.asarray(cameras.indices), day_of_row, track_of_row), shape)
        named = pa.array(numbers).dictionary_encode()  # `numpy.unique` sorts, which takes many times as long
        different = np.asarray(named.dictionary)
        camera_names, all_tracks = cameras.dictionary.to_pylist(), [*tracks, None]
        of_camera = cache(lambda camera_id, day: namer(keys.key(day), camera_id=camera_id))
        names = [
            self._name(of_camera, camera_names[camera], different_days[day], all_tracks[track])
            for camera, day, track in zip(*(a.tolist() for a in np.unravel_index(different, shape)), strict=True)
        ]
        return pa.array(names, pa.string()).take(named.indices)

    def days(self, ts_ms: np.ndarray) -> set[date]:
        """Return the site days of some instants (UTC milliseconds)."""
        return {self._site_day(q) for q in np.unique(ts_ms // QUARTER_MS).tolist()}

    def of_days(self, ts_ms: np.ndarray, days: Container[date]) -> np.ndarray:
        """Return which instants (UTC milliseconds) belong to one of some site days."""
        quarters, of_row = np.unique(ts_ms // QUARTER_MS, return_inverse=True)
        return np.array([self._site_day(q) in days for q in quarters.tolist()], dtype=bool)[of_row]

    def _name(
        self, of_camera: Callable[[str, date], Callable[[str], str]], camera_id: str, day: date, track: str | None
    ) -> str | None:
        if track is None:
            return None
        name = self._names.get((camera_id, day, track))
        if name is None:
            if len(self._names) >= NAMES_MAX:
                self._names.clear()
            name = self._names[camera_id, day, track] = of_camera(camera_id, day)(track)
        return name

    def _site_day(self, quarter: int) -> date:
        """Return the site day a quarter of an hour (counted from 1970 in UTC) belongs to."""
        day = self._days.get(quarter)
        if day is None:
            local = datetime.fromtimestamp(quarter * QUARTER_MS / 1000, tz=self._site.zone).replace(tzinfo=None)
            day = self._days[quarter] = (local - timedelta(minutes=self._site.day_starts_min)).date()
        return day
