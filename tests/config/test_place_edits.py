"""Areas and fixtures from a day on: written, ended and taken back without a trace, and never in weeks that are over."""

from __future__ import annotations

import json
import re
import shlex
from datetime import date, datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config import place_edits
from vsd_analytics.config.place_edits import (
    KINDS,
    PLACES,
    can_take_back,
    end_place,
    mark_place,
    standing,
    take_place_back,
)
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, UsageError
from vsd_analytics.site.model import Site

NOW = datetime(2026, 11, 18, 10, tzinfo=ZoneInfo("Europe/Rome"))
TODAY = NOW.date()
MONDAY = date(2026, 11, 16)
SQUARE = ((2.0, 7.5), (3.0, 7.5), (3.0, 8.0), (2.0, 8.0))
TOML = """# The shop.
[site]
id = "shop"
name = "Shop"
timezone = "Europe/Rome"

[[floor]]
id = "hall"
name = "Hall"

[[camera]]
id = "cam-1"
name = "Camera"
floor = "hall"

[[area]]  # the way in
id = "entrance"
name = "Entrance"   # by the mat
polygon = [[0, 0], [4, 0],
           [4, 4], [0, 4]]
{more}"""
names = st.sampled_from(["Display", "entrance", "Zoë ]]", 'An"na\\', "[[area]]", "#", "\u5c55\u793a"])


def project(root: Path, more: str = "", *, end: str = "\n") -> Site:
    (root / "vsd.toml").write_bytes(TOML.format(more=more).replace("\n", end).encode())
    return load_site(root)


def mark(root: Path, name: str = "Display", kind: place_edits.PlaceKind = "shelf", day: date = TODAY) -> str:
    made = mark_place(
        load_site(root), kind=kind, name=name, floor_id="hall", polygon=SQUARE, first=day, at=NOW, by="Anna"
    )
    return made.place_id


@settings(max_examples=60, deadline=None)
@given(names, names, st.sampled_from(KINDS), st.sampled_from(KINDS), st.integers(0, 9), st.sampled_from(["\n", "\r\n"]))
def test_what_is_marked_is_there_from_its_day_on_and_is_taken_back_without_a_trace(
    one: str, two: str, kind: place_edits.PlaceKind, other: place_edits.PlaceKind, later: int, end: str
) -> None:
    with TemporaryDirectory() as folder:
        root = Path(folder)
        project(root, end=end)
        text = (root / "vsd.toml").read_bytes()
        day = NOW.date() + timedelta(days=later)
        ids = [mark(root, one, kind, day), mark(root, two, other)]
        assert len({*ids, "entrance"}) == 3, "no id is used twice"
        site = load_site(root)
        for place_id, name, its, first in ((ids[0], one, kind, day), (ids[1], two, other, NOW.date())):
            if its == "area":
                (area,) = (a for a in site.areas if a.area_id == place_id)
                assert (area.name, area.polygon, area.first_day, area.end_day) == (name, SQUARE, first, None)
            else:
                (fixture,) = (f for f in site.fixtures if f.fixture_id == place_id)
                assert (fixture.name, fixture.polygon, fixture.kind, fixture.valid_to) == (name, SQUARE, its, None)
                assert fixture.valid_from is not None
                assert fixture.valid_from.astimezone(site.zone).date() == first
        assert [(c.place_id, c.by, c.at) for c in standing(site)] == [(i, "Anna", NOW) for i in ids]
        for change in standing(site):
            assert take_place_back(load_site(root), change, at=NOW, by="Ben")
            assert not take_place_back(load_site(root), change, at=NOW)
        assert (root / "vsd.toml").read_bytes() == text
        assert [(c.action, c.by) for c in PLACES.read(load_site(root))] == [
            ("marked", "Anna"), ("marked", "Anna"), ("unmarked", "Ben"), ("unmarked", "Ben"),
        ]  # fmt: skip


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_place_of_the_owners_ends_by_one_line_and_is_back_without_it(tmp_path: Path, end: str) -> None:
    site = project(tmp_path, end=end)
    text = (tmp_path / "vsd.toml").read_text(encoding="utf-8")
    gone = end_place(site, "entrance", date(2026, 12, 1), at=NOW, by="Anna")
    assert gone is not None
    new = (tmp_path / "vsd.toml").read_text(encoding="utf-8")
    assert [line for line in new.splitlines() if line not in text.splitlines()] == ['to = "2026-12-01"']
    assert load_site(tmp_path).areas[0].end_day == date(2026, 12, 1)
    assert end_place(load_site(tmp_path), "entrance", date(2026, 12, 2), at=NOW) is None, "it has an end"
    assert can_take_back(load_site(tmp_path), today=NOW.date()) == (gone,)
    assert take_place_back(load_site(tmp_path), gone, at=NOW)
    assert (tmp_path / "vsd.toml").read_text(encoding="utf-8") == text


