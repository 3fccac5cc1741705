"""Files that look right and are not: each was once stored wrongly without a word. See `odd_files`.

They are read by a site without a plan or pictures, where nothing but the file can tell.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

from odd_files import NAMES, STEPS, Odd, plain, raw, rows, stored, text
from walks import Step

FEW = STEPS[:120]
MAP_XY = ("--map", "x_m=x,y_m=y")
IN_FEET = [Step(s.at, s.track, s.x_m / 0.3048, s.y_m / 0.3048) for s in FEW]
LATE = timedelta(hours=14, minutes=59, seconds=50)
ROUNDED = stored([Step(s.at, s.track, round(s.x_m), round(s.y_m)) for s in FEW])
PAST_NOON = [
    Step(datetime(2025, 11, 25, 12, 59, 30, tzinfo=UTC) + (s.at - STEPS[0].at), s.track, s.x_m, s.y_m) for s in STEPS
]


def table(names: Sequence[str], make: Callable[[Step], Sequence[object]], steps: Sequence[Step] = FEW) -> object:
    return text("a.csv", names, rows(make, steps))


def times(make: Callable[[Step], object], steps: Sequence[Step] = FEW) -> object:
    return table(NAMES, lambda s: [make(s), *plain(s)[1:]], steps)


def places(names: Sequence[str], make: Callable[[Step], Sequence[object]]) -> object:
    return table(("ts", "track_id", *names), lambda s: [*plain(s)[:2], *make(s)])


def with_column(name: str, make: Callable[[Step], object]) -> object:
    return table((*NAMES, name), lambda s: [*plain(s), make(s)])


def box(names: str, make: Callable[[float, float], Sequence[float]]) -> object:
    return places(names.split(), lambda s: make(100 + 50 * s.x_m, 200 + 30 * s.y_m))


def folder_of(**files: Sequence[Step]) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        for name, steps in files.items():
            part = folder / "day" / name
            part.parent.mkdir(parents=True, exist_ok=True)
            text(part.name, NAMES, rows(plain, steps))(part.parent)
        return folder / "day"

    return write


def beside_a_workbook(folder: Path) -> Path:
    day = folder_of(**{"a.csv": FEW})(folder)
    (day / "b.xlsx").write_bytes(b"PK\x03\x04 a workbook")
    (day / "readme.txt").write_text("made by hand")
    return day


def in_a_list(s: Step) -> dict[str, object]:
    seen = {"id": s.track, "x": s.x_m, "y": s.y_m}
    return {"t": s.at.isoformat(), "cams": [{"who": [seen]}, {"who": [seen]}]}


def two_in_a_row(names: str, *, has_ids: bool = False) -> object:
    couples = [(FEW[i], FEW[i + 1]) for i in range(0, len(FEW), 6)]
    made = [
        [a.at.isoformat(), *((a.track, b.track) if has_ids else ()), a.x_m, a.y_m, b.x_m, b.y_m] for a, b in couples
    ]
    return text("a.csv", names.split(), made)


ODDEST: list[Odd] = [
    # places
    Odd(
        "feet", places(("x", "y"), lambda s: (s.x_m / 0.3048, s.y_m / 0.3048)), MAP_XY, stored(IN_FEET), "would walk at"
    ),
    Odd(
        "inches after the axis",
        places(("x_in", "Y [in]"), lambda s: (s.x_m / 0.0254, s.y_m / 0.0254)),
        ("--map", "x_m=x_in,y_m=Y [in]"),
        rows=stored(FEW),
    ),
    Odd(
        "centimetres in German",
        places(("x Zentimeter", "y Zentimeter"), lambda s: (s.x_m * 100, s.y_m * 100)),
        ("--map", "x_m=x Zentimeter,y_m=y Zentimeter"),
        rows=stored(FEW),
    ),
    Odd(
        "degrees by name",
        places(("lon", "lat"), lambda s: (9.19 + s.x_m / 78_000, 45.46 + s.y_m / 111_320)),
        ("--map", "x_m=lon,y_m=lat"),
        says="W220",
    ),
    Odd("degrees", places(("x", "y"), lambda s: (9 + s.x_m / 78_000, 45 + s.y_m / 111_320)), MAP_XY, says="W220"),
    Odd("height for y", places(("x", "y", "z"), lambda s: (s.x_m, 1 + s.track / 99, s.y_m)), MAP_XY, says="y_m=z"),
    Odd(
        "zeros for lost people",
        places(("x_m", "y_m"), lambda s: (s.x_m * (s.track > 2), s.y_m * (s.track > 2))),
        says="exactly 0, 0",
    ),
    Odd(
        "speeds", places(("vel_x", "vel_y"), lambda s: (s.x_m, s.y_m)), ("--map", "x_m=vel_x,y_m=vel_y"), says="a speed"
    ),
    Odd(
        "whole metres",
        places(("x_m", "y_m"), lambda s: (round(s.x_m), round(s.y_m))),
        rows=ROUNDED,
        says="whole metres",
    ),
    Odd(
        "people inside each other",
        table(NAMES, plain, [*FEW, *(Step(s.at, s.track + 50, s.x_m + 0.03, s.y_m) for s in FEW)]),
        says="within 20 cm",
    ),
    Odd(
        "narrow blanks and minus signs",
        places(
            ("x_mm", "y_mm"),
            lambda s: (f"{s.x_m * -1000:,.0f}".replace(",", "\u202f").replace("-", "\u2212"), s.y_m * 1000),
        ),
        ("--map", "x_m=x_mm,y_m=y_mm"),
        rows=stored([Step(s.at, s.track, -s.x_m, s.y_m) for s in FEW]),
    ),
    # times
    Odd(
        "a date that stays",
        times(lambda s: f"2025-11-25T{s.at + LATE:%H:%M:%S}"),
        ("--zone", "UTC"),
        says="at midnight",
    ),
    Odd(
        "an hour that clocks skip",
        times(lambda s: f"2025-03-30 02:{s.at:%M:%S}"),
        ("--zone", "Europe/Berlin"),
        rows=[(c, ms - 20_764_800_000, *more) for c, ms, *more in stored(FEW)],
        says="skips",
    ),
    Odd("twelve hours without AM and PM", times(lambda s: f"{s.at:%Y-%m-%d %I:%M:%S}", PAST_NOON), says="W227"),
    Odd("seconds since 2001", times(lambda s: s.at.timestamp() - 978_307_200), says="in the year 1994"),
    Odd("digits of a date", times(lambda s: f"{s.at:%Y%m%d%H%M%S}"), says='--time-format "%Y%m%d%H%M%S"'),
    Odd("times of single people", times(lambda s: s.at + timedelta(milliseconds=150 * s.track)), says="--period 1"),
    Odd("times with UTC behind them", times(lambda s: f"{s.at:%Y-%m-%d %H:%M:%S} UTC"), rows=stored(FEW)),
    # boxes
    Odd(
        "far corners as sizes",
        box("x1 y1 x2 y2", lambda u, v: (u - 20, v - 120, u + 20, v)),
        ("--map", "left=x1,top=y1,width=x2,height=y2"),
        says="far corner",
    ),
    Odd(
        "boxes upwards", box("left top right bottom", lambda u, v: (u - 9, 840 - v, u + 9, 720 - v)), says="above their"
    ),
    Odd(
        "pixels as shares",
        box("left top right bottom", lambda u, v: (u - 20, v - 120, u + 20, v)),
        ("--size", "1280x720"),
        says="W226",
    ),
    # columns
    Odd(
        "predicted rows",
        with_column("remark", lambda s: "predicted" if s.track > 4 else "ok"),
        rows=stored(FEW),
        says="W222",
    ),
    Odd("carts in French", with_column("objet", lambda s: "chariot" if s.track > 4 else "personne"), says="W222"),
    Odd("telecamera", with_column("telecamera", lambda s: f"c{s.track % 3}"), says="W221"),
    Odd("caméra", with_column("caméra", lambda s: f"c{s.track % 3}"), says="W221"),
    Odd("cameras in a topic", with_column("topic", lambda s: f"site/cam{s.track % 3}/people"), says="W221"),
    Odd("two floors", with_column("floor", lambda s: s.track % 2), says="W221"),
    Odd("cars in German", with_column("Klasse", lambda s: "Person" if s.track > 2 else "Auto"), says="W222"),
    Odd("people in Italian", with_column("classe", lambda s: "persona"), rows=stored(FEW)),
    Odd("numbers of COCO's own files", with_column("category_id", lambda s: 1 + s.track % 2), says="category_id = 1"),
    Odd("rows of lost people", with_column("lost", lambda s: int(s.track > 4)), says="lost = 0"),
    Odd(
        "percents of confidence",
        with_column("confidence", lambda s: 15 * s.track),
        ("--where", "confidence >= 0.4"),
        says="compare it with 40",
    ),
    Odd(
        "confidence in a byte",
        with_column("confidence", lambda s: 255 - s.track),
        ("--where", "confidence >= 0.4"),
        says="compare it with 102",
    ),
    Odd(
        "a filter that leaves nothing",
        with_column("class", lambda s: "Person"),
        ("--where", "class = 'person'"),
        says="'class' holds Person",
    ),
    Odd(
        "states",
        with_column("track_state", lambda s: "lost" if s.track > 4 else "tracked"),
        says="track_state = 'tracked'",
    ),
    Odd("weak detections", with_column("conf", lambda s: 0.05 * s.track), rows=stored(FEW), says="conf >= 0.3"),
    Odd("staff and customers", with_column("type_of_person", lambda s: "staff"), rows=stored(FEW)),
    Odd("kinds of people", with_column("category", lambda s: "staff"), rows=stored(FEW), says="W222"),
    Odd("a column twice", table((*NAMES, "x_m"), lambda s: [*plain(s), s.y_m]), says="more than one column 'x_m'"),
    # other shapes
    Odd(
        "a second header in another order",
        raw(
            "a.csv",
            b"ts,track_id,x_m,y_m\n2025-11-25T09:00:00Z,1,5,6\nts,track_id,y_m,x_m\n2025-11-25T09:00:01Z,1,6,5\n",
        ),
        says="a second header",
    ),
    Odd(
        "one of two lists of people",
        raw("a.jsonl", b"".join(json.dumps(in_a_list(s)).encode() + b"\n" for s in FEW)),
        ("--persons", "cams.0.who", "--map", "ts=t,track_id=id,x_m=x,y_m=y"),
        says="'cams.0' is one entry",
    ),
    Odd("two people in a row", two_in_a_row("ts p1_x p1_y p2_x p2_y"), says="several people"),
    Odd("the first of two", two_in_a_row("ts p1_x p1_y p2_x p2_y"), ("--map", "x_m=p1_x,y_m=p1_y"), says="W228"),
    Odd("pairs", two_in_a_row("ts id1 id2 x1 y1 x2 y2", has_ids=True), says="track_a=id1,track_b=id2,x_a_m=x1"),
    Odd(
        "pairs as boxes",
        two_in_a_row("ts id1 id2 x1 y1 x2 y2", has_ids=True),
        ("--map", "track_id=id1,left=x1,top=y1,right=x2,bottom=y2"),
        says="W228",
    ),
    Odd("a folder of two cameras", folder_of(**{"cam1.csv": FEW[::2], "cam2.csv": FEW[1::2]}), says="W221"),
    Odd("folders of two cameras", folder_of(**{"cam1/a.csv": FEW[::2], "cam2/a.csv": FEW[1::2]}), says="W221"),
    Odd("a folder with a workbook", beside_a_workbook, rows=stored(FEW), says="b.xlsx is not read"),
    # what they are
    Odd("a 7z archive", raw("a.7z", b"7z\xbc\xaf\x27\x1c" + bytes(99)), says="a 7z archive"),
    Odd("a stream of Arrow", raw("a.arrows", b"\xff\xff\xff\xff" + bytes(99)), says="a stream of Arrow"),
    Odd("an HDF5 file", raw("a.h5", b"\x89HDF\r\n\x1a\n" + bytes(99)), says="an HDF5 file"),
    Odd(
        "features of GeoJSON",
        raw("a.geojson", json.dumps({"type": "FeatureCollection", "features": []}).encode()),
        says="jq -c '.features[]'",
    ),
]
