"""Batches of units: how many hours or days of records a build holds in memory at a time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path

import pyarrow.parquet as pq

from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.store.layout import Part
from vsd_analytics.warehouse.units import Unit

BATCH_HOURS, BATCH_ROWS = 24, 2_000_000
"""Hours and stored rows, of pairs twice, per batch, which begins with a UTC day where it can: so most files are written
at once, and the columns of a day fit into caches. Hours of a busy site are computed one by one, so that memory stays
bounded."""
QUIET_HOURS, QUIET_ROWS = 168, 500_000
"""A batch of a quiet site goes on for a week: with so few rows, planning the queries costs more than running them."""


def batches(units: Sequence[Unit]) -> Iterator[Sequence[Unit]]:
    """Yield runs of units within the limits of hours (or as many days) and rows; each holds at least one unit.

    A run goes on with a further day only if the whole of it fits: then each file is written with the rows of one run.
    """
    n_rows = {u.number: sum(_n_persons(t, p) for t in TABLES for p in u.own_parts(t)) for u in units}
    of_day: Counter[int] = Counter()
    for number, n in n_rows.items():
        of_day[number // BATCH_HOURS] += n
    batch: list[Unit] = []
    held = 0
    for unit in units:
        own, day = n_rows[unit.number], unit.number // BATCH_HOURS
        if batch:
            ahead = own if day == batch[-1].number // BATCH_HOURS else of_day[day]
            is_within = day == batch[0].number // BATCH_HOURS and held + own <= BATCH_ROWS
            is_quiet = unit.number - batch[0].number < QUIET_HOURS and held + ahead <= QUIET_ROWS
            if not is_within and not is_quiet:
                yield batch
                batch, held = [], 0
        batch.append(unit)
        held += own
    if batch:
        yield batch


def _n_persons(table: TableName, part: Part) -> int:
    """Return the rows of a part, of pairs twice: each is of two persons, and takes the room of two while it is held."""
    return 2 * _n_rows(part.path) if table == "pairs" else _n_rows(part.path)


@lru_cache(maxsize=100_000)
def _n_rows(path: Path) -> int:
    """Return the rows of a part. A part is named by the hash of its bytes, so they never change."""
    return int(pq.read_metadata(path).num_rows)
