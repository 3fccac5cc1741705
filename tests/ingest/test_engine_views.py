"""What real cameras write: several lenses in one file, times without offset, empty frames, classes now and then."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from engine_files import SIZE
from test_reading_rules import TOML, project, stored

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import SourceResult, ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.ingest.reading.frame_rows import KINDS_MAX, FrameRows

NOW = datetime(2025, 12, 1, tzinfo=UTC)


def axis_frame(second: int, *, channel: int = 1, kind: str | None = "Human") -> dict[str, Any]:
    box = {"left": 0.4, "top": 0.2, "right": 0.6, "bottom": 0.9}
    found: dict[str, Any] = {"bounding_box": box, "object_track_id": "a-1"}
    if kind is not None:
        found["class"] = {"type": kind, "score": 0.7}
    at = f"2025-11-10T09:00:{second:02d}.369150Z"
    return {"channel_id": channel, "detections": [found], "timestamp": at}


def onvif_frame(second: int, *, lens: str, offset: str = "Z") -> str:
    return (
        '<tt:MetadataStream xmlns:tt="http://www.onvif.org/ver10/schema"><tt:VideoAnalytics>'
        f'<tt:Frame UtcTime="2025-11-10T09:00:{second:02d}.158{offset}" VideoSourceToken="{lens}" Source="Module">'
        '<tt:Object ObjectId="4"><tt:Appearance><tt:Shape><tt:BoundingBox left="-0.2" top="0.5" right="0.2" '
        'bottom="-0.5"/></tt:Shape><tt:Class><tt:Type Likelihood="0.9">Human</tt:Type></tt:Class></tt:Appearance>'
        "</tt:Object></tt:Frame></tt:VideoAnalytics></tt:MetadataStream>\n"
    )


def read(root: Path, name: str, text: str, **options: Any) -> SourceResult:
    path = root / name
    path.write_text(text)
    (result,) = ingest(load_site(root), [path], IngestOptions(**{"size_px": SIZE, **options}), now=NOW).sources
    return result


def test_frames_of_a_second_channel_are_not_stored_as_the_same_camera(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML)
    frames = [axis_frame(k, channel=1 + k % 2) for k in range(10)]
    result = read(root, "a.jsonl", "".join(json.dumps(f) + "\n" for f in frames), camera="cam-1")
    assert (result.format, dict(result.n_rejected)) == ("axis-scene", {"other-view": 5})
    assert len(stored(root)) == 5


def test_a_file_that_begins_with_empty_frames_is_known(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML)
    empty = [{"channel_id": 1, "timestamp": f"2025-11-10T08:{k // 60:02d}:{k % 60:02d}.5Z"} for k in range(2000)]
    assert len(json.dumps(empty)) > 65536
    text = "".join(json.dumps(f) + "\n" for f in [*empty, axis_frame(1)])
    result = read(root, "a.jsonl", text, camera="cam-1")
    assert (result.format, result.n_records["frames"], len(stored(root))) == ("axis-scene", 2001, 1)


def test_a_track_has_its_class_also_in_frames_without_one(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML)
    kinds = [None, "Human", None, None, "Human", None]
    result = read(
        root,
        "a.jsonl",
        "".join(json.dumps(axis_frame(k, kind=kind)) + "\n" for k, kind in enumerate(kinds)),
        camera="cam-1",
    )
    assert len(stored(root)) == 5
    assert result.n_dropped == {"object without a class": 1}


def test_the_oldest_classes_are_forgotten_first() -> None:
    rows = FrameRows(IngestOptions(), engine="x")
    for k in range(KINDS_MAX + 1):
        rows.kind_of(str(k), "human")
    assert (rows.kind_of("0", ""), rows.kind_of("1", ""), rows.kind_of(None, "")) == ("", "human", "")


def test_lenses_are_cameras_where_nobody_says_which_camera_it_is(tmp_path: Path) -> None:
    toml = TOML.replace('engine_ids = ["tills"]', 'engine_ids = ["lens-1"]').replace(
        'name = "Entrance"', 'name = "Entrance"\nengine_ids = ["lens-0"]'
    )
    root = project(tmp_path / "p", toml)
    text = "".join(onvif_frame(k, lens=f"lens-{k % 2}") for k in range(10))
    assert read(root, "a.xml", text).error is None
    assert [sum(r["camera_id"] == c for r in stored(root)) for c in ("cam-1", "cam-2")] == [5, 5]
    merged = read(root, "b.xml", text, camera="cam-1")
    assert dict(merged.n_rejected) == {"other-view": 5}


def test_the_module_is_the_camera_where_vsd_toml_knows_it(tmp_path: Path) -> None:
    root = project(tmp_path / "p", TOML.replace('engine_ids = ["tills"]', 'engine_ids = ["Module"]'))
    read(root, "a.xml", onvif_frame(1, lens="lens-0"))
    assert [r["camera_id"] for r in stored(root)] == ["cam-2"]


@pytest.mark.parametrize(("options", "hour"), [({}, 9), ({"zone": "Europe/Rome"}, 8)])
def test_utc_time_without_an_offset_is_utc_unless_a_zone_is_said(
    options: dict[str, str], hour: int, tmp_path: Path
) -> None:
    root = project(tmp_path / "p", TOML)  # the clock of the camera is that of Rome
    read(root, "a.xml", onvif_frame(1, lens="l", offset=""), camera="cam-1", **options)
    assert [r["ts"].hour for r in stored(root)] == [hour]