def test_a_mark_that_was_ended_is_taken_back_after_its_end(tmp_path: Path) -> None:
    project(tmp_path)
    text = (tmp_path / "vsd.toml").read_bytes()
    place = mark(tmp_path)
    end_place(load_site(tmp_path), place, date(2026, 12, 1), at=NOW)
    marked, ended = standing(load_site(tmp_path))
    assert can_take_back(load_site(tmp_path), today=NOW.date()) == (ended,)
    assert take_place_back(load_site(tmp_path), ended, at=NOW)
    assert take_place_back(load_site(tmp_path), marked, at=NOW)
    assert (tmp_path / "vsd.toml").read_bytes() == text


def test_weeks_that_are_over_keep_their_places(tmp_path: Path) -> None:
    project(tmp_path)
    with pytest.raises(UsageError, match="cannot change in the past"):
        mark(tmp_path, day=MONDAY - timedelta(days=1))
    with pytest.raises(UsageError, match="cannot change in the past"):
        end_place(load_site(tmp_path), "entrance", MONDAY - timedelta(days=1), at=NOW)
    mark(tmp_path, day=MONDAY)
    (change,) = standing(load_site(tmp_path))
    with pytest.raises(UsageError, match="weeks with it are over"):
        take_place_back(load_site(tmp_path), change, at=NOW + timedelta(days=7))


@pytest.mark.parametrize(
    "corners",
    [((0, 0), (4, 4), (4, 0), (0, 4)), ((0, 0), (1, 0), (2, 0)), ((0, 0), (1, 0)), ((0, 0), (0.01, 0), (0, 0.01))],
)
def test_corners_that_make_no_area_are_refused(tmp_path: Path, corners: tuple[tuple[float, float], ...]) -> None:
    site = project(tmp_path)
    with pytest.raises(UsageError, match="no area"):
        mark_place(site, kind="area", name="A", floor_id="hall", polygon=corners, first=NOW.date(), at=NOW)
    assert not (tmp_path / "places.jsonl").exists()


