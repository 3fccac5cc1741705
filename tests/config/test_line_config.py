"""`[[line]]` of vsd.toml: a straight line on a floor that people cross, with a name for each side."""

from __future__ import annotations

from datetime import date
from pathlib import Path

import pytest

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, VsdError
from vsd_analytics.site.lines import Line
from vsd_analytics.site.model import Site

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
DOOR = '[[line]]\nid = "door"\nname = "Door"\npoints = [[1, 2], [3, 2]]\n'


def load(folder: Path, text: str) -> Site:
    (folder / "vsd.toml").write_text(SITE + text, encoding="utf-8")
    return load_site(folder)


def the_problem(folder: Path, text: str) -> VsdError:
    with pytest.raises(ConfigError) as caught:
        load(folder, text)
    (problem,) = caught.value.problems
    return problem


def test_the_shortest_line_has_sides_called_left_and_right_and_is_no_door(tmp_path: Path) -> None:
    assert load(tmp_path, DOOR).lines == (Line("door", "Door", "ground", ((1.0, 2.0), (3.0, 2.0)), "left", "right"),)


def test_a_line_has_names_of_its_sides_an_inside_and_a_life_of_whole_days(tmp_path: Path) -> None:
    keys = 'left = "Street"\nright = "Shop"\ninside = "right"\nfrom = 2026-11-01\nto = 2026-11-09\n'
    (line,) = load(tmp_path, DOOR + keys).lines
    assert (line.left, line.right, line.inside) == ("Street", "Shop", "right")
    assert (line.first_day, line.end_day) == (date(2026, 11, 1), date(2026, 11, 9))
    assert line.is_there(date(2026, 11, 8), date(2026, 11, 30))
    assert not line.is_there(date(2026, 11, 9), date(2026, 11, 30))


def test_a_site_without_lines_has_none(tmp_path: Path) -> None:
    assert load(tmp_path, "").lines == ()


@pytest.mark.parametrize(
    ("old", "new", "code", "told"),
    [
        ("[[1, 2], [3, 2]]", "[[1, 2], [3, 2], [4, 5]]", "E128", "[[line]] 'door' has 3 points"),
        ("[[1, 2], [3, 2]]", "[[1, 2], [1.2, 2]]", "E128", "[[line]] 'door' is 0.2 m long"),
        ("[[1, 2], [3, 2]]", "[[0, 0], [1800, 0]]", "E128", "[[line]] 'door' is 1800 m long"),
        ("points = [[1, 2], [3, 2]]\n", "", "E123", "[[line]] 'door' has no points"),
        ('name = "Door"\n', 'name = "Door"\nleft = "Out"\nright = "Out"\n', "E125", "both sides are called 'Out'"),
        ('name = "Door"\n', 'name = "Door"\ninside = "rigth"\n', "E124", "inside 'rigth' is not one of left, right"),
        ('name = "Door"\n', 'name = "Door"\nfloor = "upper"\n', "E125", "is on floor 'upper', which is not described"),
        ('name = "Door"\n', 'name = "Door"\nfrom = "2026-11-01T09:00"\n', "E125", "lines count whole days"),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path: Path, old: str, new: str, code: str, told: str) -> None:
    problem = the_problem(tmp_path, DOOR.replace(old, new))
    assert problem.code == code
    assert told in str(problem)
    assert problem.where is not None
    assert problem.where.line is not None


def test_two_lines_need_two_ids(tmp_path: Path) -> None:
    assert "two lines have the id 'door'" in str(the_problem(tmp_path, DOOR + DOOR))
