"""Files in which only what columns hold, or how distances and ids fit together, tells that they are not what they seem.

They are read as those of `oddest_files`, by a site without a plan or pictures.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from itertools import combinations, groupby
from math import hypot

from marked_files import marked
from odd_files import NAMES, STEPS, Odd, plain, raw, rows, stored, text
from oddest_files import FEW, box, table, times, with_column
from walks import Step, walks

CROWD = walks(n_people=9, seconds=40, seed=3)
STANDING = walks(n_people=10, seconds=60, seed=4)
PAIRS = [
    (a, b, hypot(a.x_m - b.x_m, a.y_m - b.y_m))
    for _, frame in groupby(CROWD, key=lambda s: s.at)
    for a, b in combinations(list(frame), 2)
]
STILL_FROM = 4
"""In `STANDING`, people with this number or a higher one do not move."""


def pairs(make: Callable[[float], object], *, with_places: bool = False) -> object:
    names = ["ts", "track_a", "track_b", "distance_m", *(["x_a_m", "y_a_m", "x_b_m", "y_b_m"] if with_places else [])]
    made = [
        [a.at.isoformat(), a.track, b.track, make(d), *([a.x_m, a.y_m, b.x_m, b.y_m] if with_places else [])]
        for a, b, d in PAIRS
    ]
    return text("a.csv", names, made)


def numbered() -> object:
    """Return a table whose ids number the people of each frame, who come and go."""
    made = []
    for at, frame in groupby(STEPS, key=lambda s: s.at):
        seen = [s for s in frame if (s.track + at.second) % 5]
        made += [[at.isoformat(), number, s.x_m, s.y_m] for number, s in enumerate(seen)]
    return text("a.csv", NAMES, made)


def shared_id() -> list[Step]:
    return [replace(s, track=0) if s.track > 4 else s for s in STEPS]


def some_walk_in_feet() -> object:
    start = {s.track: s for s in reversed(STANDING)}
    still = [
        replace(s, x_m=start[s.track].x_m, y_m=start[s.track].y_m) if s.track > STILL_FROM else s for s in STANDING
    ]
    return table(NAMES, lambda s: [*plain(s)[:2], s.x_m / 0.3048, s.y_m / 0.3048], still)


def back_by_an_hour(s: Step) -> object:
    return s.at - timedelta(hours=1) if s.at >= STEPS[0].at + timedelta(seconds=30) else s.at


def hung(seconds: int, digits: int = 3) -> object:
    """Return a walk of people whose last frame comes again, with later times, for some seconds."""
    last = [s for s in STEPS if s.at == STEPS[-1].at]
    steps = [*STEPS, *(replace(s, at=s.at + timedelta(seconds=k)) for k in range(1, seconds + 1) for s in last)]
    made = [[*plain(s)[:2], round(s.x_m + 0.0047, digits), round(s.y_m + 0.0053, digits)] for s in steps]
    return text("a.csv", NAMES, made)


def lost(place: tuple[float, float], every: int) -> object:
    """Return a table in which each so many rows have one place, where the engine has lost the person."""
    made = [[*plain(s)[:2], *(place if n % every == 0 else (s.x_m, s.y_m))] for n, s in enumerate(STEPS, 1)]
    return text("a.csv", NAMES, made)


def begun_again(period_s: int) -> object:
    """Return a table whose ids are given to other people after each so many seconds."""
    return text("a.csv", NAMES, rows(lambda s: [*plain(s)[:1], (s.track + s.at.second // period_s) % 6, *plain(s)[2:]]))


def in_frames_of_a_second(n: int) -> object:
    """Return positions in the picture without ids, with so many frames of one second."""
    walked = walks(n_people=5, seconds=30, hz=n, seed=5)
    made = [[s.at.replace(microsecond=0).isoformat(), 62.5 * s.x_m, (12 - s.y_m) / 0.0175] for s in walked]
    return text("a.csv", ("ts", "u_px", "v_px"), made)


def scores(person: str, other: str, full: int) -> object:
    """Return a table with a score for each of two classes; the person with the id 6 is the other one."""
    made = [[*plain(s), full * (0.1 if s.track == 6 else 0.9), full * (0.9 if s.track == 6 else 0.1)] for s in FEW]
    return text("a.csv", (*NAMES, person, other), made)


TELLING: list[Odd] = [
    # columns whose names tell nothing
    Odd("cameras in a column without a telling name", marked("src", "cam-2", "cam-1"), (), None, "W221"),
    Odd("cars in a column without a telling name", marked("what", "car", "person"), (), None, "W222"),
    Odd("addresses of cameras", marked("src", "10.0.0.11", "10.0.0.12"), (), None, "W221"),
    Odd("addresses of streams", marked("url", "rtsp://nvr/1", "rtsp://nvr/2"), (), None, "W221"),
    Odd("Gerät", marked("Gerät", "Eingang", "Kasse"), (), None, "W221"),
    Odd("scores of classes", scores("p_person", "p_dog", 1), (), None, "W222]: 'p_dog' holds scores above 0.5: 0.9"),
    Odd("percents of classes", scores("person", "CarScore", 100), (), None, '--where "person >= 50"'),
    Odd(
        "scores of classes, filtered",
        scores("p_person", "p_dog", 1),
        ("--where", "p_person >= 0.5"),
        [row for row in stored(FEW) if row[2] != "6"],
    ),
    Odd(
        "scores of people",
        text("a.csv", (*NAMES, "person", "dog"), rows(lambda s: [*plain(s), 0.9, 0.1], FEW)),
        (),
        stored(FEW),
    ),
    Odd("a column of words", marked("mood", "happy", "sad"), (), stored(FEW)),
    Odd("a plural is no camera", text("cams.csv", NAMES, rows(plain, FEW)), (), stored(FEW)),
    *(
        Odd(f"{name} {out}", marked(name, out, others), (), None, "W222")
        for name, out, others in (
            ("is_confirmed", "False", "True"),
            ("interpolated", 1, 0),
            ("time_since_update", 3, 0),
            ("in_fov", 0, 1),
            ("quality", "bad", "good"),
        )
    ),
    Odd("feet by a column", with_column("unit", lambda s: "FEET"), (), None, "--unit ft"),
    Odd("metres by a column", with_column("unit", lambda s: "m"), (), stored(FEW)),
    Odd("one column for both axes", table(NAMES, plain), ("--map", "x_m=x_m,y_m=x_m"), None, "both read from"),
    # distances
    Odd("distances twice those of the places", pairs(lambda d: 2 * d, with_places=True), (), None, "W220"),
    Odd("squared distances", pairs(lambda d: d * d, with_places=True), (), None, "W220"),
    Odd("marks for distances", pairs(lambda d: int(d < 2)), (), None, "all 1,440 distances are 0 and 1 m"),
    Odd("one distance", pairs(lambda d: 1.5), (), None, "W220"),
    # ids
    Odd("an id for all others", table(NAMES, plain, shared_id()), (), None, "ids belong to several people"),
    Odd(
        "an id of two people now and then",
        table(NAMES, plain, [*STEPS, *(replace(s, x_m=19.4) for s in STEPS[:96:6])]),
        (),
        stored(),
        "two places at once",
    ),
    Odd("no id by a word", with_column("note", lambda s: "-"), (), stored(FEW)),
    # units
    Odd("feet of people of whom most stand", some_walk_in_feet(), (), None, "would be faster than"),
    # times
    Odd("an hour back with offsets", times(back_by_an_hour, STEPS), (), None, "goes back by an hour"),
    Odd(
        "AM and PM behind a date of ISO",
        times(lambda s: f"{s.at:%Y-%m-%d %I:%M:%S %p}"),
        ("--zone", "UTC"),
        stored(FEW),
    ),
    Odd(
        "UTC by name, read on another clock",
        text("a.csv", ("time_utc", *NAMES[1:]), rows(lambda s: [f"{s.at:%Y-%m-%d %H:%M:%S}", *plain(s)[1:]], FEW)),
        ("--map", "ts=time_utc", "--zone", "Asia/Tokyo"),
        None,
        "names UTC",
    ),
    # places and ids
    Odd("one place for the lost", lost((99.9, 98.7), 11), (), None, "positions are exactly 99.9, 98.7"),
    Odd("-1 for a few", lost((-1.0, -1.0), 29), (), None, "positions are exactly -1, -1"),
    Odd(
        "shares of 1000",
        box("x1 y1 x2 y2", lambda u, v: (u * 0.87 // 1, v // 1, u * 0.87 // 1 + 20, v // 1 + 80)),
        ("--map", "left=x1,top=y1,right=x2,bottom=y2"),
        None,
        "divide by 1,000",
    ),
    Odd(
        "a picture that was stretched to 640",
        box("x1 y1 x2 y2", lambda u, v: (u * 0.6, v, u * 0.6 + 20, v + 80)),
        ("--map", "left=x1,top=y1,right=x2,bottom=y2"),
        None,
        "divide by 640",
    ),
    Odd(
        "metres as pixels",
        text("a.csv", ("ts", "track_id", "x", "y"), rows(plain)),
        ("--map", "u_px=x,v_px=y"),
        None,
        "hardly any camera has so few pixels",
    ),
    Odd(
        "an array of frames",
        raw("a.json", json.dumps([{"at": "2025-11-25T09:00:00Z", "people": [{"id": 1, "x": 2, "y": 3}]}] * 9).encode()),
        (),
        None,
        "--persons people --map ts=at,track_id=id,x_m=x,y_m=y",
    ),
    Odd("ids that begin again", begun_again(15), (), None, "most people in view at once"),
    # columns
    Odd("two floors by height", with_column("z", lambda s: 1.2 + 4 * (s.track % 2)), (), None, "two heights"),
    Odd("one floor with heights", with_column("z", lambda s: 1.2 + 0.1 * s.track), (), stored(FEW)),
    Odd("floors in Italian", with_column("piano", lambda s: s.track % 2), (), None, "names 2 floors"),
    Odd("cameras by address", with_column("IP", lambda s: f"10.0.0.{s.track % 3}"), (), None, "names 3 cameras"),
    # pictures
    Odd("the corner of a box as a place", box("u_px v_px w h", lambda u, v: (u, v, 30, 80)), (), None, "W226"),
    Odd("shares from the middle", box("u_px v_px", lambda u, v: (u / 640 - 1, 1 - v / 360)), (), None, "W226"),
    Odd("pixels of no camera", box("u_px v_px", lambda u, v: (6 * u, 8 * v + 5000)), (), None, "hardly any camera"),
    Odd(
        "far corners as sizes",
        box("left top width height", lambda u, v: (u, v, u + 30, v + 80)),
        (),
        None,
        "seem to be the far corner",
    ),
    Odd("boxes on their side", box("left top width height", lambda u, v: (u, v, 90, 30)), (), None, "wider than high"),
    # files
    Odd("bars", text("a.csv", NAMES, rows(plain, FEW), by="|"), (), stored(FEW)),
    Odd(
        "tabs and decimal commas",
        text(
            "a.csv", NAMES, [[*plain(s)[:2], *(str(v).replace(".", ",") for v in plain(s)[2:])] for s in FEW], by="\t"
        ),
        (),
        stored(FEW),
    ),
    Odd("lines that end with CR", text("a.csv", NAMES, rows(plain, FEW), end="\r"), (), None, "CR alone"),
    Odd("UTF-16 without a mark", text("a.csv", NAMES, rows(plain, FEW), encoding="utf-16-be"), (), None, "UTF-16"),
    Odd(
        "a tracker's lines",
        text("results.txt", (1, 7, 10, 10, 30, 80, 0.9, -1, -1, -1), [(2, 7, 11, 10, 30, 80, 0.9, -1, -1, -1)]),
        (),
        None,
        "--format motchallenge",
    ),
]