def test_a_place_beside_the_plan_is_refused(tmp_path: Path) -> None:
    (tmp_path / "plan.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" width="400" height="200"/>')
    text = TOML.format(more="").replace('name = "Hall"', 'name = "Hall"\nplan = "plan.svg"\nplan_m_per_px = 0.05')
    (tmp_path / "vsd.toml").write_text(text)
    far = [(x * 100, y * 100) for x, y in SQUARE]  # centimetres in place of metres
    with pytest.raises(UsageError, match="beside the plan"):
        mark_place(load_site(tmp_path), kind="area", name="A", floor_id="hall", polygon=far, first=NOW.date(), at=NOW)
    assert mark(tmp_path) == "display"


def test_tables_of_another_kind_are_left_to_the_hand(tmp_path: Path) -> None:
    project(tmp_path)
    text = (tmp_path / "vsd.toml").read_text().replace("[[area]]  # the way in", "[[area]]")
    head, _, area = text.partition("[[area]]")
    inline = 'area = [{ id = "entrance", name = "Entrance", polygon = [[0, 0], [4, 0], [4, 4]] }]\n'
    (tmp_path / "vsd.toml").write_text(inline + head)
    before = (tmp_path / "vsd.toml").read_bytes()
    assert area
    with pytest.raises(ConfigError, match="cannot be written"):
        end_place(load_site(tmp_path), "entrance", date(2026, 12, 1), at=NOW)
    with pytest.raises(ConfigError, match="cannot be written"):
        mark(tmp_path, kind="area")
    assert (tmp_path / "vsd.toml").read_bytes() == before
    assert standing(load_site(tmp_path)) == ()


def test_a_program_that_dies_before_the_file_is_written_leaves_what_can_be_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from vsd_analytics.store import durable

    project(tmp_path)
    mark(tmp_path)
    (marked,) = standing(load_site(tmp_path))
    publish = durable.publish

    def dies(path: Path, data: bytes, **more: bool) -> None:
        if path.name == "vsd.toml":
            raise KeyboardInterrupt
        publish(path, data, **more)

    monkeypatch.setattr(durable, "publish", dies)
    for job in (lambda: mark(tmp_path, "Table"), lambda: take_place_back(load_site(tmp_path), marked, at=NOW)):
        with pytest.raises(KeyboardInterrupt):
            job()
    monkeypatch.undo()
    assert standing(load_site(tmp_path)) == (marked,), "what did not happen does not hold, and can be done"
    assert take_place_back(load_site(tmp_path), marked, at=NOW + timedelta(seconds=1))
    assert mark(tmp_path, "Table") == "table-2"


def test_the_command_marks_ends_lists_and_takes_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project(tmp_path)
    before = (tmp_path / "vsd.toml").read_bytes()

    def vsd(*words: str) -> tuple[int, str]:
        code = run(cli, ["-C", str(tmp_path), "--now", "2026-11-18T10:00+01:00", "mark", *words])
        said = capsys.readouterr()
        return code, said.out + said.err

    assert vsd() == (0, "nothing was marked\n")
    assert vsd("--json") == (0, '{"places": []}\n')
    made = vsd("area", "Promotion", "--corners", "4,2 8,2 8,5 4,5", "--from", "2026-12-01", "--by", "Anna")
    assert made == (0, "promotion: Promotion, area, from 2026-12-01  (Anna)\n")
    assert json.loads(vsd("--json")[1])["places"] == [
        {
            "id": "promotion", "kind": "area", "name": "Promotion", "action": "marked", "day": "2026-12-01",
            "by": "Anna", "at": "2026-11-18T10:00:00+01:00",
        }
    ]  # fmt: skip
    assert vsd("--end", "promotion", "--from", "2026-12-24") == (
        0, "promotion: Promotion, area, no longer from 2026-12-24\n",
    )  # fmt: skip
    assert vsd("--end", "promotion")[1] == "promotion has an end already\n"
    assert len(vsd()[1].splitlines()) == 2
    assert vsd("--take-back", "promotion") == (0, "taken back\n")
    assert vsd("--take-back", "promotion") == (0, "taken back\n")
    assert vsd("--take-back", "promotion") == (0, "nothing that vsd mark wrote of promotion holds\n")
    assert (tmp_path / "vsd.toml").read_bytes() == before
    for words in (
        ("shelf",), ("shelf", "Display"), ("shelf", "Display", "--corners", "1,1 2"), ("desk", "Display"),
        ("--corners", "1,1 2,1 2,2"), ("--from", "2026-11-20"), ("--by", "Anna"), ("area", "A", "--end", "entrance"),
        ("shelf", "D", "--corners", "0,0 4,4 4,0 0,4"), ("--end", "nothing"),
        ("--end", "entrance", "--from", "2026-11-01"),
    ):  # fmt: skip
        code, text = vsd(*words)
        assert code == 2, words
        for fix in re.findall(r"fix: vsd mark (.*)", text):
            assert vsd(*shlex.split(fix))[0] == 0, "what it proposes works"
