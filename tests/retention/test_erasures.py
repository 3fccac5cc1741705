"""What was deleted on request does not come back; what was imported by mistake may."""

from __future__ import annotations

import json
from pathlib import Path

from aged_projects import DAYS, messages, vsd, write

from vsd_analytics.config.project import load_site
from vsd_analytics.store.part_files import read_part
from vsd_analytics.store.store import Store

MORNING = f"{DAYS[0]}T10:00..{DAYS[0]}T12:00"  # Rome is an hour ahead: 9 and 10 UTC
ERASE = ("purge", "--camera", "cam-1", "--range", MORNING, "--reason", "request 7")


def stored(root: Path) -> str:
    return vsd(root, "hours", "--range", DAYS[0], "--by", "camera", "--json")


def delivered(tmp_path: Path) -> Path:
    return write(tmp_path / "again.jsonl", messages(camera="cam-1", day=DAYS[0], hours=(9, 10)))


def test_a_file_does_not_bring_erased_records_back(project: Path, tmp_path: Path) -> None:
    vsd(project, *ERASE)
    erased = stored(project)
    told = vsd(project, "ingest", str(delivered(tmp_path)), code=None)
    assert "erased on request" in told
    assert stored(project) == erased
    assert not (project / "quarantine").exists() or not any((project / "quarantine").glob("*.jsonl"))


def test_the_fold_drops_erased_records_whoever_put_them_into_the_spool(project: Path) -> None:
    """Nodes, listeners and replays all end in the fold."""
    part = sorted((project / "store" / "observations").rglob("*.parquet"))
    kept = [read_part(path, "observations") for path in part]
    vsd(project, *ERASE)
    erased = stored(project)
    store = Store(project / "store", site_id=load_site(project).site_id)
    for rows in kept:
        store.append("observations", rows)
    assert store.fold().n_erased > 0
    assert stored(project) == erased


def test_the_list_of_erasures_names_nobody(project: Path) -> None:
    vsd(project, *ERASE)
    text = (project / "store" / "erasures.json").read_text(encoding="utf-8")
    assert "request" not in text
    (erasure,) = json.loads(text)
    assert erasure.keys() == {"which", "reason"}


def test_a_purge_without_a_reason_is_repeatable_and_an_erasure_can_be_lifted(project: Path, tmp_path: Path) -> None:
    before = stored(project)
    vsd(project, *ERASE[:-2])
    vsd(project, "ingest", str(delivered(tmp_path)))
    assert stored(project) == before
    vsd(project, *ERASE)
    vsd(project, *ERASE, "--lift")
    vsd(project, "ingest", str(delivered(tmp_path)))
    assert stored(project) == before
