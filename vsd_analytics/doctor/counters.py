"""Checks of door counters: what they sent can be read, belongs to a line, and goes on."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Final

from vsd_analytics.config.door_counts import FOLDER, door_counts
from vsd_analytics.doctor.finding import Finding
from vsd_analytics.errors import StoreError
from vsd_analytics.site.model import Site

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
    stored = {path.stem for path in (site.root / FOLDER).glob("*.parquet")}
    for line_id in sorted(stored - counted.keys()):
        detail = f"{FOLDER}/{line_id}.parquet: no [[line]] of vsd.toml that a counter counts has this id"
        yield Finding("counter", "note", detail, f"vsd counts remove {line_id}, or give the line its id again")
    for line_id, line in counted.items():
        try:
            counts = door_counts(site, line_id)
        except StoreError as error:
            yield Finding("counter", "needs you", f"{error.what}: {error.why}", error.fix)
            continue
        if not len(counts):
            fix = f"vsd counts add doors.csv --line {line_id} --left in --right out --every 15min"
            yield Finding("counter", "needs you", f"{line_id}: no counts were added", fix)
            continue
        begins, ends = (counts[name].cast("int64").to_numpy() for name in ("from_ts", "to_ts"))
        last = datetime.fromtimestamp(int(ends[-1] - 1) / 1000, tz=site.zone).date()
        summary = f"{line_id}: {len(counts):,} intervals until {last}"
        if (begins[1:] < ends[:-1]).any():
            detail = f"{summary}, some of which overlap or are not in order of time"
            yield Finding("counter", "needs you", detail, f"vsd counts remove {line_id}, and add its files again")
        elif line.is_there(today, today) and (today - last).days > SILENT_DAYS:
            detail = f"{summary}: silent for {(today - last).days} days"
            gone = last + timedelta(days=1)
            fix = (
                f"vsd counts add its last files, with the columns as before; to = {gone} in its [[line]] if it is gone"
            )
            yield Finding("counter", "needs you", detail, fix)
        else:
            yield Finding("counter", "ok", summary)
