"""What is fed to the fuzzer before it is damaged: small inputs of every format, made here or by our own simulator."""

from __future__ import annotations

import bz2
import csv
import gzip
import io
import json
import tarfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from ingest import engine_files
from simulate.small_scenes import START_MS, frame_message, make_empty, make_pair, make_walk, merge

CONFIG = """\
[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"
opening = { mon-fri = "09:00-20:00" }
[[floor]]
id = "ground"
name = "Ground floor"
[[camera]]
id = "cam-1"
name = "Entrance"
floor = "ground"
engine_ids = ["left", "7", "hall-01", "hall-02"]
[[camera]]
id = "cam-2"
name = "Exit"
floor = "ground"
clock = "Asia/Tokyo"
[[area]]
id = "tills"
name = "Tills"
floor = "ground"
polygon = [[0, 0], [5, 0], [5, 5], [0, 5]]
"""

Files = Mapping[str, bytes]
Packer = Callable[[Files], bytes]


@dataclass(frozen=True)
class World:
    """One kind of input.

    Attributes:
        name: For the table.
        file: Name of the file or folder to write.
        lines: Its text line by line, for damage to single lines; () for inputs without lines.
        files: Members by name, for folders and archives; {} for single files.
        pack: Turns text or members into the bytes of the file; None writes a folder.
        options: Arguments of `IngestOptions`.
        ignored: Columns of stored rows that damage to another line may change by the format's own rules.
        tables: Tables in which the other lines' rows must be exact.
        first: Index of the first line that may be damaged singly; those before it say how to read the others.
    """

    name: str
    file: str
    lines: tuple[bytes, ...] = ()
    files: Files = field(default_factory=dict)
    pack: Callable[[Any], bytes] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    ignored: frozenset[str] = frozenset()
    tables: tuple[str, ...] = ("frames", "observations", "pairs")
    first: int = 1


def same(data: bytes) -> bytes:
    """Return the bytes as they are."""
    return data


def zstd(data: bytes) -> bytes:
    """Return the bytes compressed."""
    packed: bytes = pa.Codec("zstd").compress(data, asbytes=True)
    return packed


def zipped(files: Files) -> bytes:
    """Return a zip of members."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return out.getvalue()


def tarred(files: Files) -> bytes:
    """Return a tar of members."""
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w") as archive:
        for name, data in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    return out.getvalue()


def messages() -> list[dict[str, Any]]:
    """Return a quarter of a minute: a pair that stands, somebody who walks, heartbeats, an engine's own pairs."""
    walked = make_walk((0.5, 0.5), (6.0, 4.0), duration_s=4, track="9", camera="cam-2")
    paired = [
        frame_message(
            "left",
            START_MS + 60_000 + 1000 * k,
            [{"id": 4, "u_px": 320.5, "v_px": 200, "x_m": 1.25, "y_m": 2}, {"id": "x5", "x_m": 2.0, "y_m": 2.5}],
            pairs=[{"a": 4, "b": "x5", "distance_m": 0.9014, "sd_m": 0.1}],
            seq=k,
        )
        for k in range(4)
    ]
    return [*merge(make_pair(1.5, 4), walked, make_empty(2, start_ms=START_MS + 30_000)), *paired]


def positions(
    delimiter: str = ",", *, decimal: str = ".", header: str | None = "ts camera_id track_id x_m y_m"
) -> bytes:
    """Return the observations of `messages` as a text table."""
    out = io.StringIO()
    writer = csv.writer(out, delimiter=delimiter, lineterminator="\n")
    if header is not None:
        writer.writerow(header.split())
    for message in messages():
        for person in message["persons"]:
            x, y = (f"{float(person[axis]):.3f}".replace(".", decimal) for axis in ("x_m", "y_m"))
            writer.writerow([message["ts"], message["camera"], person["id"], x, y])
    return out.getvalue().encode()


