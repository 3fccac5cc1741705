"""The quarantine of live messages: all of a batch is durable in it before any message of the batch is acknowledged."""

from __future__ import annotations

from datetime import datetime
from typing import Final

from vsd_analytics.ingest.intake.quarantine_writer import Quarantine, SourceReading
from vsd_analytics.ingest.reading.adapter import Rejected
from vsd_analytics.live.decode import Prepared
from vsd_analytics.site.model import Site

_FRAMES: Final = SourceReading("frames", first_line="")


class LiveQuarantine:
    """Stores the rejected records of live messages.

    Args:
        site: The site.
        source: What people know the messages by.
        now: The clock at the start.
    """

    def __init__(self, site: Site, *, source: str, now: datetime) -> None:
        stored_max = int(site.settings.quarantine_day_max)
        self._quarantine = Quarantine(site.root / "quarantine", source=source, is_live=True, stored_max=stored_max)
        self._day = now.date()

    def add(self, ready: Prepared, *, now: datetime) -> None:
        """Make the rejected records of a batch durable; what cannot be written is tried again with its messages.

        Raises:
            StoreError: E308, the quarantine of the day is full.
            OSError: The disk refused.
        """
        if now.date() != self._day:  # its limit is per source and day
            self._quarantine.close()
            self._day = now.date()
        readings = {id(reading): reading for reading in (_FRAMES, *ready.readings.values())}
        groups: dict[int, list[Rejected]] = {}
        for r in ready.rejected:
            groups.setdefault(id(ready.readings.get(r.line, _FRAMES)), []).append(r)
        if not groups:
            return
        try:
            for key, rejects in groups.items():
                self._quarantine.add(rejects, reading=readings[key], at=now)
            self._quarantine.flush()
        except OSError:
            self._quarantine.forget()
            raise

    def close(self) -> None:
        """Write what is held."""
        self._quarantine.close()
