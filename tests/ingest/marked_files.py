"""More files that look right and are not: columns that mark rows, sums among rows, clocks of several kinds.

They are read as those of `oddest_files`, by a site without a plan or pictures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

from odd_files import NAMES, STEPS, Odd, plain, rows, stored, text
from oddest_files import FEW, times, with_column
from walks import Step, walks

NAIVE = ZoneInfo("Europe/Berlin")
_SUM = ["2025-11-25T09:01:00Z", "Mean", 5.125, 6.25]
_SUM_ROW = ("cam-1", round(datetime(2025, 11, 25, 9, 1, tzinfo=UTC).timestamp() * 1000), "Mean", 5125, 6250)
PLACED = ("ts", "x_m", "y_m")
WITHOUT_ONE = [row for row in stored(FEW) if row[2] != "6"]
TWICE_A_SECOND = walks(seed=6, hz=2, seconds=30)
AUTUMN = [
    replace(s, at=datetime(2025, 10, 26, 0, 30, tzinfo=UTC) + 90 * (s.at - STEPS[0].at))
    for s in STEPS  # 90 minutes, a record of each person every 90 seconds
]


def marked(name: str, out: object, others: object) -> object:
    return with_column(name, lambda s: out if s.track == 6 else others)


def of_track(make: Callable[[Step], str], else_: Callable[[Step], str]) -> Callable[[Step], str]:
    return lambda s: make(s) if s.track % 2 else else_(s)


def local(s: Step) -> str:
    return s.at.astimezone(NAIVE).replace(tzinfo=None).isoformat(" ")


MARKED: list[Odd] = [
    *(
        Odd(f"{name} {out}", marked(name, out, others), (), None, "W222")
        for name, out, others in (
            ("valid", "False", "True"),
            ("is_person", 0, 1),
            ("Visible", "no", "yes"),
            ("is_predicted", 1, 0),
            ("false_positive", "true", "false"),
            ("species", "dog", "human"),
        )
    ),
    Odd("occluded people", marked("occluded", 1, 0), (), stored(FEW)),
    Odd(
        "a flag that is settled",
        marked("valid", 0, 1),
        ("--where", "valid = 1"),
        [r for r in stored(FEW) if r[2] != "6"],
    ),
    Odd(
        "a line of means",
        text("a.csv", NAMES, [*rows(plain, FEW), _SUM]),
        (),
        [*stored(FEW), _SUM_ROW],
        "some rows seem to be sums",
    ),
    Odd(
        "times with and without offset",
        times(of_track(lambda s: s.at.replace(tzinfo=None).isoformat(), lambda s: s.at.isoformat())),
        (),
        stored(FEW),
        "60 of 120 times have no offset",
    ),
    Odd(
        "seconds of satellites",
        times(lambda s: round(s.at.timestamp()) - 315_964_800 + 18),
        (),
        [(c, t - 315_964_782_000, i, x, y) for c, t, i, x, y in stored(FEW)],
        "GPS clocks count from 6 January 1980",
    ),
    Odd(
        "two frames a second without ids",
        text("a.csv", PLACED, rows(lambda s: [f"{s.at:%Y-%m-%dT%H:%M:%SZ}", s.x_m, s.y_m], TWICE_A_SECOND)),
        (),
        None,
        "times have several frames",
    ),
    Odd(
        "half seconds without ids",
        text("a.csv", PLACED, rows(lambda s: [s.at.isoformat(), s.x_m, s.y_m], TWICE_A_SECOND)),
        (),
        stored(TWICE_A_SECOND, has_ids=False),
    ),
    Odd(
        "an hour twice on the clock of the site, read as UTC",
        text("a.csv", PLACED, rows(lambda s: [local(s), s.x_m, s.y_m], AUTUMN)),
        ("--zone", "UTC"),
        [
            (c, t + round(s.at.astimezone(NAIVE).utcoffset() / timedelta(milliseconds=1)), i, x, y)  # type: ignore[operator]
            for s, (c, t, i, x, y) in zip(AUTUMN, stored(AUTUMN, has_ids=False), strict=True)
        ],
        "the clock goes back by an hour once",
    ),
]
