"""What no first look can see: records behind the card's, and files whose names tell of several cameras."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from walks import Step, project, walks

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.checks import late_look, sample
from vsd_analytics.ingest.intake import pipeline
from vsd_analytics.ingest.intake.pipeline import IngestResult, ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions

NOW = datetime(2025, 12, 1, tzinfo=UTC)
WALK = walks(seconds=100)
FIRST = 300
"""Records that the card looks at, here."""


def line(s: Step, *, kind: str = "person") -> str:
    return f"{s.at.isoformat()},{s.track},{s.x_m},{s.y_m},{kind}\n"


def take(root: Path, **files: str) -> IngestResult:
    paths = []
    for name, body in files.items():
        paths.append(root / f"{name}.csv")
        paths[-1].write_text("ts,track_id,x_m,y_m,class_name\n" + body)
    return ingest(load_site(root), paths, IngestOptions(), now=NOW)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda s: line(replace(s, x_m=s.x_m * 100, y_m=s.y_m * 100)), "(W220)"),
        (lambda s: line(replace(s, at=s.at.replace(second=0))), "(W224)"),
        (lambda s: line(s, kind="car" if s.track > 3 else "person"), "(W222)"),
        (lambda s: line(replace(s, x_m=0.0, y_m=0.0) if s.track > 3 else s), "exactly 0, 0 (W220)"),
        (lambda s: line(s).replace(f",{s.track},", ",,", 1), "(W225)"),
        (line, None),
    ],
)
def test_what_looks_wrong_behind_the_first_records_is_said_with_the_way_back(
    change: Callable[[Step], str], says: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (sample, pipeline, late_look):
        monkeypatch.setattr(module, "SAMPLE_ROWS", FIRST)
    monkeypatch.setattr("vsd_analytics.ingest.reading.text_table.BLOCK_BYTES", 4096)
    monkeypatch.setattr("vsd_analytics.ingest.reading.table_head.HEAD_ROWS", FIRST)
    body = "".join(line(s) if i < FIRST else change(s) for i, s in enumerate(WALK))
    (result,) = take(project(tmp_path / "project"), a=body).sources
    assert result.error is None
    assert result.card is not None
    assert result.card.warnings == ()
    assert [says in note for note in result.notes] == [True] if says else result.notes == []
    if says:
        assert result.notes[0].startswith("W229: from about line 302 on")
        assert f"vsd purge --import {result.import_id}" in result.notes[0]


def test_files_of_several_cameras_are_not_stored_as_the_only_one(tmp_path: Path) -> None:
    root = project(tmp_path / "project")
    halves = {f"cam{k}_2025-11-25": "".join(line(s) for s in WALK if s.track % 2 == k % 2) for k in (1, 2)}
    assert [getattr(s.error, "code", None) for s in take(root, **halves).sources] == ["E211", "E211"]
    one_by_one = [take(root, **{name: body}).sources[0] for name, body in halves.items()]
    assert [getattr(s.error, "code", None) for s in one_by_one] == [None, "E211"], "the first was imported before"
    said = ingest(
        load_site(root), [root / "cam2_2025-11-25.csv"], IngestOptions(camera="cam-1", is_sure=False), now=NOW
    )
    assert said.sources[0].error is None, "--camera says which one is meant"
