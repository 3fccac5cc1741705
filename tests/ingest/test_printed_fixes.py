"""A printed fix works: it is run on the very input that caused it, and the message does not come again.

The inputs are the odd files of this folder. Whatever `vsd check` says of one of them, its fix is split into
options and commands of a shell, and each is tried. What a fix says in words alone is for people, and is not tried.
"""

from __future__ import annotations

import io
import json
import re
import shutil
import subprocess
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, Final, NamedTuple

import pytest
from hostile_tables import HOSTILE
from marked_files import MARKED
from odd_files import ODD, WORKBOOKS, Odd
from odder_files import ODDER, ODDER_WORKBOOKS
from oddest_files import ODDEST
from printed_fixes import Fix, ways
from telling_files import TELLING
from walks import project

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

WITHOUT_A_PLAN: Final = [*ODDEST, *MARKED, *TELLING]
ON_A_PLAN: Final = [*ODD, *WORKBOOKS, *ODDER, *ODDER_WORKBOOKS, *HOSTILE]
SAYING: Final = [odd for odd in (*ON_A_PLAN, *WITHOUT_A_PLAN) if odd.rows is None or odd.says]
"""Files of which something is said."""
NAMES_SAY_NOTHING: Final = {"half a JSON array of something else", "columns of lists in JSON"}
"""Files that hold no positions at all: no name of theirs can be proposed."""
RIGHT_AS_IT_IS: Final = {
    "98% of the pairs are more",
    "a tenth of the steps of a second or longer would be faster than 129",
}
"""Messages that ask for a unit "if they are": pairs that are far apart, and steps to where people are lost."""
REFUSED: Final = re.compile("E1|E20[1-9]")


class Said(NamedTuple):
    """A message of a command."""

    code: str
    what: str
    fix: str

    @property
    def kind(self) -> tuple[str, str]:
        """Return what tells this message from others: its code, and its words without names and numbers."""
        return self.code, re.sub(r"'[^']*'|\d[\d.,%]*|-\d", "#", self.what)


def messages(root: Path, path: Path, options: Sequence[str]) -> list[Said]:
    """Return what `vsd check` says of a file."""
    out = io.StringIO()
    with redirect_stdout(out), redirect_stderr(io.StringIO()):
        run(cli, ["-C", str(root), "--now", "2025-12-01", "check", str(path), "--json", *options])
    output: dict[str, Any] = json.loads(out.getvalue())
    if "sources" not in output:
        return [Said(output["code"], output["message"], output["fix"] or "")]
    said = []
    for source in output["sources"]:
        if error := source["error"]:
            said.append(Said(error["code"], error["message"], error["fix"] or ""))
        said += [Said(w["code"], w["what"], w["fix"]) for w in (source["card"] or {}).get("warnings", [])]
    return said


def afterwards(root: Path, path: Path, options: Sequence[str], way: Fix) -> list[Said] | None:
    """Return what is said when a way of a fix was taken; None where its program is not installed."""
    if not way.shell:
        return messages(root, path, [*options, *way.options])
    if shutil.which(way.shell.split()[0]) is None:
        return None
    subprocess.run(way.shell, shell=True, cwd=path.parent, check=True)
    return messages(root, path.parent / way.shell.rpartition("> ")[2], options)


@pytest.mark.parametrize("odd", SAYING, ids=lambda odd: odd.name)
def test_a_printed_fix_ends_the_message_that_printed_it(odd: Odd, tmp_path: Path) -> None:
    root = project(tmp_path / "project", *odd.cameras, more=odd.more)
    if odd in WITHOUT_A_PLAN:
        toml = (root / "vsd.toml").read_text().replace('plan = "plan.svg"\nplan_m_per_px = 0.1\n', "")
        (root / "vsd.toml").write_text(toml.replace("picture_px = [1280, 720]\n", ""))
    path = odd.write(tmp_path)
    for said in messages(root, path, odd.options):
        ends = []
        for way in ways(said.fix):
            if way.is_open:
                assert odd.name in NAMES_SAY_NOTHING, f"{said.fix}: the program knows what it leaves open"
            elif way.options or way.shell:
                then = afterwards(root, path, odd.options, way)
                ends += [] if then is None else [said.kind not in {s.kind for s in then} and not _is_refused(then)]
        assert not ends or any(ends) or said.what.startswith(tuple(RIGHT_AS_IT_IS)), said


PROVOKED: Final = {
    "E202": "an empty file",
    "E203": "an unmapped box",
    "E204": "UTF-16",
    "E205": "an Arrow file without its end",
    "E209": "a Feather file of gigabytes",
    "E210": "days that could be months",
    "W212": "a filter that leaves nothing",
    "W220": "millimetres as metres",
    "W221": "three cameras as one",
    "W222": "cars as people",
    "W223": "naive times, no clock",
    "W224": "whole minutes",
    "W225": "ids that begin again",
    "W226": "metres as pixels",
    "W227": "seconds since 2001",
    "W228": "pairs as boxes",
}
"""An odd file for each code that files provoke; `tests/cli/test_fixes_of_codes.py` counts on them."""


@pytest.mark.parametrize("code", PROVOKED)
def test_a_code_that_files_provoke_is_provoked(code: str, tmp_path: Path) -> None:
    odd = next(odd for odd in SAYING if odd.name == PROVOKED[code])
    root = project(tmp_path / "project", *odd.cameras, more=odd.more)
    assert code in [said.code for said in messages(root, odd.write(tmp_path), odd.options)]


def _is_refused(said: list[Said]) -> bool:
    return any(REFUSED.match(message.code) for message in said)


@pytest.mark.parametrize(
    ("fix", "taken_apart"),
    [
        ("--unit mm (or cm, ft) if they are", [("--unit", "mm")]),
        ("--zone A/B or --zone UTC; for good: c", [("--zone", "A/B"), ("--zone", "UTC")]),
        ("--map u_px=x with --size WIDTHxHEIGHT if so", [("--map", "u_px=x", "--size", "1280x720")]),
        ('map the column (--map), or --where "\\"a b\\" = \'c\'"', [("--where", "\"a b\" = 'c'")]),
        ("state the unit (--unit), if any", []),
    ],
)
def test_options_are_taken_out_of_the_words_of_a_fix(fix: str, taken_apart: list[tuple[str, ...]]) -> None:
    assert [way.options for way in ways(fix)] == taken_apart