def pairs() -> bytes:
    """Return measured pairs as a text table."""
    rows = [f"{1794211200 + k},cam-{1 + k % 2},{k},b{k},{0.5 + k / 8}" for k in range(12)]
    return "\n".join(["ts,camera_id,track_a,track_b,distance_m", *rows, ""]).encode()


def parquet(table: pa.Table, **options: Any) -> bytes:
    """Return a table as the bytes of a Parquet file."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, **options)
    data: bytes = sink.getvalue().to_pybytes()
    return data


def position_table() -> pa.Table:
    """Return the observations of `messages` as an Arrow table."""
    rows = list(csv.DictReader(io.StringIO(positions().decode())))
    return pa.table(
        {
            "ts": [r["ts"] for r in rows],
            "camera_id": [r["camera_id"] for r in rows],
            "track_id": [r["track_id"] for r in rows],
            "x_m": [float(r["x_m"]) for r in rows],
            "y_m": [float(r["y_m"]) for r in rows],
        }
    )


def object_log() -> bytes:
    """Return an object log of smart-social-distancing, one row a second."""
    head = "Version,Timestamp,DetectedObjects,ViolatingObjects,EnvironmentScore,Detections,ViolationsIndexes"
    rows = [head]
    for k in range(10):
        boxes = [[0.1 + 0.1 * i, 0.2, 0.15 + 0.1 * i, 0.6 + k / 100] for i in range(k % 4)]
        people = [{"position": [0.0, 0.0, 0.0], "bbox": box, "tracking_id": f"{k}{i}"} for i, box in enumerate(boxes)]
        rows.append(f'1.0,2026-11-09 09:00:{k:02},{len(boxes)},0,0.9,"{people}","[]"')
    return "\n".join([*rows, ""]).encode()


def boxes() -> bytes:
    """Return MOTChallenge text of ten columns."""
    rows = [f"{1 + k // 3},{k % 3},{100 + 9 * k}.5,{50 + k},40,100,1,{k / 4},{k / 8},0" for k in range(15)]
    return "\n".join([*rows, ""]).encode()


def sequence(name: str = "HALL-01") -> dict[str, bytes]:
    """Return the members of a MOTChallenge sequence."""
    ini = f"[Sequence]\nname={name}\nframeRate=25\nseqLength=6\nimWidth=1920\n"
    return {f"{name}/gt/gt.txt": boxes(), f"{name}/seqinfo.ini": ini.encode()}


def annotations() -> dict[str, bytes]:
    """Return WILDTRACK annotations."""
    people = [[{"personID": i, "positionID": 1000 * k + i, "views": []} for i in range(k % 3)] for k in range(6)]
    return {f"annotations_positions/{5 * k:08}.json": json.dumps(each).encode() for k, each in enumerate(people)}


def _lines(data: bytes) -> tuple[bytes, ...]:
    return tuple(data.removesuffix(b"\n").split(b"\n"))


def worlds() -> list[World]:
    """Return every kind of input."""
    text = _lines(b"".join(json.dumps(m).encode() + b"\n" for m in messages()))
    mapped = {"map": {"ts": "time", "x_m": "east", "y_m": "north", "camera_id": "who saw"}}
    columns = {"columns": ("ts", "camera_id", "track_id", "x_m", "y_m")}
    clock = {"start": START_MS}
    renamed = _lines(positions(header=None))
    table = position_table()
    log = _lines(object_log())
    mot = _lines(boxes())
    logs = {"hall/objects_log/2026-11-09.csv": object_log(), "hall/objects_log/2026-11-10.csv": object_log()}
    sequences = {**sequence(), **sequence("HALL-02")}
    person = frozenset({"person"})
    walked, shares = engine_files.frames(12), engine_files.frames(12, width=1.0, height=1.0)
    return [
        World("frames: JSONL", "a.jsonl", text, pack=same),
        World("frames: JSONL gz", "a.jsonl.gz", text, pack=gzip.compress),
        World("frames: JSONL bz2", "a.jsonl.bz2", text, pack=bz2.compress),
        World("frames: JSONL zst", "a.jsonl.zst", text, pack=zstd),
        World("frames: MQTT payloads", "", text, first=0),
        World("table: CSV", "a.csv", _lines(positions()), pack=same),
        World("table: TSV gz", "a.tsv.gz", _lines(positions("\t")), pack=gzip.compress),
        World("table: CSV ; and decimal comma", "a.csv", _lines(positions(";", decimal=",")), pack=same),
        World("table: --map", "a.csv", (b"time,who saw,track_id,east,north", *renamed), pack=same, options=mapped),
        World("table: --columns, blanks", "a.txt", _lines(positions(" ", header=None)), pack=same, options=columns),
        World("table: Parquet", "a.parquet", files={"": parquet(table)}, pack=lambda files: files[""]),
        World("positions", "a.dat", _lines(positions()), pack=same, options={"format": "positions"}),
        World("pairs", "a.csv", _lines(pairs()), pack=same, options={"format": "pairs"}),
        World(
            "smart-social-distancing: log", "a.csv", log, pack=same, options={"camera": "cam-1"},
            ignored=person | {"ts"}, tables=("observations", "pairs"),
        ),
        World(
            "smart-social-distancing: zip", "a.zip", files=logs, pack=zipped,
            options={"camera": "cam-1", "format": "smart-social-distancing"},
        ),
        World("motchallenge: gt.txt", "gt.txt", mot, pack=same, options={"camera": "cam-1", "fps": 25.0, **clock},
              ignored=person, tables=("observations",)),
        World("motchallenge: zip", "a.zip", files=sequences, pack=zipped, options=clock),
        World("wildtrack: folder", "annotations", files=annotations(),
              options={"camera": "cam-1", "format": "wildtrack", **clock}),
        World("wildtrack: tar.gz", "a.tar.gz", files=annotations(), pack=lambda f: gzip.compress(tarred(f), mtime=0),
              options={"camera": "cam-1", **clock}),
        World("nvidia: JSONL", "a.jsonl", _lines(engine_files.lines(engine_files.nvidia(walked))), pack=same),
        World("nvidia: array", "a.json", files={"": json.dumps(engine_files.nvidia(walked)).encode()},
              pack=lambda files: b"".join(files.values())),
        World("axis-scene", "a.jsonl", _lines(engine_files.lines(engine_files.axis(shares))), pack=same,
              options={"camera": "cam-1", "size_px": engine_files.SIZE}),
        World("azure-spatial-analysis", "a.jsonl.gz", _lines(engine_files.lines(engine_files.azure(walked))),
              pack=gzip.compress),
        World("otvision", "a.ottrk", files={"": bz2.compress(json.dumps(engine_files.otvision(shares)).encode())},
              pack=lambda files: files[""], options={"camera": "cam-1"}),
        World("onvif", "a.xml", files={"": engine_files.onvif(shares, per_document=3, in_pixels=True)},
              pack=lambda files: b"".join(files.values()), options={"camera": "cam-1"}),
        World("sociopatterns", "a.dat", _lines(engine_files.contacts(walked)), pack=same,
              options={"camera": "cam-1", "format": "sociopatterns"}, tables=("pairs",)),
        World("trajectories", "a.txt", _lines(engine_files.trajectories(walked)), pack=same,
              options={"camera": "cam-1", **clock}, tables=("observations",), first=3),
        World("supervision: CSV", "a.csv", _lines(engine_files.supervision_csv(shares).replace(b"\r\n", b"\n")),
              pack=same, options={"camera": "cam-1", "fps": 1.0, **clock}),
        World("vsd.toml", "", _lines(CONFIG.encode())),
    ]  # fmt: skip


def text_of(lines: Sequence[bytes]) -> bytes:
    """Return lines as a text."""
    return b"\n".join([*lines, b""])
