"""More odd files, as people export, convert and pack them; see `odd_files`."""

from __future__ import annotations

import csv
import decimal
import gzip
import io
import json
import tarfile
import zipfile
from collections.abc import Callable
from datetime import UTC
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from odd_files import (
    BERLIN,
    BOX,
    EARLY,
    JSON,
    MAP_XY,
    NAMES,
    STEPS,
    Odd,
    boxes,
    naive,
    plain,
    raw,
    rows,
    stored,
    text,
    workbook,
    written,
)
from walks import Step

PICTURE = [
    (c, t, i, -round((0.1 + s.x_m / 25) * 1280 * 4), -round((0.2 + s.y_m / 16) * 720 * 4))
    for s, (c, t, i, _, _) in zip(STEPS, stored(), strict=True)
]
"""What `boxes` of a picture of 1280 by 720 are stored as."""
BY_CENTRE = [
    (*row[:4], -round(((top + bottom) / 2 + (bottom - top) / 2) * 4))
    for row, (*_, top, _, bottom) in zip(PICTURE, (boxes(s, 1280, 720) for s in STEPS), strict=True)
]
"""The same from centre and height, in floating point: a quarter of a pixel may be rounded to the other side."""
DAY_24 = [Step(s.at.replace(day=24), s.track, s.x_m, s.y_m) for s in STEPS]
NO_TRACK = [row for s in STEPS for row in stored([s], has_ids=s.track > 2)]


def lines(*given: str) -> bytes:
    return ("\n".join(given) + "\n").encode()


def csv_text(names: Any = NAMES, body: Any = None, **how: Any) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n", **how).writerows([names, *(rows(plain) if body is None else body)])
    return out.getvalue()


def places(factor: float, digits: int = 4) -> Callable[[Step], list[Any]]:
    return lambda s: [s.at.isoformat(), s.track, round(s.x_m * factor, digits), round(s.y_m * factor, digits)]


def box(names: str, make: Callable[[float, float, float, float], list[float]]) -> Any:
    """Return a writer of boxes of a picture of 1280 by 720, from left, top, right and bottom."""

    def row(s: Step) -> list[Any]:
        ts, track, left, top, right, bottom = boxes(s, 1280, 720)
        return [ts, track, *make(left, top, right, bottom)]

    return text("a.csv", ("ts", "track_id", *names.split()), rows(row))


def centred(left: float, top: float, right: float, bottom: float) -> list[float]:
    return [(left + right) / 2, (top + bottom) / 2, right - left, bottom - top]


def sized(left: float, top: float, right: float, bottom: float) -> list[float]:
    return [left, top, right - left, bottom - top]


def pointlike(left: float, top: float, _right: float, _bottom: float) -> list[float]:
    return [left, top, left, top]


def parquet(make: Callable[[], dict[str, Any]]) -> Any:
    def write(folder: Path) -> Path:
        pq.write_table(pa.table(make()), folder / "a.parquet")
        return folder / "a.parquet"

    return write


def columns(**other: Any) -> dict[str, Any]:
    return {
        "ts": pa.array([s.at for s in STEPS], pa.timestamp("us", "UTC")),
        "track_id": pa.array([s.track for s in STEPS]),
        "x_m": pa.array([s.x_m for s in STEPS]),
        "y_m": pa.array([s.y_m for s in STEPS]),
        **other,
    }


