"""What the weekly report says of a logged change: time too close, the running verdict, the floor, and whose doing."""

from __future__ import annotations

import json
from datetime import date, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from planted_changes import AREAS, planted, site_of

from vsd_analytics.answer import Value
from vsd_analytics.figures.before_after import BeforeAfterFigure, before_after
from vsd_analytics.figures.change_answers import change_answers
from vsd_analytics.figures.share.counts import GIVES_AWAY, Mask
from vsd_analytics.figures.week.change_effects import change_effects, moved_people, shared_change_answers

FIRST = date(2026, 8, 31)
CHANGE = 12 * 7 + 1


def figure(root: Path, **options: Any) -> BeforeAfterFigure:
    at = f"{FIRST + timedelta(days=CHANGE)}T07:00:00+00:00"
    (root / "log.jsonl").write_text(json.dumps({"at": at, "text": "moved it", "area": "queue"}) + "\n")
    with planted(site_of(root), first=FIRST, n_days=CHANGE + 3 + 21, **options) as warehouse:
        return before_after(warehouse, 1)


def week(root: Path, *, days_after: int = 25, is_held_back: bool = False) -> Any:
    """Return as much of a week's data as the section asks for."""
    return SimpleNamespace(
        areas=AREAS,
        site=site_of(root),
        mask=Mask(5),
        warehouse=SimpleNamespace(inputs_digest=""),
        sunday=FIRST + timedelta(days=CHANGE + days_after),
        is_held_back=lambda *_: is_held_back,
        hides_time=lambda *_: is_held_back,
    )


def test_new_numbers_lie_beside_the_old_ones_and_add_up(tmp_path: Path) -> None:
    found = figure(tmp_path, rate=lambda a, d: 0.5 if a == "queue" and d >= CHANGE else 1.0)
    (made,) = change_effects(week(tmp_path), [found])
    assert made.effect is not None
    assert made.burden is not None
    assert made.burden.change is not None
    assert made.running is not None
    assert made.net is not None
    assert made.running.verdict == "clear_fall"
    assert made.e_value is not None
    assert made.e_value >= 20
    assert made.n_watched == 3
    assert (made.through_people or 0) + (made.through_closeness or 0) == pytest.approx(made.burden.change)
    assert made.contribution == pytest.approx(made.net.change, abs=0.1)
    assert made.cautions == found.cautions


def test_an_area_whose_counts_are_hidden_shows_none_of_them(tmp_path: Path) -> None:
    (made,) = change_effects(week(tmp_path, is_held_back=True), [figure(tmp_path)])
    told = ("burden", "close", "running", "net", "e_value", "contribution", "moved_elsewhere", "through_people")
    assert [getattr(made, name) for name in told] == [None] * len(told)


def test_tables_of_a_change_whose_counts_are_hidden_have_no_number_and_say_why(tmp_path: Path) -> None:
    found = figure(tmp_path, rate=lambda a, d: 0.5 if a == "queue" and d >= CHANGE else 1.0)
    held_back, shown = (shared_change_answers(week(tmp_path, is_held_back=k), found) for k in (True, False))
    for answer in held_back:
        values = [cell for row in answer.rows for cell in row.values() if isinstance(cell, Value)]
        assert all(value.value is None and value.reason == GIVES_AWAY for value in values), answer.name
        assert answer.nothing == (None if answer.rows else GIVES_AWAY), answer.name
    assert held_back["logged_change"].rows[0]["outcome"] == "too_early"
    assert list(shown) == list(change_answers(found, None, site_of(tmp_path), inputs=""))


def test_people_who_left_the_area_are_the_doing_of_a_new_change_and_no_rival_to_it(tmp_path: Path) -> None:
    gone = figure(tmp_path, people=lambda a, d: 15.0 if a == "queue" and d >= CHANGE else 40.0)
    assert moved_people(week(tmp_path, days_after=9), [gone]) == (1,)
    assert moved_people(week(tmp_path, days_after=30), [gone]) == (), "both weeks compared lie after it"
    assert moved_people(week(tmp_path, days_after=9), [figure(tmp_path)]) == ()
