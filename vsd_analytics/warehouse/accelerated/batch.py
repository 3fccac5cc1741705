"""The relations of one batch that are computed as arrays, and their order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from vsd_analytics.warehouse.accelerated.clusters import (
    cluster_times,
    clustered,
    clusters,
    frame_clusters,
    gathering_clusters,
)
from vsd_analytics.warehouse.accelerated.company import (
    standing_groups,
    standing_tracks,
    window_company,
    window_pairs,
    window_tracks,
)
from vsd_analytics.warehouse.accelerated.coverage import coverage, recorded_spans, sequence_runs
from vsd_analytics.warehouse.accelerated.episodes import episode_segments
from vsd_analytics.warehouse.accelerated.floor_cells import cell_tracks, floor_cells
from vsd_analytics.warehouse.accelerated.gatherings import (
    gathering_joins,
    gathering_links,
    gathering_parts,
    shared_tracks,
)
from vsd_analytics.warehouse.accelerated.located import calibrations_used, instants, located
from vsd_analytics.warehouse.accelerated.pairs import pairs, with_rows
from vsd_analytics.warehouse.accelerated.persons import (
    company_times,
    distance_times,
    in_violation,
    neighbour_times,
    violation_time,
)
from vsd_analytics.warehouse.accelerated.runs import close_records, episode_cells, track_pairs
from vsd_analytics.warehouse.accelerated.same_pairs import same_pairs
from vsd_analytics.warehouse.accelerated.same_tracks import same_tracks
from vsd_analytics.warehouse.accelerated.site_tables import DayIntervals, Floors, SiteTables
from vsd_analytics.warehouse.accelerated.standing import area_tracks, crowding, exposure, track_lives
from vsd_analytics.warehouse.dimensions import ASKED_TABLES
from vsd_analytics.warehouse.held import Columns, Held, none_of
from vsd_analytics.warehouse.sqlfiles import Relation

COMPUTED: Mapping[str, Callable[[Held, SiteTables], Columns | None]] = {
    f.__name__: f
    for f in (
        instants,
        coverage,
        recorded_spans,
        sequence_runs,
        located,
        pairs,
        window_tracks,
        window_pairs,
        window_company,
        standing_tracks,
        standing_groups,
        close_records,
        same_pairs,
        same_tracks,
        episode_segments,
        episode_cells,
        track_pairs,
        in_violation,
        distance_times,
        neighbour_times,
        violation_time,
        company_times,
        exposure,
        crowding,
        floor_cells,
        cell_tracks,
        area_tracks,
        track_lives,
        calibrations_used,
        frame_clusters,
        clustered,
        clusters,
        cluster_times,
        gathering_clusters,
        shared_tracks,
        gathering_links,
        gathering_parts,
        gathering_joins,
    )
}


ONLY_COUNTS = frozenset(f.__name__ for f in (coverage, recorded_spans, exposure, violation_time, floor_cells))
"""Facts that ask of nobody who it is, nor read a relation that does (`SiteTables.only_counts`)."""


class IdsNeededError(Exception):
    """A batch that only counts has records that are not understood without the columns that it did not read."""


class Batch:
    """Computes relations of one batch as arrays where that is quicker.

    Args:
        held: Relations of the batch; the stored tables are among them.
        params: The settings that SQL reads.
        only_counts: No fact asks who is who; see `SiteTables`.
    """

    def __init__(self, held: Held, params: Mapping[str, Any], *, only_counts: bool) -> None:
        n_cameras, n_tracks = (held.n_names[enum] for enum in ("camera_name", "track_name"))
        floors = Floors(held["cameras"], held["owner_cells"], cell_mm=int(params["owner_cell_mm"]), n_cameras=n_cameras)
        self._held = held
        self._site = SiteTables(
            params, n_cameras, n_tracks, floors, DayIntervals(held["camera_days"], n_cameras=n_cameras), only_counts
        )
        self._is_on = True

    def computes(self, relation: Relation) -> bool:
        """Compute a relation as arrays; False where its query has to run. All that it reads was computed."""
        asked = [name for name in relation.reads if name in ASKED_TABLES]
        if asked and not any(self._held.small[name].num_rows for name in asked):
            self._held.add(relation.name, relation.columns, none_of(relation))
            return True
        compute = COMPUTED.get(relation.name) if self._is_on else None
        if compute is None:
            return False
        if relation.name != "pairs" and "pairs" in relation.reads and "pairs" not in self._held:
            self._held.replace("pairs", with_rows(*(self._held[r] for r in ("pairs", "instants", "located"))))
        rows = compute(self._held, self._site)
        if rows is None and self._site.only_counts:
            raise IdsNeededError
        if rows is None:
            self._is_on = relation.name != "located"  # all others read its order
            return False
        self._held.add(relation.name, relation.columns, rows)
        return True
