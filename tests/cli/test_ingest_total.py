"""The last line of `vsd ingest`, when other commands use the same spool at the same time."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import pytest
from site_text import site_text

from vsd_analytics.cli.ingest_output import print_total
from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.store.store import Store

RECORD = "ts,camera_id,track_id,x_m,y_m\n2026-11-09T09:00:00Z,cam-1,a,1,2\n"


def test_records_that_another_command_folds_are_counted_as_such(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "vsd.toml").write_text(site_text("cam-1"))
    site = load_site(tmp_path)
    read = partial(ingest, site, options=IngestOptions(), now=datetime(2026, 11, 20, tzinfo=UTC))

    def total(name: str, *, meanwhile: Callable[[], object]) -> str:
        result = read([tmp_path / name], on_source=lambda _: meanwhile())
        print_total(result, is_dry_run=False)
        return capsys.readouterr().out

    for k, name in enumerate(("a.csv", "b.csv", "c.csv")):
        (tmp_path / name).write_text(RECORD.replace("00Z", f"0{k}Z"))
    fold = Store(tmp_path / "store", site_id="shop").fold
    spool = partial(read, [tmp_path / "c.csv"], is_folding=False)
    assert total("a.csv", meanwhile=fold) == (
        "0 new records stored, 1 record of these files stored by another command meanwhile\n"
    )
    assert total("b.csv", meanwhile=spool) == (
        "2 new records stored, with 1 record that waited or came from other commands\n"
    )
    assert total("b.csv", meanwhile=int) == "0 new records stored, 1 was known already\n"
