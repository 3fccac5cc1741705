"""A watched folder in a test: rounds without waiting, until the files are gone."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.live.watch import WatchStatus, watch

MOST_ROUNDS = 500


def watched(root: Path, folder: Path) -> WatchStatus:
    """Return what became of the CSV files of a folder."""
    rounds = iter([False] * MOST_ROUNDS)
    return watch(
        load_site(root),
        folder,
        IngestOptions(),
        clock=lambda: datetime(2025, 12, 1, tzinfo=UTC),
        sleep=lambda _: None,
        stop=lambda: not list(folder.glob("*.csv")) or next(rounds, True),
    )
