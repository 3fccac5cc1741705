"""Tables that went through many hands: what spreadsheets, scripts and people do to them. Each says what must be stored.

`says` is a word of what the command must say; with rows, that a few records were left out, and why.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta

from odd_files import NAMES, STEPS, Odd, Row, naive, plain, raw, stored, text
from walks import Step

SOME = STEPS[:60]
HEAD = ",".join(NAMES)


def body(make: Callable[[Step], Sequence[object]] = plain, steps: Sequence[Step] = SOME) -> list[str]:
    return [",".join(map(str, make(s))) for s in steps]


def file(
    lines: Sequence[str], *, end: str = "\n", name: str = "a.csv", encoding: str = "utf-8"
) -> Callable[..., object]:
    return raw(name, (end.join(lines) + end).encode(encoding))


def moved(steps: Sequence[Step], day: datetime) -> list[Step]:
    """Return steps on another day, from an instant on."""
    return [Step(day + (s.at - SOME[0].at), s.track, s.x_m, s.y_m) for s in steps]


def unix(factor: float) -> Callable[[Step], Sequence[object]]:
    return lambda s: [round(s.at.timestamp() * factor), *plain(s)[1:]]


LINES = body()
SUMMER_ENDS = moved(SOME, datetime(2025, 10, 26, 0, 30, tzinfo=UTC))  # 02:30 for the first time in Berlin
SUMMER_BEGINS = moved(SOME, datetime(2025, 3, 30, 0, 59, 55, tzinfo=UTC))  # 01:59:55, then 03:00 in Berlin
BERLIN_H = {"ends": 2, "begins": 1}


def wall(steps: Sequence[Step], hours: int) -> list[str]:
    return [f"{s.at + timedelta(hours=hours):%Y-%m-%d %H:%M:%S},{s.track},{s.x_m},{s.y_m}" for s in steps]


def ids(make: Callable[[int], str]) -> list[Row]:
    return [(c, t, make(int(i or 0)), x, y) for c, t, i, x, y in stored(SOME)]


HOSTILE: list[Odd] = [
    Odd(
        "mixed line ends",
        raw("a.csv", (HEAD + "\r\n" + "\n".join(LINES[:20]) + "\n" + "\r\n".join(LINES[20:])).encode()),
        rows=stored(SOME),
    ),
    Odd("blank lines between", file([HEAD, "", *LINES[:9], "", "   ", *LINES[9:], "", ""]), rows=stored(SOME)),
    Odd(
        "blanks around every cell",
        file([" , ".join(NAMES), *(line.replace(",", " , ") for line in LINES)]),
        rows=stored(SOME),
    ),
    Odd("capitals in the header", file([HEAD.upper(), *LINES]), rows=stored(SOME)),
    Odd(
        "header twice the same name",
        file([HEAD + ",X_m", *(f"{line},99" for line in LINES)]),
        says="more than one column",
    ),
    Odd(
        "header again in the middle",
        file([HEAD, *LINES[:30], HEAD, *LINES[30:]]),
        rows=stored(SOME),
        says="x_m is not a number",
    ),
    Odd(
        "units below the header", file([HEAD, "[s],[-],[m],[m]", *LINES]), rows=stored(SOME), says="x_m is not a number"
    ),
    Odd("totals at the end", file([HEAD, *LINES, "Total,60,612.4,388.1"]), rows=stored(SOME), says="not-a-time"),
    Odd(
        "a line cut off at the end",
        raw("a.csv", "\n".join([HEAD, *LINES, LINES[0][:30]]).encode()),
        rows=stored(SOME),
        says="wrong-number-of-fields",
    ),
    Odd(
        "line breaks inside quoted notes",
        file([HEAD + ",note", *(f'{line},"a\nb"' if i == 5 else f"{line},ok" for i, line in enumerate(LINES))]),
        rows=stored([s for i, s in enumerate(SOME) if i != 5]),
        says="bad-quotes",
    ),
    Odd(
        "zeros where the disk lost a block",
        file([HEAD, *LINES[:10], "\0" * 512, *LINES[10:]]),
        rows=stored(SOME),
        says="wrong-number-of-fields",
    ),
    Odd(
        "numbers beyond any floor",
        file([HEAD, *LINES, f"{SOME[0].at.isoformat()},77,1e308,-1e308"]),
        rows=stored(SOME),
        says="out-of-range",
    ),
    Odd("negative zero", file([HEAD, f"{SOME[0].at.isoformat()},1,-0.0,0.0"]), rows=[(*stored(SOME[:1])[0][:3], 0, 0)]),
    Odd("exponents", file([HEAD, *body(lambda s: [*plain(s)[:2], f"{s.x_m:.9e}", f"{s.y_m:.9E}"])]), rows=stored(SOME)),
    Odd(
        "words for nothing",
        file(
            [
                HEAD,
                *LINES,
                *(f"{SOME[0].at.isoformat()},8{i},{w},1" for i, w in enumerate(("NaN", "null", "N/A", "-", "inf"))),
            ]
        ),
        rows=stored(SOME),
        says="not-a-number",
    ),
    Odd(
        "ids with blanks",
        file([HEAD, *body(lambda s: [plain(s)[0], f'" Anna {s.track} "', *plain(s)[2:]])]),
        rows=ids(lambda i: f"Anna {i}"),
    ),
    Odd(
        "ids as pandas writes them",
        file([HEAD, *body(lambda s: [plain(s)[0], f"{s.track}.0", *plain(s)[2:]])]),
        rows=ids(lambda i: f"{i}"),
    ),
    Odd("one row", file([HEAD, LINES[0]]), rows=stored(SOME[:1])),
    Odd("header only", file([HEAD]), says="W212"),
    Odd("nothing at all", raw("a.csv", b""), says="E202"),
    Odd("only a byte order mark", raw("a.csv", b"\xef\xbb\xbf"), says="E20"),
    Odd("unix seconds", file([HEAD, *body(unix(1))]), rows=stored(SOME)),
    Odd("unix microseconds", file([HEAD, *body(unix(1e6))]), rows=stored(SOME)),
    Odd("unix nanoseconds", file([HEAD, *body(unix(1e9))]), rows=stored(SOME)),
    Odd(
        "seconds and milliseconds in one file",
        file([HEAD, *body(unix(1)), *body(unix(1000), STEPS[60:66])]),
        rows=stored(SOME),
        says="time-out-of-range",
    ),
    Odd(
        "offsets of two zones",
        file(
            [
                HEAD,
                *body(
                    lambda s: [
                        plain(s)[0].replace("+00:00", "Z")
                        if s.track % 2
                        else (s.at + timedelta(hours=2)).isoformat().replace("+00:00", "+02:00"),
                        *plain(s)[1:],
                    ]
                ),
            ]
        ),
        rows=stored(SOME),
    ),
    Odd(
        "nine digits of a second",
        file([HEAD, *body(lambda s: [f"{s.at:%Y-%m-%dT%H:%M:%S}.000000000Z", *plain(s)[1:]])]),
        rows=stored(SOME),
    ),
    Odd(
        "the hour that comes twice",
        file([HEAD, *wall(SUMMER_ENDS, 2)]),
        ("--zone", "Europe/Berlin"),
        rows=stored(SUMMER_ENDS),
        says="W2",
    ),
    Odd(
        "the hour that is skipped",
        file([HEAD, *(wall(SUMMER_BEGINS[:30], 1) + wall(SUMMER_BEGINS[30:], 2))]),
        ("--zone", "Europe/Berlin"),
        rows=stored(SUMMER_BEGINS),
    ),
    Odd(
        "Excel's day numbers",
        file([HEAD, *body(lambda s: [f"{25569 + s.at.timestamp() / 86400:.8f}", *plain(s)[1:]])]),
        says="second sightings",
    ),
    Odd(
        "commas between thousands",
        file(
            [
                "ts,track_id,x_mm,y_mm",
                *body(lambda s: [*plain(s)[:2], f'"{s.x_m * 1000:,.0f}"', f'"{s.y_m * 1000:,.0f}"']),
            ]
        ),
        ("--map", "x_m=x_mm,y_m=y_mm"),
        says="not-a-number",
    ),
    Odd(
        "dots between thousands, decimal commas",
        file(
            [
                "ts;track_id;x_mm;y_mm",
                *(
                    f"{s.at.isoformat()};{s.track};{s.x_m * 1000:,.1f};{s.y_m * 1000:,.1f}".replace(",", "_")
                    .replace(".", ",")
                    .replace("_", ".")
                    for s in SOME
                ),
            ]
        ),
        ("--map", "x_m=x_mm,y_m=y_mm"),
        says="not-a-number",
    ),
    Odd(
        "decimal commas in quotes",
        file(
            [
                HEAD,
                *body(
                    lambda s: [*plain(s)[:2], f'"{s.x_m:.3f}"'.replace(".", ","), f'"{s.y_m:.3f}"'.replace(".", ",")]
                ),
            ]
        ),
        says="not-a-number",
    ),
    Odd(
        "Excel's line sep=;",
        file(["sep=;", HEAD.replace(",", ";"), *(line.replace(",", ";") for line in LINES)]),
        rows=stored(SOME),
    ),
    Odd("comments above the header", file(["# exported by hand", "# zone: UTC", HEAD, *LINES]), rows=stored(SOME)),
    Odd(
        "Latin-1 names",
        file([HEAD + ",note", *(f"{line},café" for line in LINES)], encoding="latin-1"),
        rows=stored(SOME),
    ),
    Odd(
        "naive times, no clock",
        text("a.csv", NAMES, [naive(s) for s in SOME]),
        more="hz = 1.0",
        rows=stored(SOME),
        says="W223",
    ),
]
