"""Odd files of everyday life, made from one walk of people; seeded. Each says what must become of it."""

from __future__ import annotations

import bz2
import csv
import gzip
import io
import json
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet as pq
from walks import Step, walks

STEPS = walks()
NAMES = ("ts", "track_id", "x_m", "y_m")
BERLIN = ZoneInfo("Europe/Berlin")

Row = tuple[str, int, str | None, int, int]
"""Camera, UTC milliseconds, id, x and y in millimetres: what the store must hold."""


@dataclass(frozen=True)
class Odd:
    """One odd file.

    Attributes:
        name: What is odd about it.
        write: Writes it into a folder and returns its path.
        options: Options of the command.
        rows: Rows the store must hold; None = it must be refused.
        says: A code, or words, that a refusal must have.
        cameras: Cameras of the site; none = cam-1.
        more: Lines of each camera in vsd.toml.
    """

    name: str
    write: Callable[[Path], Path]
    options: Sequence[str] = ()
    rows: Sequence[Row] | None = None
    says: str = ""
    cameras: Sequence[str] = ()
    more: str = ""


def stored(
    steps: Sequence[Step] = STEPS, *, camera: str = "cam-1", has_ids: bool = True, shift_h: int = 0
) -> list[Row]:
    """Return the rows that records are stored as, computed from the walk alone."""
    return [
        (
            camera,
            round((s.at.timestamp() + shift_h * 3600) * 1000),
            str(s.track) if has_ids else None,
            round(s.x_m * 1000),
            round(s.y_m * 1000),
        )
        for s in steps
    ]


def rows(make: Callable[[Step], Sequence[Any]], steps: Sequence[Step] = STEPS) -> list[list[Any]]:
    return [list(make(s)) for s in steps]


def plain(s: Step) -> list[Any]:
    return [s.at.isoformat(), s.track, s.x_m, s.y_m]


def text(name: str, header: Sequence[str], body: Sequence[Sequence[Any]], *, by: str = ",", **how: Any) -> Any:
    """Return a writer of a text table."""

    def write(folder: Path) -> Path:
        lines = io.StringIO()
        writer = csv.writer(lines, delimiter=by, lineterminator=how.get("end", "\n"), quoting=how.get("quoting", 0))
        writer.writerows([header, *body])
        data = how.get("pack", lambda data: data)(lines.getvalue().encode(how.get("encoding", "utf-8")))
        (folder / name).write_bytes(data)
        return folder / name

    return write


def raw(name: str, data: bytes) -> Any:
    def write(folder: Path) -> Path:
        (folder / name).write_bytes(data)
        return folder / name

    return write


def arrow(body: Sequence[Sequence[Any]], names: Sequence[str] = NAMES) -> pa.Table:
    return pa.table({n: [row[i] for row in body] for i, n in enumerate(names)})


def feather(folder: Path) -> Path:
    pyarrow.feather.write_feather(arrow(rows(plain)), str(folder / "a.feather"))
    return folder / "a.feather"


def arrow_ipc(folder: Path) -> Path:
    table = arrow(rows(lambda s: [s.at, str(s.track), s.x_m, s.y_m]))
    table = table.set_column(1, "track_id", table["track_id"].dictionary_encode())
    with pa.OSFile(str(folder / "a.arrow"), "wb") as f, pa.ipc.new_file(f, table.schema) as writer:
        writer.write_table(table, max_chunksize=100)
    return folder / "a.arrow"


def feather_bomb(folder: Path) -> Path:
    n = 40_000_000
    table = pa.table({c: pa.repeat(pa.scalar(1.0), n) for c in NAMES})
    pyarrow.feather.write_feather(table, str(folder / "a.feather"), compression="zstd")
    return folder / "a.feather"


def hive(folder: Path) -> Path:
    for camera in ("cam-1", "cam-2"):
        part = folder / "parts" / f"camera_id={camera}" / "day=25"
        part.mkdir(parents=True)
        pq.write_table(arrow([plain(s) for s in STEPS if of_camera(s) == camera]), part / "0.parquet")
    (folder / "parts" / "_SUCCESS").write_text("")
    return folder / "parts"


