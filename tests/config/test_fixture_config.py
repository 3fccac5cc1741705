"""`[[fixture]]` of vsd.toml: what nobody walks through."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, VsdError
from vsd_analytics.site.model import Fixture, Site

SITE = """\
[site]
id = "shop"
name = "Riverside Store"
timezone = "Europe/Rome"
[[floor]]
id = "ground"
name = "Ground floor"
[[camera]]
id = "cam-1"
name = "Entrance"
"""
SQUARE = "polygon = [[0, 0], [2, 0], [2, 1], [0, 1]]\n"
SHELF = f'[[fixture]]\nid = "shelf-1"\nname = "Shelf 1"\n{SQUARE}'


def load(folder: Path, text: str) -> Site:
    (folder / "vsd.toml").write_text(SITE + text, encoding="utf-8")
    return load_site(folder)


def the_problem(folder: Path, text: str) -> VsdError:
    with pytest.raises(ConfigError) as caught:
        load(folder, text)
    (problem,) = caught.value.problems
    return problem


def test_the_shortest_fixture_is_a_shelf_that_stays(tmp_path: Path) -> None:
    corners = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0))
    assert load(tmp_path, SHELF).fixtures == (Fixture("shelf-1", "Shelf 1", "ground", corners, "shelf", False),)


def test_kind_and_movable_are_read_in_order(tmp_path: Path) -> None:
    till = SHELF.replace("shelf-1", "a-till") + 'kind = "till"\nmovable = true\n'
    found = load(tmp_path, SHELF + till).fixtures
    assert [(f.fixture_id, f.kind, f.is_movable) for f in found] == [
        ("shelf-1", "shelf", False),
        ("a-till", "till", True),
    ]


def test_a_site_without_fixtures_has_none(tmp_path: Path) -> None:
    assert load(tmp_path, "").fixtures == ()


def test_a_fixture_that_was_moved_stands_in_one_place_until_it_was_moved(tmp_path: Path) -> None:
    moved = SHELF + "to = 2026-11-09T06:30:00\n" + SHELF.replace("[2, 1]", "[2, 4]") + 'from = "2026-11-09T06:30"\n'
    old, new = load(tmp_path, moved).fixtures
    at = datetime(2026, 11, 9, 5, 30, tzinfo=UTC)
    assert (old.valid_to, new.valid_from) == (at, at)
    before = at - timedelta(seconds=1)
    assert [(f.is_there(before), f.is_there(at)) for f in (old, new)] == [(True, False), (False, True)]
    assert not new.is_there(before, until=at + timedelta(days=1))
    assert old.is_there(before, until=at)


@pytest.mark.parametrize(
    ("text", "said", "fix"),
    [
        (SHELF + 'to = "2026-11-10"\n' + SHELF + 'from = "2026-11-09"\n', "in two places at once", "at the new one"),
        (SHELF + SHELF + 'from = "2026-11-09"\n', "in two places at once", "at the new one"),
        (SHELF + 'from = "2026-11-09"\nto = "2026-11-09"\n', "ends before it begins", "a later to"),
        (f'[[area]]\nid = "a"\nname = "A"\n{SQUARE}from = "2026-11-09T06:30"\n', "whole days", 'from = "2026-11-09"'),
        (f'[[area]]\nid = "a"\nname = "A"\n{SQUARE}to = 2026-11-09T06:30:00\n', "whole days", 'to = "2026-11-09"'),
        (
            f'[[area]]\nid = "a"\nname = "A"\n{SQUARE}from = 2026-11-09\nto = "2026-11-09"\n',
            "before it begins",
            "later",
        ),
    ],
)
def test_dates_that_contradict_each_other_are_refused(tmp_path: Path, text: str, said: str, fix: str) -> None:
    problem = the_problem(tmp_path, text)
    assert problem.code == "E125"
    assert said in problem.what
    assert fix in str(problem.fix)


@pytest.mark.parametrize(
    ("text", "code", "line", "said", "fix"),
    [
        (SHELF + 'kind = "shelv"\n', "E124", 15, "'shelv' is not one of shelf, wall, till, other", 'kind = "shelf"'),
        (SHELF + 'kind = "palm tree"\n', "E124", 15, "is not one of", 'kind = "other"'),
        (SHELF + "kind = 3\n", "E124", 15, "must be a text in quotes", 'kind = "shelf"'),
        (SHELF + 'movable = "yes"\n', "E124", 15, "must be true or false", "movable = true"),
        (SHELF + "movabel = true\n", "E122", 15, "movabel", "movable"),
        (SHELF + 'floor = "roof"\n', "E125", 15, "on floor 'roof'", "ground"),
        (SHELF + SHELF, "E125", 16, "two fixtures have the id 'shelf-1'", "another id"),
        (SHELF.replace("shelf-1", "Shelf 1"), "E125", 12, "cannot be an id", 'id = "shelf-1"'),
        (SHELF.replace(SQUARE, ""), "E123", 11, "has no polygon", "polygon = "),
        (SHELF.replace('name = "Shelf 1"\n', ""), "E123", 11, "has no name", "name = "),
        (SHELF.replace("[2, 1], [0, 1]", "[0, 1], [2, 1]"), "E128", 14, "crosses", "walk around"),
        (SHELF.replace("[2, 1], [0, 1]", "[2000, 1], [0, 1000]"), "E128", 14, "too large", "metres"),
    ],
)
def test_mistakes_are_reported_with_line_and_fix(
    tmp_path: Path, text: str, code: str, line: int, said: str, fix: str
) -> None:
    problem = the_problem(tmp_path, text)
    assert problem.code == code
    assert problem.where is not None
    assert problem.where.line == line
    assert said in problem.what
    assert fix in str(problem.fix)
