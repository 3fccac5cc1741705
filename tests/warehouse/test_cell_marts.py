"""Marts by cell with numpy have the rows of their queries, in the same order."""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from benchmarks.made_up_site import FIRST_MS, write_site

from vsd_analytics.config.project import load_site
from vsd_analytics.schema import SCHEMAS
from vsd_analytics.site.model import Site
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.accelerated.cell_marts import CELL_MARTS, cell_marts
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.warehouse import Warehouse

FIRST = date(2026, 11, 9)
DAYS = [FIRST + timedelta(days=n) for n in range(-1, 3)]


OPENING = {"UTC": "08:15-10:30", "Asia/Kolkata": "13:45-15:15", "America/St_Johns": "04:45-06:30"}


@pytest.fixture(scope="module", params=OPENING)
def site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Return three cameras on two floors in hours that begin within UTC hours, one person far off among them."""
    root = tmp_path_factory.mktemp("cells")
    write_site(root, n_records=12_000, n_cameras=3, open_h=3, interval_s=10)
    config = (
        (root / "vsd.toml")
        .read_text()
        .replace('"UTC"', f'"{request.param}"')
        .replace("08:00-20:00", OPENING[request.param])
    )
    config = config.replace('name = "cam-00"\nfloor = "hall"', 'name = "cam-00"\nfloor = "attic"')
    (root / "vsd.toml").write_text(
        config.replace("[[camera]]", '[[floor]]\nid = "attic"\nname = "Attic"\n[[camera]]', 1)
    )
    read = load_site(root, environ={})
    far = {
        "camera_id": ["cam-01"],
        "ts": pa.array([FIRST_MS + 100], pa.timestamp("ms", "UTC")),
        "person": [99],
        "track_id": ["far"],
        "x_mm": [-2_000_000],
        "y_mm": [-1_250_250],
        "quality": ["metric"],
    }
    fields = SCHEMAS["observations"]
    rows = [pa.array(far[f.name]).cast(f.type) if f.name in far else pa.nulls(1, f.type) for f in fields]
    Store(root / "store", site_id=read.site_id).append("observations", pa.table(rows, schema=fields))
    return read


@pytest.mark.parametrize("name", CELL_MARTS)
def test_a_mart_by_cell_has_the_rows_of_its_query(site: Site, name: str) -> None:
    with Warehouse(site, DAYS[0], DAYS[-1], uses_days=False, relations=CELL_MARTS) as warehouse:
        whole = warehouse.table(relations("marts")[name].sql)
        by_day = [rows for day in DAYS for _, rows in cell_marts(warehouse.table, day, [name])]
        together = [r for day in DAYS for n, r in cell_marts(warehouse.table, day, CELL_MARTS) if n == name]
    assert whole.num_rows > 100
    assert {rows.schema for rows in by_day} == {whole.schema}
    assert pa.concat_tables(by_day).equals(whole)
    assert pa.concat_tables(together).equals(whole)


def test_files_of_marts_are_the_same_with_and_without_numpy(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    def made() -> dict[str, bytes]:
        with Warehouse(site, FIRST, FIRST + timedelta(days=6)) as warehouse:
            warehouse.prefetch(*CELL_MARTS)
        paths = sorted(Path(site.root / "facts" / "weeks").rglob("*.parquet"))
        found = {str(p): p.read_bytes() for p in paths if p.relative_to(site.root).parts[2] in CELL_MARTS}
        for path in found:
            Path(path).unlink()
        return found

    with_numpy = made()
    monkeypatch.setenv("VSD_ACCELERATED", "0")
    assert made() == with_numpy
    assert len(with_numpy) == len(CELL_MARTS)
    assert np.all([len(data) > 2_000 for data in with_numpy.values()])