def zipped(**files: bytes) -> Any:
    def write(folder: Path) -> Path:
        with zipfile.ZipFile(folder / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.mkdir("export")
            archive.mkdir("export/empty")
            for name, data in files.items():
                archive.writestr(name, data)
        return folder / "a.zip"

    return write


def tarred(folder: Path) -> Path:
    with tarfile.open(folder / "a.tar.gz", "w:gz") as archive:
        for i in range(3):
            data = csv_text(body=rows(plain, STEPS[i::3])).encode()
            info = tarfile.TarInfo(f"day/{i}.csv")
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
        link = tarfile.TarInfo("day/4.csv")
        link.type, link.linkname = tarfile.SYMTYPE, "/etc/passwd"
        archive.addfile(link)
    return folder / "a.tar.gz"


def linked(folder: Path) -> Path:
    (folder / "real.csv").write_text(csv_text())
    (folder / "link.csv").symlink_to(folder / "real.csv")
    return folder / "link.csv"


def folder_with_links(folder: Path) -> Path:
    (folder / "day").mkdir()
    (folder / "day" / "a.csv").write_text(csv_text())
    (folder / "day" / "loop").symlink_to(folder / "day")
    (folder / "day" / "dead.csv").symlink_to(folder / "nothing.csv")
    return folder / "day"


MONTHS = ("Januar", "Februar", "März", "April", "Mai", "Juni", "Juli", "August", "September", "Oktober", "November")


def in_words(s: Step) -> list[Any]:
    return [f"{s.at.day}. {MONTHS[s.at.month - 1]} {s.at:%Y %H:%M:%S}", *plain(s)[1:]]


ODDER: list[Odd] = [
    # units
    Odd(
        "inches in the name",
        text("a.csv", ("ts", "track_id", "x (inches)", "y (inches)"), rows(places(1 / 0.0254))),
        ("--map", "x_m=x (inches),y_m=y (inches)"),
        rows=stored(),
    ),
    Odd(
        "yards in the name",
        text("a.csv", ("ts", "track_id", "x_yd", "y_yd"), rows(places(1 / 0.9144, 5))),
        ("--map", "x_m=x_yd,y_m=y_yd"),
        rows=stored(),
    ),
    Odd(
        "stated inches",
        text("a.csv", ("ts", "track_id", "x", "y"), rows(places(1 / 0.0254))),
        (*MAP_XY, "--unit", "in"),
        rows=stored(),
    ),
    Odd(
        "scientific notation",
        text("a.csv", NAMES, rows(lambda s: [*plain(s)[:2], f"{s.x_m:.6E}", f"{s.y_m:.6e}"])),
        rows=stored(),
    ),
    Odd(
        "thousands with commas",
        text(
            "a.csv",
            ("ts", "track_id", "x_mm", "y_mm"),
            rows(lambda s: [*plain(s)[:2], f"{s.x_m * 1000:,.0f}", f"{s.y_m * 1000:,.0f}"]),
        ),
        ("--map", "x_m=x_mm,y_m=y_mm"),
        says="not-a-number",
    ),
    Odd(
        "thousands with dots",
        text(
            "a.csv",
            ("ts", "track_id", "x_mm", "y_mm"),
            rows(lambda s: [*plain(s)[:2], *(f"{v * 1000:,.0f}".replace(",", ".") for v in (s.x_m, s.y_m))]),
            by=";",
        ),
        ("--map", "x_m=x_mm,y_m=y_mm"),
        says="W220",
    ),
    Odd(
        "decimal commas in quotes",
        text(
            "a.csv", NAMES, rows(lambda s: [*plain(s)[:2], str(s.x_m).replace(".", ","), str(s.y_m).replace(".", ",")])
        ),
        says="not-a-number",
    ),
    Odd(
        "units in the cells",
        text("a.csv", NAMES, rows(lambda s: [*plain(s)[:2], f"{s.x_m} m", f"{s.y_m} m"])),
        says="not-a-number",
    ),
    Odd(
        "degrees as metres",
        text(
            "a.csv",
            ("ts", "track_id", "lat", "lon"),
            rows(lambda s: [*plain(s)[:2], 45.46 + s.y_m / 111_320, 9.19 + s.x_m / 78_000]),
        ),
        ("--map", "x_m=lon,y_m=lat"),
        says="W220",
    ),
    Odd(
        "percents of the plan as metres",
        text("a.csv", NAMES, rows(lambda s: [*plain(s)[:2], s.x_m / 20 * 100, s.y_m / 12 * 100])),
        says="W220",
    ),
    # times
    Odd(
        "seconds since 1970 in quotes",
        text("a.csv", NAMES, rows(lambda s: [f"{s.at.timestamp():.0f}", *plain(s)[1:]]), quoting=csv.QUOTE_ALL),
        rows=stored(),
    ),
    Odd(
        "nanoseconds since 1970",
        text("a.csv", NAMES, rows(lambda s: [f"{round(s.at.timestamp())}000000000", *plain(s)[1:]])),
        rows=stored(),
    ),
    Odd(
        "microseconds with a fraction",
        text("a.csv", NAMES, rows(lambda s: [f"{round(s.at.timestamp())}000000.5", *plain(s)[1:]])),
        rows=stored(),
    ),
    Odd(
        "fractions after a comma, as logs write them",
        text("a.csv", NAMES, rows(lambda s: [f"{s.at:%Y-%m-%d %H:%M:%S},000", *plain(s)[1:]])),
        rows=stored(),
    ),
    Odd(
        "a year of two digits that could be a day",
        text("a.csv", NAMES, rows(written("%y/%m/%d %H:%M:%S"), DAY_24)),
        says="E210",
    ),
    Odd(
        "a year of two digits, stated",
        text("a.csv", NAMES, rows(written("%y/%m/%d %H:%M:%S"), DAY_24)),
        ("--time-format", "%y/%m/%d %H:%M:%S"),
        rows=stored(DAY_24),
    ),
    Odd("months in German", text("a.csv", NAMES, rows(in_words)), says="not-a-time"),
    Odd(
        "months in English, stated",
        text("a.csv", NAMES, rows(written("%d %b %Y %H:%M:%S"))),
        ("--time-format", "%d %b %Y %H:%M:%S"),
        rows=stored(),
    ),
    Odd(
        "names of zones",
        text("a.csv", NAMES, rows(lambda s: [f"{s.at:%Y-%m-%d %H:%M:%S} CET", *plain(s)[1:]])),
        says="not-a-time",
    ),
    Odd(
        "days since 1899, as Excel counts",
        text("a.csv", NAMES, rows(lambda s: [s.at.timestamp() / 86400 + 25569, *plain(s)[1:]])),
        says="as Excel counts",
    ),
    Odd(
        "days of Matlab",
        text("a.csv", NAMES, rows(lambda s: [s.at.timestamp() / 86400 + 719529, *plain(s)[1:]])),
        says="days of Matlab (datenum): (days - 719529) * 86400",
    ),
    Odd(
        "Julian days",
        text("a.csv", NAMES, rows(lambda s: [s.at.timestamp() / 86400 + 2440587.5, *plain(s)[1:]])),
        says="Julian days: (days - 2440587.5) * 86400",
    ),
    Odd(
        "people counted at a line",
        text("a.csv", ["ts", "enter", "leave"], rows(lambda s: [s.at.isoformat(), s.track % 3, s.track % 2])),
        says="has counts of people and no places",
    ),
    Odd(
        "dates of JavaScript",
        text("a.csv", NAMES, rows(lambda s: [f"{s.at:%a %b %d %Y %H:%M:%S} GMT+0000", *plain(s)[1:]])),
        says="not-a-time",
    ),
    Odd("month first in dots", text("a.csv", NAMES, rows(written("%m.%d.%Y %H:%M:%S"))), says="not-a-time"),
    Odd(
        "local times with different offsets",
        text(
            "a.csv", NAMES, rows(lambda s: [s.at.astimezone(BERLIN if s.track % 2 else UTC).isoformat(), *plain(s)[1:]])
        ),
        rows=stored(),
    ),
    Odd(
        "ISO times of a week",
        text("a.csv", NAMES, rows(lambda s: [f"{s.at:%G-W%V-%u}T{s.at:%H:%M:%S}Z", *plain(s)[1:]])),
        says="not-a-time",
    ),
    # ids
    Odd(
        "ids with minus one for nobody",
        text("a.csv", NAMES, rows(lambda s: [s.at.isoformat(), s.track if s.track > 2 else -1, s.x_m, s.y_m])),
        rows=NO_TRACK,
        says="120 of 360 rows have no track id",
    ),
    Odd(
        "ids with words for nothing",
        text(
            "a.csv",
            NAMES,
            rows(lambda s: [s.at.isoformat(), s.track if s.track > 2 else ("None", "NULL")[s.track - 1], s.x_m, s.y_m]),
        ),
        rows=NO_TRACK,
        says="120 of 360 rows have no track id",
    ),
    Odd("one id for all", text("a.csv", NAMES, rows(lambda s: [s.at.isoformat(), 1, s.x_m, s.y_m])), says="W224"),
    # boxes
    Odd("corner and size", box("x y w h", sized), ("--map", "left=x,top=y,width=w,height=h"), rows=PICTURE),
    Odd(
        "centre and size",
        box("cx cy w h", centred),
        ("--map", "center_x=cx,center_y=cy,width=w,height=h"),
        rows=BY_CENTRE,
    ),
    Odd(
        "two corners under other names",
        box("xmin ymin xmax ymax", lambda *sides: list(sides)),
        ("--map", "left=xmin,top=ymin,right=xmax,bottom=ymax"),
        rows=PICTURE,
    ),
    Odd(
        "a centre as a corner",
        box("x_center y_center w h", centred),
        ("--map", "left=x_center,top=y_center,width=w,height=h"),
        says="W226",
    ),
    Odd("sizes as corners", box("x y w h", sized), ("--map", "left=x,top=y,right=w,bottom=h"), says="bad-box"),
    Odd("boxes without a size", box("left top right bottom", pointlike), says="bad-box"),
    Odd(
        "an unmapped box",
        box("x1 y1 x2 y2", lambda *sides: list(sides)),
        says="--map left=x1,top=y1,right=x2,bottom=y2",
    ),
    Odd("percents of the picture", text("a.csv", BOX, rows(lambda s: boxes(s, 100, 100))), says="W226"),
    # text
    Odd("UTF-16 without a mark", text("a.csv", NAMES, rows(plain), encoding="utf-16-le"), says="E204"),
    Odd("UTF-32", text("a.csv", NAMES, rows(plain), encoding="utf-32"), says="E20"),
    Odd(
        "Windows-1252 in a column nobody reads",
        raw("a.csv", csv_text((*NAMES, "place"), rows(lambda s: [*plain(s), "Küche"])).encode("cp1252")),
        rows=stored(),
    ),
    Odd("line ends of old Macs", raw("a.csv", csv_text().replace("\n", "\r").encode()), says="E20"),
    Odd(
        "a header by tabs and rows by commas",
        raw("a.csv", ("\t".join(NAMES) + "\n" + csv_text().partition("\n")[2]).encode()),
        says="wrong-number-of-fields",
    ),
    Odd("remarks above the header", raw("a.csv", ("# made by acme 3\n# hall\n" + csv_text()).encode()), rows=stored()),
    Odd(
        "a place in one cell",
        raw(
            "a.csv", csv_text(("ts", "track_id", "xy"), rows(lambda s: [*plain(s)[:2], f"({s.x_m}, {s.y_m})"])).encode()
        ),
        says="E203",
    ),
    Odd("pipes", text("a.csv", NAMES, rows(plain), by="|"), rows=stored()),
    Odd(
        "a header in capitals with blanks",
        text("a.csv", (" TS ", "Track_ID", " X_M", "Y_M "), rows(plain)),
        rows=stored(),
    ),
    Odd("an empty file", raw("a.csv", b""), says="E202"),
    Odd("a header alone", raw("a.csv", lines(",".join(NAMES))), says="W212"),
    Odd("blank lines alone", raw("a.csv", b"\n\n \n"), says="E20"),
    Odd(
        "a truncated gzip from its first line on", raw("a.csv.gz", gzip.compress(csv_text().encode())[:30]), says="E205"
    ),
    # JSON
    Odd(
        "JSON with NaN",
        raw("a.json", json.dumps([{**o, "x_m": float("nan")} for o in JSON]).encode()),
        says="not-a-number",
    ),
    Odd(
        "JSON with nested places",
        raw(
            "a.json",
            json.dumps(
                [{"ts": o["ts"], "track_id": o["track_id"], "pos": [o["x_m"], o["y_m"]]} for o in JSON]
            ).encode(),
        ),
        says="x_m=pos.0",
    ),
    Odd(
        "JSON lines with nested places",
        raw(
            "a.jsonl",
            "\n".join(
                json.dumps({"ts": o["ts"], "id": o["track_id"], "pos": {"x": o["x_m"], "y": o["y_m"]}}) for o in JSON
            ).encode(),
        ),
        ("--format", "json", "--map", "ts=ts,track_id=id,x_m=pos.x,y_m=pos.y"),
        rows=stored(),
    ),
    Odd(
        "one JSON object a file",
        raw(
            "a.json",
            json.dumps(
                {
                    "ts": JSON[0]["ts"],
                    "people": [{"id": o["track_id"], "x": o["x_m"], "y": o["y_m"]} for o in JSON[:6]],
                },
                indent=2,
            ).encode(),
        ),
        ("--persons", "people", "--map", "ts=ts,track_id=id,x_m=x,y_m=y"),
        rows=stored(STEPS[:6]),
    ),
    Odd(
        "columns of lists in JSON",
        raw("a.json", json.dumps({n: [o[n] for o in JSON] for n in NAMES}).encode()),
        says="E20",
    ),
    # Parquet
    Odd(
        "Parquet with dictionaries",
        parquet(lambda: columns(track_id=pa.array([f"p{s.track}" for s in STEPS]).dictionary_encode())),
        rows=[(c, t, f"p{i}", x, y) for c, t, i, x, y in stored()],
    ),
    Odd(
        "Parquet with decimals",
        parquet(lambda: columns(x_m=pa.array([decimal.Decimal(str(s.x_m)) for s in STEPS], pa.decimal128(10, 3)))),
        rows=stored(),
    ),
    Odd(
        "Parquet with nanoseconds in another zone",
        parquet(lambda: columns(ts=pa.array([s.at for s in STEPS], pa.timestamp("ns", "Asia/Tokyo")))),
        rows=stored(),
    ),
    Odd("Parquet with lists", parquet(lambda: columns(x_m=pa.array([[s.x_m] for s in STEPS]))), says="E20"),
    Odd(
        "Parquet with texts of large kind",
        parquet(lambda: columns(track_id=pa.array([str(s.track) for s in STEPS], pa.large_string()))),
        rows=stored(),
    ),
    Odd(
        "Parquet with half floats",
        parquet(lambda: columns(x_m=pa.array([s.x_m for s in STEPS], pa.float32()))),
        rows=stored(),
    ),
    Odd(
        "Parquet with times of day",
        parquet(lambda: columns(ts=pa.array([s.at.time() for s in STEPS], pa.time64("us")))),
        says="E20",
    ),
    # packed
    Odd(
        "gzip inside a zip with empty folders",
        zipped(**{"export/a.csv.gz": gzip.compress(csv_text().encode())}),
        rows=stored(),
    ),
    Odd("a zip inside a zip", zipped(**{"inner.zip": b"PK\x03\x04" + bytes(100)}), says="E204"),
    Odd("a tar with a link to elsewhere", tarred, rows=stored()),
    Odd("a link to a file", linked, rows=stored()),
    Odd("a folder with a loop and a dead link", folder_with_links, rows=stored()),
    Odd(
        "local times in whole hours of another zone",
        text("a.csv", NAMES, rows(naive)),
        ("--zone", "Asia/Kolkata"),
        rows=[(c, t - 19_800_000, i, x, y) for c, t, i, x, y in stored()],
    ),
    Odd(
        "days and months, early in the month", text("a.csv", NAMES, rows(written("%d-%m-%Y %H:%M"), EARLY)), says="E210"
    ),
]

ODDER_WORKBOOKS: list[Odd] = [
    Odd(
        "a merged title above the header",
        workbook(("A", [["Report of the hall"], NAMES, *rows(lambda s: [s.at.replace(tzinfo=None), *plain(s)[1:]])])),
        rows=stored(),
    ),
    Odd(
        "numbers of days without a date format",
        workbook(("A", [NAMES, *rows(lambda s: [s.at.timestamp() / 86400 + 25569, *plain(s)[1:]])])),
        says="as Excel counts",
    ),
    Odd(
        "formulas without their values",
        workbook(("A", [NAMES, *rows(lambda s: [s.at.replace(tzinfo=None), s.track, f"={s.x_m}*1", s.y_m])])),
        says="no-position",
    ),
]