def of_camera(s: Step) -> str:
    return "cam-1" if s.track % 2 else "cam-2"


TWO_CAMERAS = [row for s in STEPS for row in stored([s], camera=of_camera(s))]


def tables(folder: Path) -> Path:
    (folder / "day").mkdir()
    for i in range(3):
        text(f"{i}.csv", NAMES, rows(plain, STEPS[i::3]))(folder / "day")
    (folder / "day" / "readme.txt").write_text("made by hand")
    return folder / "day"


def half_good(folder: Path) -> Path:
    path = tables(folder)
    text("3.csv", ("when", "who", "where"), [[1, 2, 3]])(path)
    return path


def packed(folder: Path) -> Path:
    with zipfile.ZipFile(folder / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(tables(folder).iterdir()):
            archive.write(path, f"export/{path.name}")
        archive.writestr("__MACOSX/export/._0.csv", b"\0\1\2")
    return folder / "a.zip"


def escaping(folder: Path) -> Path:
    with zipfile.ZipFile(folder / "a.zip", "w") as archive:
        archive.write(text("in.csv", NAMES, rows(plain))(folder), "../../escaped.csv")
    return folder / "a.zip"


def pictures(folder: Path) -> Path:
    with zipfile.ZipFile(folder / "a.zip", "w") as archive:
        archive.writestr("photo.jpg", b"\xff\xd8\xff\0\1\2" * 50)
    return folder / "a.zip"


def workbook(*sheets: tuple[str, Sequence[Sequence[Any]]]) -> Any:
    def write(folder: Path) -> Path:
        import openpyxl

        book = openpyxl.Workbook()
        book.remove(book.active)
        for title, body in sheets:
            sheet = book.create_sheet(title)
            for row in body:
                sheet.append(list(row))
        book.save(folder / "a.xlsx")
        return folder / "a.xlsx"

    return write


def naive(s: Step) -> list[Any]:
    return [f"{s.at:%Y-%m-%d %H:%M:%S}", s.track, s.x_m, s.y_m]


def as_excel(s: Step) -> list[Any]:
    return [s.at.replace(tzinfo=None), s.track, s.x_m, s.y_m]


def written(form: str) -> Callable[[Step], list[Any]]:
    return lambda s: [s.at.strftime(form), s.track, s.x_m, s.y_m]


def boxes(s: Step, width: float = 1.0, height: float = 1.0) -> list[Any]:
    u, v = 0.1 + s.x_m / 25, 0.2 + s.y_m / 16
    return [s.at.isoformat(), s.track, (u - 0.01) * width, (v - 0.1) * height, (u + 0.01) * width, v * height]


BOX = ("ts", "track_id", "left", "top", "right", "bottom")
JSON = [dict(zip(NAMES, plain(s), strict=True)) for s in STEPS]
EARLY = [Step(s.at.replace(day=10), s.track, s.x_m, s.y_m) for s in STEPS]
MAP_XY = ("--map", "x_m=x,y_m=y")


ODD: list[Odd] = [
    # right
    Odd("plain", text("a.csv", NAMES, rows(plain)), rows=stored()),
    Odd(
        "semicolons and decimal commas",
        text(
            "a.csv",
            NAMES,
            [[str(c).replace(".", ",") if i > 1 else c for i, c in enumerate(r)] for r in rows(plain)],
            by=";",
        ),
        rows=stored(),
    ),
    Odd(
        "tabs, Windows line ends, byte order mark",
        text("a.tsv", NAMES, rows(plain), by="\t", end="\r\n", encoding="utf-8-sig"),
        rows=stored(),
    ),
    Odd("quoted cells", text("a.csv", NAMES, rows(plain), quoting=csv.QUOTE_ALL), rows=stored()),
    Odd("gzip under the name of a csv", text("a.csv", NAMES, rows(plain), pack=gzip.compress), rows=stored()),
    Odd("bzip2", text("a.csv.bz2", NAMES, rows(plain), pack=bz2.compress), rows=stored()),
    Odd(
        "millimetres in the name",
        text(
            "a.csv",
            ("ts", "track_id", "x_mm", "y_mm"),
            rows(lambda s: [*plain(s)[:2], round(s.x_m * 1000), round(s.y_m * 1000)]),
        ),
        ("--map", "x_m=x_mm,y_m=y_mm"),
        rows=stored(),
    ),
    Odd(
        "centimetres in brackets",
        text(
            "a.csv",
            ("ts", "track_id", "X [cm]", "Y [cm]"),
            rows(lambda s: [*plain(s)[:2], round(s.x_m * 100, 1), round(s.y_m * 100, 1)]),
        ),
        ("--map", "x_m=X [cm]", "--map", "y_m=Y [cm]"),
        rows=stored(),
    ),
    Odd(
        "stated millimetres",
        text("a.csv", ("ts", "track_id", "x", "y"), rows(lambda s: [*plain(s)[:2], s.x_m * 1000, s.y_m * 1000])),
        (*MAP_XY, "--unit", "mm"),
        rows=stored(),
    ),
    Odd("year first with slashes", text("a.csv", NAMES, rows(written("%Y/%m/%d %H:%M:%S"))), rows=stored()),
    Odd("day first, beyond 12", text("a.csv", NAMES, rows(written("%d/%m/%Y %H:%M:%S"))), rows=stored()),
    Odd("month first, beyond 12", text("a.csv", NAMES, rows(written("%m/%d/%Y %I:%M:%S %p"))), rows=stored()),
    Odd(
        "dots, as in Germany",
        text("a.csv", NAMES, rows(written("%d.%m.%Y %H:%M:%S"))),
        ("--zone", "Europe/Berlin"),
        rows=stored(shift_h=-1),
    ),
    Odd(
        "ambiguous days with a stated format",
        text("a.csv", NAMES, rows(written("%d/%m/%Y %H:%M:%S"), EARLY)),
        ("--time-format", "%d/%m/%Y %H:%M:%S"),
        rows=stored(EARLY),
    ),
    Odd(
        "date and time in two columns",
        text(
            "a.csv",
            ("date", "time", *NAMES[1:]),
            rows(lambda s: [f"{s.at:%Y-%m-%d}", f"{s.at:%H:%M:%S}", *plain(s)[1:]]),
        ),
        ("--map", "ts=date+time"),
        rows=stored(),
    ),
    Odd(
        "date and AM/PM in two columns",
        text(
            "a.csv",
            ("Date", "Time", *NAMES[1:]),
            rows(lambda s: [f"{s.at:%m/%d/%Y}", f"{s.at:%I:%M:%S %p}", *plain(s)[1:]]),
        ),
        ("--map", "ts=Date+Time"),
        rows=stored(),
    ),
    Odd(
        "unix milliseconds",
        text("a.csv", NAMES, rows(lambda s: [round(s.at.timestamp() * 1000), *plain(s)[1:]])),
        rows=stored(),
    ),
    Odd(
        "local times with a stated zone",
        text("a.csv", NAMES, rows(lambda s: [f"{s.at.astimezone(BERLIN):%Y-%m-%d %H:%M:%S}", *plain(s)[1:]])),
        ("--zone", "Europe/Berlin"),
        rows=stored(),
        more="hz = 1.0",
    ),
    Odd(
        "cars filtered",
        text(
            "a.csv",
            (*NAMES, "class_name", "confidence"),
            rows(lambda s: [*plain(s), "car" if s.track == 1 else "person", s.track / 10]),
        ),
        ("--where", "class_name = 'person' and confidence > 0.25"),
        rows=stored([s for s in STEPS if s.track > 2]),
    ),
    Odd(
        "cameras in a column",
        text("a.csv", ("camera", *NAMES), rows(lambda s: [of_camera(s), *plain(s)])),
        ("--map", "camera_id=camera"),
        rows=TWO_CAMERAS,
        cameras=("cam-1", "cam-2"),
    ),
    Odd(
        "one column too many at the end",
        raw(
            "a.csv",
            ("\n".join(",".join(map(str, [*r, ""])) for r in [NAMES, *rows(plain)]) + "\n")
            .encode()
            .replace(b"y_m,\n", b"y_m\n", 1),
        ),
        rows=stored(),
    ),
    Odd(
        "ids as floats",
        text("a.csv", NAMES, rows(lambda s: [s.at.isoformat(), f"{s.track}.0", s.x_m, s.y_m])),
        rows=stored(),
    ),
    Odd("everything twice", text("a.csv", NAMES, rows(plain) + rows(plain)), rows=stored()),
    Odd("JSON array", raw("a.json", json.dumps(JSON).encode()), rows=stored()),
    Odd("JSON array, one key a line", raw("a.json", json.dumps(JSON, indent=2).encode()), rows=stored()),
    Odd(
        "JSON lines of flat objects",
        raw("a.jsonl", "\n".join(map(json.dumps, JSON)).encode()),
        ("--format", "table"),
        rows=stored(),
    ),
    Odd(
        "JSON array with missing keys and a byte order mark",
        raw(
            "a.json",
            b"\xef\xbb\xbf"
            + json.dumps(
                [{k: v for k, v in o.items() if k != "track_id"} if i == 0 else o for i, o in enumerate(JSON)]
            ).encode(),
        ),
        rows=[*stored(STEPS[:1], has_ids=False), *stored(STEPS[1:])],
    ),
    Odd("Feather", feather, rows=stored()),
    Odd("Arrow IPC with timestamps and dictionaries", arrow_ipc, rows=stored()),
    Odd("a folder of tables", tables, rows=stored()),
    Odd("a zip of tables", packed, rows=stored()),
    Odd("a zip whose names lead outside", escaping, rows=stored()),
    Odd("partitioned Parquet", hive, rows=TWO_CAMERAS, cameras=("cam-1", "cam-2")),
    Odd(
        "shares of the picture with its size",
        text("a.csv", BOX, rows(boxes)),
        ("--size", "1003x499"),
        rows=[
            (c, t, i, -round((0.1 + s.x_m / 25) * 1003 * 4), -round((0.2 + s.y_m / 16) * 499 * 4))
            for s, (c, t, i, _, _) in zip(STEPS, stored(), strict=True)
        ],
    ),
    Odd(
        "whole minutes with a stated period",
        text("a.csv", NAMES, rows(written("%Y-%m-%dT%H:%MZ"), STEPS[:6])),
        ("--period", "60"),
        rows=stored(STEPS[:6]),
    ),
    # refused, with the reason
    Odd(
        "millimetres as metres",
        text("a.csv", ("ts", "track_id", "x", "y"), rows(lambda s: [*plain(s)[:2], s.x_m * 1000, s.y_m * 1000])),
        MAP_XY,
        says="W220",
    ),
    Odd(
        "centimetres as metres",
        text("a.csv", ("ts", "track_id", "x", "y"), rows(lambda s: [*plain(s)[:2], s.x_m * 100, s.y_m * 100])),
        MAP_XY,
        says="W220",
    ),
    Odd(
        "a pixel as metres",
        text("a.csv", ("ts", "track_id", "x2", "y2"), rows(lambda s: [*plain(s)[:2], s.x_m * 60, s.y_m * 60])),
        ("--map", "x_m=x2,y_m=y2"),
        says="W220",
    ),
    Odd(
        "three cameras as one",
        text("a.csv", ("camera", *NAMES), rows(lambda s: [f"c{s.track % 3}", *plain(s)])),
        says="W221",
    ),
    Odd(
        "cars as people",
        text("a.csv", (*NAMES, "class_name"), rows(lambda s: [*plain(s), "car" if s.track == 1 else "person"])),
        says="W222",
    ),
    Odd(
        "classes by number",
        text("a.csv", (*NAMES, "cls"), rows(lambda s: [*plain(s), 2 if s.track == 1 else 0])),
        says="W222",
    ),
    Odd(
        "dates alone",
        text(
            "a.csv",
            ("date", "time", *NAMES[1:]),
            rows(lambda s: [f"{s.at:%Y-%m-%d}", f"{s.at:%H:%M:%S}", *plain(s)[1:]]),
        ),
        ("--map", "ts=date"),
        says="ts=date+time",
    ),
    Odd("whole minutes", text("a.csv", NAMES, rows(written("%Y-%m-%dT%H:%MZ"))), says="whole minutes"),
    Odd(
        "whole minutes without ids",
        text("a.csv", NAMES, rows(lambda s: [f"{s.at:%Y-%m-%dT%H:%MZ}", "", s.x_m, s.y_m], walks(seconds=180))),
        says="whole minutes",
    ),
    Odd("days that could be months", text("a.csv", NAMES, rows(written("%d/%m/%Y %H:%M:%S"), EARLY)), says="E210"),
    Odd("shares of the picture as pixels", text("a.csv", BOX, rows(boxes)), says="--size"),
    Odd(
        "shares of the plan as metres",
        text("a.csv", NAMES, rows(lambda s: [*plain(s)[:2], s.x_m / 20, s.y_m / 12])),
        says="W220",
    ),
    Odd(
        "metres as pixels",
        text("a.csv", ("ts", "track_id", "x", "y"), rows(plain)),
        ("--map", "u_px=x,v_px=y"),
        says="W226",
    ),
    Odd("no header", text("a.csv", plain(STEPS[0]), rows(plain)[1:]), says="E203"),
    Odd("times without dates", text("a.csv", NAMES, rows(written("%H:%M:%S"))), says="not-a-time"),
    Odd(
        "seconds since the film began",
        text("a.csv", NAMES, [[i / 25, *plain(s)[1:]] for i, s in enumerate(STEPS)]),
        says="in the year 1970",
    ),
    Odd("UTF-16", text("a.csv", NAMES, rows(plain), encoding="utf-16"), says="UTF-16"),
    Odd("a zip of pictures", pictures, says="E204"),
    Odd(
        "an old workbook",
        raw("a.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600)),
        ("--format", "table"),
        says="xls",
    ),
    Odd("a folder with one table of another kind", half_good, says="E203"),
    Odd("JSON that is no table", raw("a.json", b"[1, 2, {}]"), says="E204"),
    Odd("half a JSON array of something else", raw("a.json", json.dumps([{"a": 1}] * 20).encode()[:-9]), says="E203"),
    Odd("a Feather file of gigabytes", feather_bomb, says="E20"),
    Odd(
        "an Arrow file without its end",
        lambda folder: raw("b.feather", feather(folder).read_bytes()[:-200])(folder),
        says="E205",
    ),
    Odd("HTML", raw("a.csv", b"<!DOCTYPE html><html><body>Please log in</body></html>\n"), says="a web page"),
]

WORKBOOKS: list[Odd] = [
    Odd("workbook with dates", workbook(("Sheet1", [NAMES, *rows(as_excel)])), rows=stored()),
    Odd(
        "workbook with an empty sheet and empty rows above",
        workbook(("Notes", []), ("Data", [[], [], NAMES, *rows(as_excel)])),
        rows=stored(),
    ),
    Odd("workbook with text times", workbook(("Sheet1", [NAMES, *rows(plain)])), rows=stored()),
    Odd(
        "workbook with two full sheets",
        workbook(("A", [NAMES, *rows(as_excel)]), ("B", [NAMES, *rows(as_excel)])),
        says="E204",
    ),
    Odd(
        "workbook without the time of day",
        workbook(("A", [("day", *NAMES[1:]), *rows(lambda s: [s.at.date(), *plain(s)[1:]])])),
        ("--map", "ts=day"),
        says="W224",
    ),
]
