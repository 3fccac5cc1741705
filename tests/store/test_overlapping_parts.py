"""A fold reads the parts in which a record of the spool may be already, and no others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from warehouse.small_projects import HOUR, T0, Frame, Person, make_site, put

from vsd_analytics.site.model import Site
from vsd_analytics.store import new_rows
from vsd_analytics.store.layout import segment_paths
from vsd_analytics.store.spans import ends_ms, spans_of
from vsd_analytics.store.store import Store


def store_of(site: Site) -> Store:
    return Store(site.root / "store", site_id=site.site_id)


def minutes(first: int, after: int) -> list[Person]:
    return [Person(T0 + m * 60_000, track, m, 0) for m in range(first, after) for track in "ab"]


def test_a_message_of_the_running_hour_reads_no_part_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    site, read = make_site(tmp_path), list[Path]()
    put(site, minutes(-30, 30))
    real = new_rows._doubtful
    monkeypatch.setattr(new_rows, "_doubtful", lambda t, rows, known: read.extend(known) or real(t, rows, known))
    put(site, minutes(30, 31))
    assert read == []
    put(site, minutes(29, 32))
    (before, part, minute) = sorted(store_of(site).parts("observations"), key=lambda p: ends_ms(p.path) or ())[:3]
    assert before.hour < part.hour == minute.hour
    assert set(read) == {part.path, minute.path}


def test_records_come_in_any_order_and_twice_and_are_stored_once(tmp_path: Path) -> None:
    """Batches of neighbouring, equal and far instants against a table that holds some of them."""
    rng, site = np.random.default_rng(3), make_site(tmp_path)
    every = {(p.ts, p.track): p for p in minutes(-60, 60)}
    seen = set[tuple[int, str | None]]()
    for _ in range(16):
        first = int(rng.integers(-60, 60))
        batch = [p for p in minutes(first, first + int(rng.integers(1, 40))) if (p.ts, p.track) in every]
        batch = [p for p in batch if rng.random() < 0.7]
        new = {(p.ts, p.track) for p in batch} - seen
        before = len(seen)
        put(site, batch, fold=False)
        assert store_of(site).fold().n_new == len(new)
        seen |= new
        parts = store_of(site).parts("observations")
        assert sum(pq.read_metadata(p.path).num_rows for p in parts) == before + len(new)


def test_ends_are_those_of_all_row_groups_and_unknown_where_nothing_can_be_read(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [Frame(T0 + 5), Frame(T0 + HOUR - 1), Frame(T0 + 7)])
    (part,) = store_of(site).parts("frames")
    assert ends_ms(part.path) == (T0 + 5, T0 + HOUR - 1)
    many = tmp_path / "many.parquet"
    pq.write_table(pq.ParquetFile(part.path).read(), many, row_group_size=1)
    assert ends_ms(many) == (T0 + 5, T0 + HOUR - 1)
    torn = tmp_path / "torn.parquet"
    torn.write_bytes(part.path.read_bytes()[:-9])
    assert ends_ms(torn) is None
    put(site, [Frame(T0 + 1)], fold=False)
    (span,) = spans_of(segment_paths(store_of(site).root, "frames"), stored_days={T0 // HOUR // 24})
    assert span.overlapping([part.path, torn]) == [torn], "a file that cannot be read is not left out"
