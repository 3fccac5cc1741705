"""A purge by age that comes between an ingest's look at the seals and its append: nothing enters a sealed hour."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from aged_projects import DAYS, NOW, TERMS, day, litter, messages, vsd, write
from purge_crashes import Crash, watched

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.retention.purge import purge_older
from vsd_analytics.store.quarantine import QuarantineEntry, entries, files
from vsd_analytics.store.store import Store


def late_file(root: Path) -> Path:
    """Return a file of new records: 90 frames with 120 people of a day that goes, as many of one that stays."""
    return write(
        root / "late.jsonl", [m for d in (DAYS[0], DAYS[2]) for m in messages(camera="cam-1", day=d, hours=(15,))]
    )


def purge_at_first_append(patched: pytest.MonkeyPatch, root: Path) -> None:
    append, is_done = Store.append, []

    def purge_then_append(self: Store, *arguments: Any, **options: Any) -> int:
        if not is_done:
            is_done.append(True)
            purge_older(load_site(root), before=day(DAYS[2]), terms=TERMS)
        return append(self, *arguments, **options)

    patched.setattr(Store, "append", purge_then_append)


def raw_days(root: Path) -> set[str]:
    return {p.parent.name for p in (root / "store").glob("*/site=shop/date=*/*.parquet")}


def quarantined(root: Path) -> list[QuarantineEntry]:
    return [e for path in files(root / "quarantine") for _, e in entries(path) if e is not None]


def test_records_acknowledged_while_their_hour_is_sealed_go_to_quarantine(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    purge_at_first_append(monkeypatch, project)
    told = json.loads(vsd(project, "ingest", str(late_file(project)), "--json", code=1))
    assert told["stored"]["frames"] == {"new": 90, "known": 0, "second_sightings": 0, "sealed": 90, "erased": 0}
    assert told["stored"]["observations"]["sealed"] == 120
    assert raw_days(project) == {f"date={DAYS[2]}"}
    held = quarantined(project)
    assert {e.reason for e in held} == {"sealed-hour"}
    assert len(held) == 210
    assert litter(project) == []
    assert "0 of 210" in vsd(project, "quarantine", "replay", code=1), "their track ids are those of the store already"
    assert raw_days(project) == {f"date={DAYS[2]}"}


def test_the_user_hears_of_records_that_came_too_late(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    purge_at_first_append(monkeypatch, project)
    assert "210 new records stored, 210 quarantined" in vsd(project, "ingest", str(late_file(project)), code=1)


def test_a_fold_killed_while_it_puts_late_records_away_ends_the_same(project: Path, tmp_path: Path) -> None:
    with pytest.MonkeyPatch.context() as patched:
        purge_at_first_append(patched, project)
        ingest(load_site(project), [late_file(project)], IngestOptions(), now=NOW, is_folding=False)

    def ends(root: Path) -> tuple[int, list[str], set[str]]:
        store = Store(root / "store", site_id="shop")
        store.fold()
        parts = [p.path.name for t in ("frames", "observations") for p in store.parts(t)]  # type: ignore[arg-type]
        return len(quarantined(root)), parts, raw_days(root)

    whole = Path(shutil.copytree(project, tmp_path / "whole"))
    with watched(None) as calls:
        expected = ends(whole)
    assert expected[0] == 210
    for at in range(len(calls)):
        root = Path(shutil.copytree(project, tmp_path / f"{at}"))
        with watched(at), pytest.raises(Crash):
            Store(root / "store", site_id="shop").fold()
        assert ends(root) == expected, at
        assert not list(root.rglob("*.tmp"))
        shutil.rmtree(root)
