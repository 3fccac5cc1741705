"""Programs of docs/producers.md run as they stand there, and what they send is stored and counted right."""

from __future__ import annotations

import csv
import os
import re
import signal
import subprocess
import sys
import time
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

import duckdb
import numpy as np
import pytest
from live.local_broker import MOSQUITTO, WHY_NOT, Mosquitto, free_port, write_project
from markdown_pages import REPOSITORY

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.store.store import Store

PAGE = REPOSITORY / "docs" / "producers.md"
PROGRAMS = dict(re.findall(r"(?s)<!-- test: (\w+) -->\n```python\n(.*?)```", PAGE.read_text(encoding="utf-8")))
VSD = [sys.executable, "-c", "from vsd_analytics.cli import main; main()"]
TOKEN = "a-token-of-the-tests"
N_FRAMES = 20
PEOPLE = [0 if k % 5 == 4 else 2 for k in range(N_FRAMES)]
BOXES = [
    [(100.0 + 5 * k + 80 * p, 50.0, 140.0 + 5 * k + 80 * p, 200.0) for p in range(n)] for k, n in enumerate(PEOPLE)
]


def stored(root: Path, table: str) -> list[Any]:
    """Return the rows of a table of the store: camera and people of a frame, or camera, id and place of a person."""
    store = Store(root / "store", site_id="shop")
    store.fold()
    columns = {"frames": "camera_id, n_persons", "observations": "camera_id, x_mm, y_mm, u_px, v_px"}[table]
    names = [str(part.path) for part in store.parts("frames" if table == "frames" else "observations")]
    query = f"select {columns} from read_parquet($names, hive_partitioning = false) order by all"
    return duckdb.execute(query, {"names": names}).fetchall() if names else []


@pytest.mark.skipif(MOSQUITTO is None, reason=WHY_NOT)
def test_the_programs_for_mqtt_and_http_store_each_frame_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broker = Mosquitto(tmp_path / "broker").start()
    root = write_project(tmp_path / "project", port=broker.port)
    address = f"127.0.0.1:{free_port()}"
    monkeypatch.setenv("VSD_HTTP_TOKEN", TOKEN)
    listener = subprocess.Popen([*VSD, "-C", str(root), "listen", "--http", address], env=os.environ)
    try:
        until = time.monotonic() + 20
        while '"listening"' not in _text(root / "status" / "listen.json") and time.monotonic() < until:
            time.sleep(0.05)
        program = PROGRAMS["mqtt"].replace('"localhost", 1883', f'"127.0.0.1", {broker.port}')
        exec(compile(program, "mqtt", "exec"), {"__name__": "__main__"})
        program = PROGRAMS["http"].replace("127.0.0.1:8765", address).replace('"cam-1"', '"cam-2"')
        exec(compile(program, "http", "exec"), {"__name__": "__main__"})
        time.sleep(1)
    finally:
        listener.send_signal(signal.SIGTERM)
        listener.wait(20)
        broker.stop()
    wanted = sorted((camera, n) for camera in ("cam-1", "cam-2") for n in PEOPLE)
    assert stored(root, "frames") == wanted
    assert len(stored(root, "observations")) == 2 * sum(PEOPLE)


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.exists() else ""


class Tensor(np.ndarray[Any, Any]):
    """Numbers with the methods of a tensor that the programs call."""

    def int(self) -> Self:
        return self.astype(np.int64).view(type(self))  # type: ignore[return-value]


def tensor(values: Any) -> Any:
    return np.asarray(values, dtype=float).view(Tensor)


class Boxes:
    """Boxes of ultralytics' results."""

    def __init__(self, boxes: list[tuple[float, ...]]) -> None:
        self.xyxy = tensor(boxes).reshape(-1, 4)
        self.id = tensor(range(1, len(boxes) + 1)) if boxes else None

    def __len__(self) -> int:
        return len(self.xyxy)


class Yolo:
    """A model that finds the people of `BOXES`, one picture after the other."""

    def __init__(self, weights: str) -> None:
        self.number = -1

    def track(self, source: str, **options: Any) -> Iterator[Any]:
        assert options == {"stream": True, "persist": True, "classes": [0], "verbose": False}
        for boxes in BOXES:
            time.sleep(0.002)  # each picture has a time of its own
            yield types.SimpleNamespace(boxes=Boxes(boxes))

    def __call__(self, picture: Any, *, verbose: bool) -> list[Any]:
        self.number += 1
        return [BOXES[self.number]]


class Detections:
    """Detections of supervision: boxes with a class, and a car among them."""

    def __init__(self, xyxy: Any, class_id: Any) -> None:
        self.xyxy, self.class_id = np.asarray(xyxy, dtype=float).reshape(-1, 4), np.asarray(class_id)

    @classmethod
    def from_ultralytics(cls, result: list[tuple[float, ...]]) -> Self:
        return cls([*result, (0, 0, 900, 400)], [0] * len(result) + [2])

    def __getitem__(self, chosen: Any) -> Detections:
        return Detections(self.xyxy[chosen], self.class_id[chosen])


class Sink:
    """Supervision's sink of a CSV file, with the columns of version 0.31."""

    def __init__(self, file_name: str) -> None:
        self.path = Path(file_name)
        self.rows: list[list[Any]] = [
            ["x_min", "y_min", "x_max", "y_max", "class_id", "confidence", "tracker_id", "class_name", "frame_index"]
        ]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with self.path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(self.rows)

    def append(self, detections: Detections, custom_data: dict[str, Any]) -> None:
        for track, box in enumerate(detections.xyxy.tolist(), start=1):
            self.rows.append([*box, 0, 0.9, track, "person", custom_data["frame_index"]])


@pytest.fixture
def libraries(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Put made-up objects in place of the libraries, and go to a project."""
    monkeypatch.setitem(sys.modules, "ultralytics", types.SimpleNamespace(YOLO=Yolo))  # type: ignore[arg-type]
    tracker = types.SimpleNamespace(update_with_detections=lambda detections: detections)
    supervision = types.SimpleNamespace(
        ByteTrack=lambda: tracker,
        CSVSink=Sink,
        Detections=Detections,
        get_video_frames_generator=lambda video: iter(range(N_FRAMES)),
    )
    monkeypatch.setitem(sys.modules, "supervision", supervision)  # type: ignore[arg-type]
    monkeypatch.chdir(write_project(tmp_path, port=1, n_cameras=1))
    return tmp_path


def test_the_loop_of_ultralytics_writes_frames_with_feet(libraries: Path) -> None:
    exec(compile(PROGRAMS["ultralytics"], "ultralytics", "exec"), {"__name__": "__main__"})
    assert run(cli, ["ingest", "frames.jsonl", "--yes"]) in (0, 1)
    assert sorted(n for _, n in stored(libraries, "frames")) == sorted(PEOPLE)
    feet = sorted(((left + right) / 2, bottom) for boxes in BOXES for left, _, right, bottom in boxes)
    assert sorted((u, v) for *_, u, v in stored(libraries, "observations")) == feet


def test_the_loop_of_supervision_writes_a_table_that_is_read(libraries: Path) -> None:
    exec(compile(PROGRAMS["supervision"], "supervision", "exec"), {"__name__": "__main__"})
    words = PAGE.read_text(encoding="utf-8").partition("Then: `")[2].partition("`")[0].split()[1:]
    assert run(cli, ["--now", "2026-11-28", *words, "--yes"]) in (0, 1)
    assert len(stored(libraries, "observations")) == sum(PEOPLE)
