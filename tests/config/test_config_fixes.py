"""The printed fix of a mistake in vsd.toml works: the test carries out each one and reads the file again."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, VsdError

RIGHT = """\
[site]
id = "hall"
name = "Hall"
timezone = "Europe/Rome"
opening = { mon-fri = "09:00-20:00" }
distance_m = 2.0
[[floor]]
id = "ground"
name = "Ground floor"
[[camera]]
id = "cam-1"
name = "Entrance"
[[camera]]
id = "cam-2"
name = "Exit"
[[area]]
id = "tills"
name = "Tills"
polygon = [[0, 0], [5, 0], [5, 5], [0, 5]]
[rule]
pair_max_m = 2.5
"""
CAMERAS = '[[camera]]\nid = "cam-1"\nname = "Entrance"\n[[camera]]\nid = "cam-2"\nname = "Exit"\n'
PLAN = 'name = "Ground floor"\nplan = "{}"\nplan_m_per_px = 0.05'

WRONG: dict[str, tuple[str, str, str]] = {
    "a misspelt key": ("pair_max_m", "pair_mx_m", "E122"),
    "a misspelt table": ("[rule]", "[rul]", "E122"),
    "a setting in another table": ("pair_max_m = 2.5", "pair_max_m = 2.5\ncoordinate_max_m = 900", "E122"),
    "no camera": (CAMERAS, "", "E123"),
    "no name": ('name = "Hall"\n', "", "E123"),
    "no time zone": ('timezone = "Europe/Rome"\n', "", "E123"),
    "a plan without its scale": ('name = "Ground floor"', 'name = "Ground floor"\nplan = "plan.svg"', "E123"),
    "an area without a polygon": ("polygon = [[0, 0], [5, 0], [5, 5], [0, 5]]\n", "", "E123"),
    "a number in quotes": ("distance_m = 2.0", 'distance_m = "2"', "E124"),
    "a distance beyond its range": ("distance_m = 2.0", "distance_m = 200", "E124"),
    "a misspelt time zone": ("Europe/Rome", "Europe/Rom", "E124"),
    "an id with blanks": ('id = "tills"', 'id = "The Tills"', "E125"),
    "a floor that is not there": ('name = "Tills"', 'name = "Tills"\nfloor = "grund"', "E125"),
    "a plan by nearly its name": ('name = "Ground floor"', PLAN.format("plam.svg"), "E126"),
    "hours without minutes": ('"09:00-20:00"', '"9-20"', "E127"),
}
"""What of `RIGHT` is replaced by what, and the code of the mistake."""
BY_HAND: dict[str, tuple[str, str, str]] = {
    "E121": ('name = "Hall"', 'name = "Hall', "fix this line"),
    "E125": ('id = "cam-2"', 'id = "cam-1"', "give one of them another id"),
    "E126": ('name = "Ground floor"', PLAN.format("plan.txt"), "export it as PNG"),
    "E127": ("mon-fri", "mo-fr", "mon-fri"),
    "E128": ("[[0, 0], [5, 0], [5, 5], [0, 5]]", "[[0, 0], [5, 5], [5, 0], [0, 5]]", "list the corners once"),
    "E129": ('name = "Exit"', 'name = "Exit"\npoints = "p.csv"\nhomography = "h.txt"', "keep one of the two"),
}
"""Mistakes whose fix is words: only the user knows what was meant."""


def problems(folder: Path, text: str) -> list[VsdError]:
    """Return the mistakes of a vsd.toml."""
    (folder / "vsd.toml").write_text(text, encoding="utf-8")
    try:
        load_site(folder)
    except ConfigError as error:
        return list(error.problems)
    except VsdError as error:
        return [error]
    return []


def fixed(text: str, problem: VsdError) -> str | None:
    """Return the text with the printed fix carried out; None where it is words."""
    fix, at = problem.fix or "", (problem.where.line or 1) - 1 if problem.where is not None else 0
    lines = text.split("\n")
    if rename := re.match(r"rename it to (\w+)", fix):
        lines[at] = re.sub(r"^(\[*)\w+", rf"\g<1>{rename[1]}", lines[at])
    elif move := re.match(r"move the line under (\[\w+\])", fix):
        line = lines.pop(at)
        lines[lines.index(move[1]) + 1 if move[1] in lines else len(lines) :] = (
            [line, *lines[lines.index(move[1]) + 1 :]] if move[1] in lines else [move[1], line]
        )
    elif add := re.match(r"add a line such as: (.+)", fix):
        lines.insert(at + 1, add[1])
    elif block := re.match(r"add: (\[\[\w+\]\]) with (.+)", fix):
        lines += [block[1], *block[2].split(" and ")]
    elif named := re.match(r"did you mean '([^']+)'", fix):
        lines[at] = re.sub(r'"[^"]*"', f'"{named[1]}"', lines[at])
    elif times := re.match(r'write hours and minutes, such as "(\d\d:\d\d)"', fix):
        lines[at] = re.sub(r"(?<![\d:])(\d{1,2})(?=[-\"])", lambda m: f"{int(m[1]):02}:{times[1][3:]}", lines[at])
    elif written := re.match(r"(?:write it as: )?(\w+) = (.+?)(?: \(.*)?$", fix):
        lines[at] = f"{written[1]} = {written[2]}"
    else:
        return None
    return "\n".join(lines)


@pytest.mark.parametrize("name", WRONG)
def test_the_printed_fix_mends_the_file(name: str, tmp_path: Path) -> None:
    (tmp_path / "plan.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 200 120"></svg>')
    right, wrong, code = WRONG[name]
    assert problems(tmp_path, RIGHT) == []
    text = RIGHT.replace(right, wrong, 1)
    found = problems(tmp_path, text)
    assert [p.code for p in found] == [code]
    after = fixed(text, found[0])
    assert after is not None, found[0].fix
    assert problems(tmp_path, after) == [], after


@pytest.mark.parametrize("code", BY_HAND)
def test_a_fix_in_words_says_what_to_correct(code: str, tmp_path: Path) -> None:
    (tmp_path / "plan.txt").write_text("no picture")
    right, wrong, words = BY_HAND[code]
    found = problems(tmp_path, RIGHT.replace(right, wrong, 1))
    assert {p.code for p in found} <= {code, "E126"}  # the files of a calibration that is there twice are not there
    mistake = next(p for p in found if p.code == code)
    assert words in (mistake.fix or "")
    assert mistake.where is not None
    assert mistake.where.line is not None
