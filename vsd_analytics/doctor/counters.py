"""Checks of door counters: what they sent can be read, belongs to a line, and goes on."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Final

import pyarrow as pa

from vsd_analytics.config.door_counts import FOLDER, WAYS, door_counts, stored_lines
from vsd_analytics.doctor.finding import Finding
from vsd_analytics.errors import StoreError
from vsd_analytics.site.model import Site

MINUTE_MS: Final = 60_000
QUARTER_MS: Final = 15 * MINUTE_MS
SILENT_DAYS: Final = 3
"""A counter whose file of yesterday is added every night, also after a weekend, is not silent for so long."""


def examine_counters(site: Site, *, now: datetime) -> Iterator[Finding]:
    """Yield a finding for each line that a door counter counts, and for counts of no such line.

    Args:
        site: The project.
        now: The clock.
    """
    today = now.astimezone(site.zone).date()
    counted = {line.line_id: line for line in site.lines if line.is_by_counter}
    for line_id in (each for each in stored_lines(site) if each not in counted):
        detail = f"{FOLDER}/{line_id}.parquet: no [[line]] of vsd.toml that a counter counts has this id any more"
        yield Finding("counter", "note", detail, f"vsd counts remove {shlex.quote(line_id)}")
    for line_id, line in counted.items():
        try:
            counts = door_counts(site, line_id)
        except StoreError as error:
            yield Finding("counter", "needs you", f"{FOLDER}/{line_id}.parquet: {error.why}", error.fix)
            continue
        if not len(counts):
            yield Finding("counter", "needs you", f"{line_id}: no counts were added", _add(line_id, counts))
            continue
        last = datetime.fromtimestamp((counts["to_ts"][-1].value - 1) / 1000, tz=site.zone).date()
        summary = f"{line_id}: {len(counts):,} intervals until {last}"
        if line.is_there(today, today) and (today - last).days > SILENT_DAYS:
            gone = last + timedelta(days=1)
            detail = f"{summary}: silent for {(today - last).days} days; if it is gone, its [[line]] needs to = {gone}"
            yield Finding("counter", "needs you", detail, _add(line_id, counts))
        else:
            yield Finding("counter", "ok", summary)


def _add(line_id: str, counts: pa.Table) -> str:
    """Return the command that adds a file like those before: its directions, and the length of its last interval."""
    column = {"left": "in", "right": "out", "both": "count"}
    stored = [way for way in WAYS if counts[f"n_{way}" if way == "both" else f"n_to_{way}"].null_count < len(counts)]
    options = " ".join(f"--{way} {column[way]}" for way in stored or ("left", "right"))
    ms = counts["to_ts"][-1].value - counts["from_ts"][-1].value if len(counts) else QUARTER_MS
    every = f" --every {ms // MINUTE_MS}min" if ms % MINUTE_MS == 0 else ""
    return f"vsd counts add doors.csv --line {line_id} {options}{every}"
