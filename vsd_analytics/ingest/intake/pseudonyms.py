"""Track ids as they are stored: keyed hashes that link nobody across cameras or site days, or the engine's own."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Container
from datetime import date, datetime, timedelta
from itertools import product

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.ingest.reading.instants import QUARTER_MS
from vsd_analytics.site.model import Site
from vsd_analytics.store.day_chain import read_chain
from vsd_analytics.store.secrets import DayKeys, PassingKeys, namer

NAMES_MAX = 500_000


def keys_of(site: Site, *, is_reading: bool = False) -> DayKeys | None:
    """Return the keys that name the tracks of a project; None where it keeps the engine's ids.

    Args:
        site: The site.
        is_reading: No key is made: days without one get a passing key, and so does a node that has not joined its site.

    Raises:
        StoreError: E320, the project is a node and has not joined its site: its own keys would give people a second
            pseudonym.
    """
    if not site.settings.pseudonyms:
        return None
    folder = site.root / "secrets"
    if is_reading:
        return PassingKeys(folder)
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
        self._names: defaultdict[tuple[str, date], dict[str, str]] = defaultdict(dict)
        self._n_names = 0

    def tracks(self, engine_tracks: pa.Array, *, camera_ids: pa.Array, ts_ms: np.ndarray) -> pa.DictionaryArray:
        """Return stored track ids, one a row; an empty id is missing.

        Args:
            engine_tracks: The engine's ids, strings.
            camera_ids: Our camera ids, without nulls: strings, or a dictionary of them.
            ts_ms: UTC milliseconds.
        """
        coded = engine_tracks.dictionary_encode()
        tracks = coded.dictionary.to_pylist()
        if "" in tracks:
            coded = pc.if_else(pc.equal(engine_tracks, ""), None, engine_tracks).dictionary_encode()
            tracks = coded.dictionary.to_pylist()
        keys = self._keys
        if keys is None or not tracks:
            return coded
        # camera, day and track of each row as one number: few of them differ, and only these are hashed
        cameras = camera_ids.dictionary_encode()
        quarters = pa.array(ts_ms // QUARTER_MS).dictionary_encode()
        days = [self._site_day(q) for q in quarters.dictionary.to_pylist()]
        different_days = sorted(set(days))
        day_of_row = np.array([different_days.index(d) for d in days], dtype=np.int64)[np.asarray(quarters.indices)]
        shape = (len(cameras.dictionary) * len(different_days), len(tracks))
        group_of_row = np.asarray(cameras.indices) * len(different_days) + day_of_row
        numbers = group_of_row * len(tracks) + np.asarray(coded.indices.fill_null(0))
        is_missing = np.asarray(coded.is_null()) if coded.null_count else None
        named = pa.array(numbers, mask=is_missing).dictionary_encode()  # `numpy.unique` takes many times as long
        group, track = np.unravel_index(np.asarray(named.dictionary), shape)
        names = np.empty(len(group), dtype=object)
        cameras_and_days = list(product(cameras.dictionary.to_pylist(), different_days))
        order = np.argsort(group, kind="stable")
        for at in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
            camera_id, day = cameras_and_days[group[at[0]]]
            names[at] = self._named(camera_id, day, [tracks[t] for t in track[at].tolist()], keys)
        return pa.DictionaryArray.from_arrays(named.indices, pa.array(names, pa.string()))

    def days(self, ts_ms: np.ndarray) -> set[date]:
        """Return the site days of some instants (UTC milliseconds)."""
        return {self._site_day(q) for q in np.unique(ts_ms // QUARTER_MS).tolist()}

    def of_days(self, ts_ms: np.ndarray, days: Container[date]) -> np.ndarray:
        """Return which instants (UTC milliseconds) belong to one of some site days."""
        quarters, of_row = np.unique(ts_ms // QUARTER_MS, return_inverse=True)
        return np.array([self._site_day(q) in days for q in quarters.tolist()], dtype=bool)[of_row]

    def _named(self, camera_id: str, day: date, tracks: list[str], keys: DayKeys) -> list[str]:
        """Return the stored ids of tracks of a camera on a day; the key is asked for where one of them is new."""
        names = self._names[camera_id, day]
        new = [track for track in tracks if track not in names]
        if new:
            if self._n_names >= NAMES_MAX:
                self._names.clear()
                self._n_names, names, new = 0, self._names[camera_id, day], tracks
            self._n_names += len(new)
            names.update(zip(new, map(namer(keys.key(day), camera_id=camera_id), new), strict=True))
        return [names[track] for track in tracks]

    def _site_day(self, quarter: int) -> date:
        """Return the site day a quarter of an hour (counted from 1970 in UTC) belongs to."""
        day = self._days.get(quarter)
        if day is None:
            local = datetime.fromtimestamp(quarter * QUARTER_MS / 1000, tz=self._site.zone).replace(tzinfo=None)
            day = self._days[quarter] = (local - timedelta(minutes=self._site.day_starts_min)).date()
        return day
