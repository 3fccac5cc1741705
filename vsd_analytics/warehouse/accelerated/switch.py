"""The one switch between the two ways to compute a fact: its query in `sql/`, or numpy, which gives the same rows.

`VSD_ACCELERATED=0` in the environment makes every fact come from its query. All else that knows this folder knows these
functions only.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa

from vsd_analytics.schema import TableName
from vsd_analytics.store.layout import Part
from vsd_analytics.warehouse.accelerated.batch import Batch
from vsd_analytics.warehouse.accelerated.camera_days import camera_days
from vsd_analytics.warehouse.held import Held
from vsd_analytics.warehouse.sqlfiles import Relation


class Accelerator:
    """Decides for each relation of a batch whether numpy computes it.

    Args:
        held: Relations of the batch; the stored tables are among them.
        params: The settings and rules that SQL reads.
        is_careful: DuckDB failed before, so that every query is run.
    """

    def __init__(self, held: Held, params: Mapping[str, Any], *, is_careful: bool = False) -> None:
        self._batch = Batch(held, params) if is_accelerated() and not is_careful else None

    def computes(self, relation: Relation) -> bool:
        """Compute a relation, whose inputs are there; False where its query has to run."""
        return self._batch is not None and self._batch.computes(relation)


def is_accelerated() -> bool:
    """Return whether numpy computes facts where it can: yes, unless `VSD_ACCELERATED` is 0."""
    return os.environ.get("VSD_ACCELERATED", "1") != "0"


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
