"""The one switch between the two ways to compute a fact: its query in `sql/`, or numpy, which gives the same rows.

`VSD_ACCELERATED=0` in the environment makes every fact come from its query. All else that knows this folder knows these
functions only.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from typing import Any

import pyarrow as pa

from vsd_analytics.schema import TableName
from vsd_analytics.store.layout import Part
from vsd_analytics.warehouse.accelerated.batch import ONLY_COUNTS, Batch, IdsNeededError
from vsd_analytics.warehouse.accelerated.camera_days import camera_days
from vsd_analytics.warehouse.accelerated.cell_marts import CELL_MARTS, cell_marts, needs_violations
from vsd_analytics.warehouse.held import Held
from vsd_analytics.warehouse.sqlfiles import Relation
from vsd_analytics.warehouse.stored_records import NotedColumns, opened

__all__ = [
    "ONLY_COUNTS",
    "Accelerator",
    "IdsNeededError",
    "accelerated_camera_days",
    "accelerated_marts",
    "cell_marts",
    "is_accelerated",
    "needs_only_counts",
    "needs_violations",
]


class Accelerator:
    """Decides for each relation of a batch whether numpy computes it.

    Args:
        held: Relations of the batch; the stored tables are among them.
        params: The settings and rules that SQL reads.
        is_careful: DuckDB failed before, so that every query is run.
        only_counts: The batch has only the columns that counts need (`needs_only_counts`).
    """

    def __init__(
        self, held: Held, params: Mapping[str, Any], *, is_careful: bool = False, only_counts: bool = False
    ) -> None:
        is_on = is_accelerated() and not is_careful
        self._batch = Batch(held, params, only_counts=only_counts) if is_on else None

    def computes(self, relation: Relation) -> bool:
        """Compute a relation, whose inputs are there; False where its query has to run."""
        return self._batch is not None and self._batch.computes(relation)


def is_accelerated() -> bool:
    """Return whether numpy computes facts where it can: yes, unless `VSD_ACCELERATED` is 0."""
    return os.environ.get("VSD_ACCELERATED", "1") != "0"


def needs_only_counts(asked: Collection[str], parts: Mapping[TableName, Sequence[Part]], people: str) -> bool:
    """Return whether relations are computed with numpy from counts of records, so that nobody's id is read.

    Args:
        asked: Names of all relations that are asked for together.
        parts: Stored parts they are computed from.
        people: The setting `people`.
    """
    if not is_accelerated() or people != "all" or not ONLY_COUNTS.issuperset(asked) or parts["pairs"]:
        return False
    return not any(_has_numbers_of_pairs(part) for part in parts["frames"])


@lru_cache(maxsize=1000)
def _has_numbers_of_pairs(part: Part) -> bool:
    """Return whether the engine of some stored frames sends pairs, if only none; parts never change."""
    with opened(part, "frames") as file:
        return not NotedColumns(file.metadata).is_empty("n_pairs")


def accelerated_marts() -> Collection[str]:
    """Return the marts that `cell_marts` computes; none where their queries have to run."""
    return CELL_MARTS if is_accelerated() else ()


def accelerated_camera_days(
    parts: Mapping[TableName, Sequence[Part]], cameras: pa.Table, params: Mapping[str, Any]
) -> pa.Table | None:
    """Return the fact `camera_days`; None where its query has to run.

    Args:
        parts: Stored parts of whole UTC days.
        cameras: The relation `cameras`.
        params: The settings and rules that SQL reads.
    """
    return camera_days(parts, cameras, params) if is_accelerated() else None
