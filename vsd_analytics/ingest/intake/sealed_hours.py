"""Times whose records are refused: hours whose facts are sealed, and days whose key was destroyed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa

from vsd_analytics.ingest.intake.pseudonyms import Pseudonyms
from vsd_analytics.site.model import Site
from vsd_analytics.store.day_chain import FILE as CHAIN
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.store.seals import FOLDER, DaySeal, Seals
from vsd_analytics.store.secrets import ClosedDays, DayKeys

FORGOTTEN = "forgotten-day"


class ClosedTimes:
    """The sealed hours and forgotten days of a project, read again whenever a purge has changed them.

    Args:
        site: The project.
        pseudonyms: Knows which site day an instant belongs to.
    """

    def __init__(self, site: Site, pseudonyms: Pseudonyms) -> None:
        self._seals = Seals(site.root / FOLDER, site_id=site.site_id)
        self._keys = DayKeys(site.root / "secrets")
        self._pseudonyms = pseudonyms
        self._known: object = None
        self._sealed_days: frozenset[int] = frozenset()
        self._read: dict[int, DaySeal | None] = {}
        self._forgotten = ClosedDays()

    def refresh(self) -> None:
        """Read the seals and forgotten days again if a purge has changed them since the last call."""
        files = (self._seals.folder, self._keys.forgotten_path, self._keys.folder / CHAIN)
        known = tuple(map(_changed, files))
        if known != self._known:
            self._sealed_days = frozenset(self._seals.days())
            self._read.clear()
            self._forgotten = self._keys.closed()
            self._known = known

    @property
    def is_anything(self) -> bool:
        """Return whether any time is closed."""
        return bool(self._sealed_days or self._forgotten)

    def in_sealed_hour(self, rows: pa.Table) -> pa.Array:
        """Return which rows (`ts_ms`, UTC milliseconds) are of sealed hours."""
        hours, of_row = np.unique(rows["ts_ms"].to_numpy() // HOUR_MS, return_inverse=True)
        return pa.array(np.array([self._is_sealed(h) for h in hours.tolist()], dtype=bool)[of_row])

    def in_forgotten_day(self, rows: pa.Table) -> pa.Array:
        """Return which rows are of site days whose key was destroyed."""
        return pa.array(self._pseudonyms.of_days(rows["ts_ms"].to_numpy(), self._forgotten))

    def _is_sealed(self, hour: int) -> bool:
        day = hour // 24
        if day not in self._sealed_days:
            return False
        if day not in self._read:
            self._read[day] = self._seals.read(day)
        seal = self._read[day]
        return seal is not None and seal.holds(hour)


def _changed(path: Path) -> tuple[int, int] | None:
    """Return a value that differs after a change of a file or folder."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_ino
