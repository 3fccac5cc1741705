"""Files of layout edits: what they may say, and every mistake at once with its line and the way out."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

from vsd_analytics.config.layout_edits import read_edits
from vsd_analytics.errors import ConfigError, UsageError
from vsd_analytics.settings import Settings
from vsd_analytics.site.layout import DoorEdit, FixtureEdit, LayoutEdits, OneWayEdit, OpeningEdit
from vsd_analytics.site.model import Fixture, Floor, Site

BOX = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0))
NEW = "polygon = [[5, 5], [6, 5], [6, 6], [5, 6]]"


def site() -> Site:
    fixture = Fixture("display", "The display", "ground", BOX)
    return Site(
        site_id="shop", name="Shop", timezone="UTC", root=Path("."), opening=None, closed=frozenset(),
        day_starts_min=240, floors=(Floor("ground", "Ground"),), cameras=(), areas=(),
        settings=Settings(), fixtures=(fixture,),
    )  # fmt: skip


def read(tmp_path: Path, text: str, of: Site | None = None) -> LayoutEdits:
    path = tmp_path / "edit.toml"
    path.write_text(text, encoding="utf-8")
    return read_edits(path, of or site(), last_day=date(2026, 11, 8))


def test_a_file_says_what_is_moved_added_removed_or_changed(tmp_path: Path) -> None:
    moved, added, door, one_way, opening = read(
        tmp_path,
        f'[[fixture]]\nid = "display"\n{NEW}\nfollow_share = 0.5\n'
        f'[[fixture]]\nid = "barrier"\nname = "Barrier"\nkind = "wall"\n{NEW}\n'
        '[[door]]\nline = [[0, 0], [0, 2]]\nkind = "exit"\nwidth_m = 2\nnew_width_m = 1.2\n'
        '[[one_way]]\nname = "Aisle"\nline = [[0, 0], [0, 2]]\n'
        '[site]\nopening = { mon-fri = "09:00-17:00" }\nfollow_share = 1\n',
    ).edits
    polygon = ((5.0, 5.0), (6.0, 5.0), (6.0, 6.0), (5.0, 6.0))
    assert moved == FixtureEdit("display", "The display", BOX, polygon, 0.5)
    assert added == FixtureEdit("barrier", "Barrier", None, polygon)
    assert door == DoorEdit("door", ((0, 0), (0, 2)), "exit", 2, 1.2)
    assert one_way == OneWayEdit("Aisle", ((0, 0), (0, 2)))
    assert isinstance(opening, OpeningEdit)
    assert opening.opening == (((540, 1020),),) * 5 + ((),) * 2
    [removed] = read(tmp_path, '[[fixture]]\nid = "display"\nremove = true\n').edits
    assert removed == FixtureEdit("display", "The display", BOX, None)


@pytest.mark.parametrize(
    ("text", "code", "line", "words"),
    [
        ("", "E123", None, "edits nothing"),
        ("[[fixture\n", "E121", 1, ""),
        (f'[[fixture]]\nid = "new"\n{NEW}\ncolour = "red"\n', "E122", 4, "knows no key 'colour'"),
        (f'[[fixtures]]\nid = "new"\n{NEW}\n', "E122", 1, "did you mean fixture"),
        ('[[fixture]]\nid = "new"\n', "E123", 1, "has no polygon"),
        ('[[fixture]]\nid = "displai"\nremove = true\n', "E125", 2, "did you mean display"),
        (f'[[fixture]]\nid = "display"\nremove = true\n{NEW}\n', "E124", 4, "remove and polygon"),
        (f'[[fixture]]\nid = "new"\n{NEW}\nfollow_share = 0.5\n', "E124", 4, "nobody stays at it yet"),
        (f'[[fixture]]\nid = "display"\n{NEW}\nfollow_share = 50\n', "E124", 4, "outside 0 to 1"),
        ('[[fixture]]\nid = "x"\npolygon = [[0, 0], [2, 2], [2, 0], [0, 2]]\n', "E128", 3, "crosses"),
        ('[[door]]\nline = [[0, 0], [0, 2]]\nwidth_m = 2\nnew_width_m = 1\n', "E123", 1, "has no kind"),
        ('[[door]]\nline = [[0, 0], [0, 2]]\nkind = "exit"\nwidth_m = 2\n', "E123", 1, "has no new_width_m"),
        ('[[door]]\nline = [[0, 0], [0, 2]]\nkind = "exit"\nwidth_m = 2\nnew_width_m = 2\n', "E124", 5, "equals"),
        ('[[one_way]]\nline = [[0, 0]]\n', "E128", 2, "needs at least 2"),
        ('[site]\nopening = { mon-fri = "09:10-17:00" }\n', "E127", 2, "quarter hour"),
        ('[site]\nfollow_share = 0.5\n', "E123", 1, "has no opening"),
    ],
)  # fmt: skip
def test_a_mistake_is_reported_with_its_line(
    tmp_path: Path, text: str, code: str, line: int | None, words: str
) -> None:
    with pytest.raises(ConfigError) as raised:
        read(tmp_path, text)
    [problem] = raised.value.problems
    assert (problem.code, problem.where and problem.where.line) == (code, line)
    assert words in f"{problem.what} {problem.where and problem.where.note}"
    assert problem.fix
    assert raised.value.what.startswith("edit.toml has 1 mistake")


def test_the_example_of_the_page_is_a_file_of_edits(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "whatif.md").read_text(encoding="utf-8")
    example = page.partition("```\n")[2].partition("```")[0]
    fruit = Fixture("fruit", "Fruit", "ground", BOX)
    assert len(read(tmp_path, example, replace(site(), fixtures=(*site().fixtures, fruit))).edits) == 6


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"there is no file .*nowhere\.toml"):
        read_edits(tmp_path / "nowhere.toml", site(), last_day=date(2026, 11, 8))


def test_all_mistakes_are_reported_at_once(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as raised:
        read(tmp_path, '[[fixture]]\nid = "new"\n[[door]]\nkind = "exti"\nline = [[0, 0], [0, 1]]\nwidth_m = 2\n')
    assert [p.where and p.where.line for p in raised.value.problems] == [1, 3, 4]


def test_a_site_of_several_floors_needs_the_floor(tmp_path: Path) -> None:
    two = replace(site(), floors=(Floor("ground", "Ground"), Floor("first", "First")))
    with pytest.raises(ConfigError) as raised:
        read(tmp_path, f'[[fixture]]\nid = "new"\n{NEW}\n', two)
    assert "has no floor" in raised.value.problems[0].what
    assert read(tmp_path, f'floor = "first"\n[[fixture]]\nid = "new"\n{NEW}\n', two).floor_id == "first"


def test_a_fixture_is_tried_at_several_places_by_their_middles(tmp_path: Path) -> None:
    one, two = read(
        tmp_path, '[[fixture]]\nid = "display"\nplaces = [[5.5, 5.5], [9.0, 1.5]]\nfollow_share = 0.5\n'
    ).edits
    assert one == FixtureEdit(
        "display", "The display 1", BOX, ((5.0, 5.0), (6.0, 5.0), (6.0, 6.0), (5.0, 6.0)), 0.5, is_choice=True
    )
    assert isinstance(two, FixtureEdit)
    assert two.new_polygon == ((8.5, 1.0), (9.5, 1.0), (9.5, 2.0), (8.5, 2.0))
    [new, _] = read(tmp_path, f'[[fixture]]\nid = "post"\n{NEW}\nplaces = [[4, 4], [8, 8]]\n').edits
    assert isinstance(new, FixtureEdit)
    assert (new.name, new.old_polygon, new.new_polygon and new.new_polygon[0]) == ("post 1", None, (3.5, 3.5))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f'[[fixture]]\nid = "post"\n{NEW}\nplaces = [[4, 4]]\n', "needs at least 2"),
        ('[[fixture]]\nid = "post"\nplaces = [[4, 4], [8, 8]]\n', "polygon"),
        (f'[[fixture]]\nid = "post"\n{NEW}\nplaces = [[4, 4], [1.2, 1.2]]\n', "lies on 'display'"),
        ('[[fixture]]\nid = "display"\nremove = true\nplaces = [[4, 4], [8, 8]]\n', "places"),
    ],
)
def test_places_that_cannot_be_tried_are_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, text)
    assert words in "".join(mistake.what for mistake in caught.value.problems)
