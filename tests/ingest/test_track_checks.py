"""Ids that pass from one person to another, clocks that are set while people are in view, people who stay behind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
from walks import START, Step, project, walks

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

MINUTES: list[Step] = [s for s in walks(seconds=180, seed=21) if s.track < 4 or s.at.minute or s.at.second > 30]
"""Three people for three minutes, and three more who come half a minute later."""
FEW: list[Step] = [s for s in walks(n_people=2, seconds=180, seed=22) if s.track == 1 or s.at.second < 40]
"""Two people, the second of whom goes for a while in each minute."""


STANDING: list[Step] = [
    replace(s, x_m=2 + 3 * (s.track % 3) + s.at.second % 7 / 100, y_m=2 + s.track + s.at.minute / 50)
    for s in walks(seconds=180, seed=24)
]
"""Six people who hardly move."""


def renamed(name: Callable[[Step], object], steps: Sequence[Step] = MINUTES) -> list[str]:
    return [f"{s.at.isoformat()},{name(s)},{s.x_m},{s.y_m}" for s in steps]


def at(when: Callable[[Step], timedelta], steps: Sequence[Step] = MINUTES) -> list[str]:
    return renamed(lambda s: s.track, [replace(s, at=s.at + when(s)) for s in steps])


def later(s: Step) -> bool:
    return s.at.minute == 2


def left_behind() -> list[str]:
    """Return the walks with each person's last place for a minute more."""
    steps = walks(n_people=6, seconds=60, seed=23)
    last = {s.track: s for s in steps}
    return renamed(
        lambda s: s.track,
        [*steps, *(replace(s, at=s.at + timedelta(seconds=i)) for i in range(1, 61) for s in last.values())],
    )


def check(tmp_path: Path, rows: Sequence[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    root = project(tmp_path / "project")
    (root / "a.csv").write_text("ts,track_id,x_m,y_m\n" + "\n".join(rows) + "\n", encoding="utf-8")
    code = run(cli, ["-C", str(root), "--now", "2025-12-01", "check", str(root / "a.csv")])
    return code, "".join(capsys.readouterr())


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        (
            renamed(lambda s: 7 - s.track if later(s) else s.track),
            "a moment before, in 1 frame most people",
        ),
        (renamed(lambda s: f"{s.track}-{(s.at - START).seconds // 5}"), "ids end where another one begins"),
        (renamed(lambda s: s.track + 10 * later(s)), "once most of those in view together"),
        (renamed(lambda s: f"0{s.track}" if s.at.second % 2 else s.track), "6 ids are written in two ways"),
        (at(lambda s: timedelta(seconds=-90 * later(s))), "6 people go on in place"),
        (at(lambda s: timedelta(minutes=50 * later(s))), "the clock was set, or the engine paused"),
        (at(lambda s: timedelta(milliseconds=100 * s.track), FEW), "records have a time of their own"),
        (left_behind(), "6 of 6 tracks end at one place, the same to the last digit for 60 s (360 rows)"),
    ],
    ids=[
        "begun again",
        "cut in parts",
        "begun again without a jump",
        "two spellings",
        "clock back",
        "clock forward",
        "two people",
        "left behind",
    ],
)
def test_what_happens_to_tracks_is_warned_of(
    rows: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said = check(tmp_path, rows, capsys)
    assert says in said, said
    assert code == 1


@pytest.mark.parametrize(
    "rows",
    [
        renamed(lambda s: s.track),
        renamed(lambda s: s.track, FEW),
        renamed(lambda s: s.track, sorted(MINUTES, key=lambda s: s.track)),  # a step back in time for each person
        renamed(lambda s: s.track, STANDING) * 2,  # the same people again, in the same places
        renamed(lambda s: f"{s.track}-{s.at.minute}", [s for s in STANDING if s.at.second < 50]),
        renamed(lambda s: s.track, [replace(s, x_m=2.0 * s.track, y_m=3.0) for s in STANDING]),
    ],
    ids=["plain", "few", "by person", "twice", "a pause between ids", "never move"],
)
def test_tracks_of_people_who_come_and_go_are_not(
    rows: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, said = check(tmp_path, rows, capsys)
    assert "W225" not in said, said
    assert "W223" not in said, said
    assert "time of their own" not in said, said
    assert "end at one place" not in said, said


@pytest.mark.parametrize(("n_taken", "is_seen"), [(4, False), (9, True)])
def test_a_few_ids_in_thousands_of_steps_that_take_over_another_person_are_usual(
    n_taken: int, is_seen: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = walks(n_people=6, seconds=500, seed=25)  # 2,994 steps, of which six are .002
    for number in range(1, n_taken + 1):  # the first person is lost for five seconds, and the second one has her id
        lost = range(50 * number, 50 * number + 5)
        seconds = [int((s.at - START).total_seconds()) for s in steps]
        steps = [
            replace(s, track=1) if k in lost and s.track == 2 else s
            for k, s in zip(seconds, steps, strict=True)
            if not (k in lost and s.track == 1)
        ]
    _, said = check(tmp_path, renamed(lambda s: s.track, steps), capsys)
    assert ("where another person was a moment before" in said) == is_seen, said
