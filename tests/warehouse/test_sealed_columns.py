"""A column of a fact that became a fact of its own is still read of hours that were sealed before."""

from __future__ import annotations

from pathlib import Path

from warehouse.small_projects import make_site

from vsd_analytics.store.seals import UnitSeal
from vsd_analytics.warehouse.sealed import SealedRange


def test_hours_sealed_before_have_the_tracks_of_cells_in_another_fact(tmp_path: Path) -> None:
    units = [{"floor_cells": "old"}, {"floor_cells": "cells", "cell_tracks": "tracks"}, {}]
    hours = {480_000 + k: UnitSeal(fingerprint="f", causes={}, facts=facts) for k, facts in enumerate(units)}
    sealed, site = SealedRange(hours), make_site(tmp_path)
    found = sealed.fact_paths(site, "cell_tracks", formerly_in="floor_cells")
    assert [(hour, path.name) for hour, path in found] == [(480_000, "00-old.parquet"), (480_001, "01-tracks.parquet")]
    assert [path.relative_to(tmp_path / "sealed").parts[0] for _, path in found] == ["floor_cells", "cell_tracks"]
    assert [hour for hour, _ in sealed.fact_paths(site, "cell_tracks")] == [480_001]
