"""Ingests the demo through the same adapter as real data, with day keys derived from the seed."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

from vsd_analytics.ingest.intake.pipeline import IngestResult, ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.site.model import Site
from vsd_analytics.store.secrets import KEY_BYTES, DayKeys


def ingest_demo(
    site: Site, files: Sequence[Path], *, seed: int, on_bytes: Callable[[int], None] | None = None
) -> IngestResult:
    """Ingest the engine output of a demo project, so that the same seed gives the same store byte for byte.

    Args:
        site: The demo's site.
        files: Its engine files, named `<camera>_<date>.jsonl.zst`.
        seed: Seed of the demo; the day keys of its pseudonyms are derived from it.
        on_bytes: Progress, see `ingest`.
    """
    keys = DayKeys(site.root / "secrets")
    days = {date.fromisoformat(f.name.split("_")[1].split(".")[0]) for f in files}
    for day in sorted(days | {d - timedelta(days=1) for d in days} | {d + timedelta(days=1) for d in days}):
        text = f"demo {seed} {day.isoformat()}".encode()
        keys.put(day, hashlib.blake2b(text, digest_size=KEY_BYTES).digest())
    last = max(days)
    now = datetime(last.year, last.month, last.day, tzinfo=UTC) + timedelta(days=2)
    return ingest(site, files, IngestOptions(format="frames"), now=now, on_bytes=on_bytes)
