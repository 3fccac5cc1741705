"""Ids are enums while facts are computed: same order, same rows, and texts again in the files."""

from __future__ import annotations

import random
from datetime import UTC, datetime
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.schema import SCHEMAS
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.store.duck import connect
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.build import build

AT_S = int(datetime(2026, 11, 9, 10, tzinfo=UTC).timestamp())
REFERENCE = """
    select track_id, string_agg(other_id, chr(1) order by other_id) as company
    from (
        select ts, a.track_id, b.track_id as other_id
        from told as a inner join told as b using (ts)
        where a.track_id <> b.track_id and (a.x_mm - b.x_mm) ** 2 + (a.y_mm - b.y_mm) ** 2 < 2000 ** 2
    )
    group by ts, track_id
"""


def test_companies_are_those_of_the_portable_query_whatever_the_order_of_ids(tmp_path: Path) -> None:
    rng = random.Random(3)
    names = ["b", "B", "a", "10", "9", "ä", "a b", "Z"]
    told = [
        {"ts": second, "track_id": name, "x_mm": rng.randrange(4000), "y_mm": rng.randrange(4000), "person": number}
        for second in range(120)
        for number, name in enumerate(rng.sample(names, 6))
    ]
    floors, cameras = (Floor("ground", "Ground"),), (Camera("cam", "Camera", "ground", hz=1.0),)
    site = Site("shop", "Shop", "UTC", tmp_path, floors=floors, cameras=cameras)
    store = Store(tmp_path / "store", site_id=site.site_id)
    rows = [{**t, "camera_id": "cam", "ts": 1000 * (AT_S + t["ts"]), "quality": "metric"} for t in told]
    store.append("observations", pa.Table.from_pylist(rows, schema=SCHEMAS["observations"]), engines=["made-up 1"])
    store.fold()
    build(site)
    tables = [pq.ParquetFile(p).read() for p in sorted((tmp_path / "facts" / "company_times").rglob("*.parquet"))]
    found = pa.concat_tables(tables)
    assert found.schema.field("track_id").type == pa.string()
    with connect() as con:
        con.register("told", pa.Table.from_pylist(told))
        query = f"select track_id, company, 1000 * count(*) from ({REFERENCE}) group by track_id, company"
        expected = con.sql(query).fetchall()
    assert {(r["track_id"], r["company"]): r["violation_ms"] for r in found.to_pylist()} == {
        (track, company): ms for track, company, ms in expected
    }
    assert any(company.count(chr(1)) > 2 for _, company, _ in expected)
