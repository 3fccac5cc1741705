"""Hidden hours with the same sum are told apart by no output: neither by digits of an interval, nor by a verdict.

Two worlds differ in what happened in two hidden hours of different days. The same people stand at the same places for
as long in both worlds, in other company: so violations, and the time too close, are all that differs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import date, datetime, timedelta
from itertools import zip_longest
from pathlib import Path
from typing import Any

import pytest
from privacy.everything_shared import everything
from report import ingested_worlds as w

N_WEEKS = 5
MONDAYS = [w.MONDAY - timedelta(weeks=k) for k in reversed(range(N_WEEKS))]
SMALL, LARGE = (0, 10), (1, 9)
"""Day and hour of a small count, and of the nearest other count, which hides it."""
SPLITS = ((2, 10), (1, 11))
"""Units of these two hours in which pairs stand near each other, two violations each: 4 and 20, or 2 and 22.

Both days are the same rough numbers.
"""
N_UNITS = 12
UNIT_MS = 2 * w.SLOT_MS
SETTINGS = "[analysis]\nhotspot_days = 14\nhotspot_min_days = 4\nhotspot_min_violations = 20\n"


def unit(at: datetime, n_near: int) -> list[dict[str, Any]]:
    """Return four people, each in one half of a unit: near the other of their place, or beside one far away."""
    into_ms = (at.minute * 60 + at.second) * 1000
    number, half = into_ms // UNIT_MS, into_ms % UNIT_MS // w.SLOT_MS
    if number >= N_UNITS:
        return []
    pairs = [[(x + s * 1.5, y) for s in (0, 1)] for x, y in (w.QUEUE, w.AISLE)]
    if number >= n_near:
        pairs = [list(pair) for pair in zip(*pairs, strict=True)]
    return [w.person(f"{at:%d%H}-{number}-{x}-{y}", x, y) for x, y in pairs[half]]


def frames(monday: date, near: dict[tuple[int, int], int], *, more: int | None) -> Iterator[dict[str, Any]]:
    """Yield the frames of a week.

    Args:
        monday: Its first day.
        near: Day and hour of people in units, and in how many of these pairs are near each other.
        more: Violations of other hours beyond the fewest; None = these have none.
    """

    def counts(day: int, hour: int) -> dict[w.Place, int]:
        if more is None or day < 2:
            return {}
        return {w.QUEUE: 20 + 3 * day + hour % 2 + more, w.DOOR: 8 + day, w.AISLE: 6}

    for message in w.messages(counts, monday=monday, hours=(9, 11)):
        at = datetime.fromisoformat(message["ts"]).astimezone(w.rome(0, 0).tzinfo)
        n_near = near.get(((at.date() - monday).days, at.hour))
        yield message if n_near is None else {**message, "persons": [*message["persons"], *unit(at, n_near)]}


def week(k: int, monday: date, split: tuple[int, int]) -> Iterator[dict[str, Any]]:
    """Return a week with two hidden hours."""
    return frames(monday, dict(zip((SMALL, LARGE), split, strict=True)), more=3 * k % 5)


def few(k: int, monday: date, split: tuple[int, int]) -> Iterator[dict[str, Any]]:
    """Return a week with two or four violations."""
    return frames(monday, {LARGE: split[0]}, more=None)


def outputs(folder: Path, split: tuple[int, int], *, changed: int, made: Callable[..., Any]) -> dict[str, str]:
    """Return everything that leaves of a site whose week `changed` is of a kind and split, and all others alike."""
    weeks = [week(k, monday, SPLITS[0]) for k, monday in enumerate(MONDAYS)]
    weeks[changed] = made(changed, MONDAYS[changed], split)
    log = [{"at": f"{MONDAYS[2]}T08:00:00+01:00", "area": "queue", "text": "Two desks instead of one", "by": "A"}]
    config = w.toml(opening='{ mon-sun = "09:00-11:00" }', more=SETTINGS)
    return everything(w.world(folder / "shop", config, *weeks, log=log), MONDAYS[-2:], folder)


@pytest.mark.parametrize(("changed", "made"), [(-1, week), (-3, week), (-3, few)])
def test_violations_of_hidden_hours_in_other_hidden_hours_change_no_output(
    changed: int, made: Callable[..., Any], tmp_path: Path
) -> None:
    one, other = (outputs(tmp_path / str(s[0]), s, changed=changed % N_WEEKS, made=made) for s in SPLITS)
    assert one.keys() == other.keys()
    assert [difference(name, one[name], other[name]) for name in one if one[name] != other[name]] == []


def difference(name: str, one: str, other: str) -> str:
    """Return the first lines in which two texts differ, for the message of a failed test."""
    pairs = [(a, b) for a, b in zip_longest(one.splitlines(), other.splitlines()) if a != b]
    return f"{name}: {len(pairs)} lines, {str(pairs[:3])[:300]}"
