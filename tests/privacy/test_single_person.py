"""The time of fewer than five people is told by no output, also where they are all the people of a floor."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import date, datetime, timedelta
from itertools import zip_longest
from pathlib import Path
from typing import Any

import pytest
from privacy.everything_shared import everything
from report import ingested_worlds as w

from vsd_analytics.site.model import Site

N_WEEKS = 5
MONDAYS = [w.MONDAY - timedelta(weeks=k) for k in reversed(range(N_WEEKS))]


HOURS = (9, 12)
BUSY_HOUR = 10
LONG, SHORT = 160, 39


def frames(monday: date) -> Iterator[tuple[dict[str, Any], int, int]]:
    """Yield the frames of a week without anybody, the local hour of each, and its number in the hour."""
    for k, message in enumerate(w.messages(w.steady({}), monday=monday, hours=HOURS, is_alone=False)):
        of_day, per_hour = k % (3 * 180), 180
        yield message, HOURS[0] + of_day // per_hour, of_day % per_hour


def one_person(monday: date, n_frames: int) -> Iterator[dict[str, Any]]:
    """One person is there for the first frames of each day."""
    for message, hour, k in frames(monday):
        is_there = hour == HOURS[0] and k < n_frames
        yield {**message, "persons": [w.person("alone", *w.ALONE)] if is_there else []}


def two_people(monday: date, n_frames: int) -> Iterator[dict[str, Any]]:
    """Two people are there for the first frames of each day, by turns near each other and far apart."""
    n_near = 25 + n_frames // 6  # of a small count a page says that it is one
    for message, hour, k in frames(monday):
        x, y = w.ALONE
        both = [w.person("a", x, y), w.person("b", x - (1.5 if k % 6 < 3 else 6.0), y)]
        yield {**message, "persons": both if hour == HOURS[0] and k < n_near else []}


def one_person_beside_a_busy_hour(monday: date, n_frames: int) -> Iterator[dict[str, Any]]:
    """One person comes in the first hour and in the last, for as long together; many are there in between."""
    busy = w.messages(lambda _, hour: {w.QUEUE: 30} if hour == BUSY_HOUR else {}, monday=monday, is_alone=False)
    of_hour = {HOURS[0]: n_frames, HOURS[1] - 1: LONG + SHORT - n_frames}
    for (_, hour, k), message in zip(frames(monday), busy, strict=True):
        alone = [w.person("alone", *w.ALONE)] if k < of_hour.get(hour, 0) else []
        yield {**message, "persons": [*message["persons"], *alone]}


def one_person_on_two_days(monday: date, n_frames: int) -> Iterator[dict[str, Any]]:
    """One person comes on Monday and on Tuesday, for as long together; many are there in another hour of each day."""
    busy = w.messages(lambda _, hour: {w.QUEUE: 30} if hour == BUSY_HOUR else {}, monday=monday, is_alone=False)
    of_day = {0: n_frames, 1: LONG + SHORT + 11 - n_frames}  # not the same two lengths on other days
    for (frame, hour, k), message in zip(frames(monday), busy, strict=True):
        day = (datetime.fromisoformat(frame["ts"]).date() - monday).days
        is_there = hour == HOURS[0] and k < of_day.get(day, 0)
        yield {**message, "persons": [*message["persons"], *([w.person("alone", *w.ALONE)] if is_there else [])]}


def one_person_and_many_when_it_is_closed(monday: date, n_frames: int) -> Iterator[dict[str, Any]]:
    """One person is there in opening hours; thirty pairs come in the evening, who are in no figure."""
    evening = w.messages(w.steady({w.QUEUE: 30}), monday=monday, hours=(20, 21), is_alone=False)
    return iter(sorted((*one_person(monday, n_frames), *evening), key=lambda message: message["ts"]))


def one_person_and_many_a_week_later(monday: date, n_frames: int) -> Iterator[dict[str, Any]]:
    """One person comes in the week before the last; many come in all others."""
    if monday == MONDAYS[-2]:
        return one_person(monday, n_frames)
    return w.messages(w.steady({w.QUEUE: 20, w.DOOR: 9}), monday=monday)


KINDS = (
    one_person,
    two_people,
    one_person_beside_a_busy_hour,
    one_person_on_two_days,
    one_person_and_many_when_it_is_closed,
    one_person_and_many_a_week_later,
)


def site_of(folder: Path, made: Callable[[date, int], Iterator[dict[str, Any]]], n_frames: int) -> Site:
    return w.world(folder, w.toml(), *(made(monday, n_frames) for monday in MONDAYS))


@pytest.mark.parametrize("made", KINDS)
def test_outputs_are_the_same_however_long_few_people_were_there(
    made: Callable[[date, int], Iterator[dict[str, Any]]], tmp_path: Path
) -> None:
    told = []
    for n in (SHORT, LONG):
        folder = tmp_path / str(n)
        site = site_of(folder / "shop", made, n)
        told.append(everything(site, MONDAYS[-2:], folder))
    short, long = told
    assert short.keys() == long.keys()
    assert [difference(name, short[name], long[name]) for name in short if short[name] != long[name]] == []
    assert [name for name in short if "sends no positions" in short[name]] == []  # it does: the reason is another one


def difference(name: str, one: str, other: str) -> str:
    """Return the first lines in which two texts differ, for the message of a failed test."""
    pairs = [(a, b) for a, b in zip_longest(one.splitlines(), other.splitlines()) if a != b]
    return f"{name}: {len(pairs)} lines, {str(pairs[:3])[:300]}"
