"""Areas and fixtures at the desk: pointed at on the plan, or typed; saved, ended and taken back by who is signed in."""

from __future__ import annotations

import re
from datetime import date
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("starlette", reason="the extra serve is not installed")
pytest.importorskip("httpx", reason="the extra test is not installed")

from service.desk_site import NOW, DeskBrowser, desk_app, desk_site

from vsd_analytics.config.place_edits import PLACES, standing
from vsd_analytics.config.project import load_site
from vsd_analytics.service.desk_places import WIDTHS_PX
from vsd_analytics.service.plan_picture import PlanPicture, corners_of, corners_text
from vsd_analytics.site.model import Site

PAGE = "/desk/places/ground"
PLACE = {
    "floor": "ground", "kind": "shelf", "name": "Display", "from": "2026-11-17", "corners": "1,1 2,1 2,2 1,2",
}  # fmt: skip
HOSTILE = '"><script>alert(1)</script>{{ 7 * 7 }}&#39;'
points = st.lists(
    st.tuples(*[st.integers(-9999, 9999).map(lambda n: n / 10)] * 2), min_size=0, max_size=8
)  # fmt: skip


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return desk_site(tmp_path / "shop")


@pytest.fixture
def anna(site: Site) -> DeskBrowser:
    return DeskBrowser(desk_app(site.root))


def drawn(browser: DeskBrowser, **fields: str) -> str:
    """Send the form as a click on the plan does; return the corners it has then."""
    sent = browser.send("draw", **{**PLACE, "corners": "", **fields})
    assert sent.status_code == 200
    corners = re.search(r'name="corners" required value="([^"]*)"', sent.text)
    assert corners is not None
    return corners[1]


def test_a_place_is_saved_as_by_the_command_with_who_and_when_and_taken_back(site: Site, anna: DeskBrowser) -> None:
    text = (site.root / "vsd.toml").read_bytes()
    sent = anna.send("mark", **PLACE)
    assert (sent.status_code, sent.headers["location"]) == (303, PAGE)
    (fixture,) = load_site(site.root).fixtures
    assert (fixture.name, fixture.kind, fixture.polygon) == ("Display", "shelf", ((1, 1), (2, 1), (2, 2), (1, 2)))
    (change,) = PLACES.read(site)
    assert (change.by, change.at, change.day) == ("Anna", NOW, date(2026, 11, 17))
    page = anna.client.get(PAGE).text
    assert "The place is saved." in page
    assert "Display: from Tue 17 Nov" in page
    assert "Anna, Tue 17 Nov, 10:30" in page
    ben = DeskBrowser(desk_app(site.root), writer="Ben")
    for browser, said in ((anna, "Taken back."), (ben, "somebody did it already")):
        assert browser.send("undo-mark", floor="ground", line="display marked").status_code == 303
        assert said in browser.client.get(PAGE).text
    assert (site.root / "vsd.toml").read_bytes() == text


def test_an_end_is_saved_and_taken_back(site: Site, anna: DeskBrowser) -> None:
    text = (site.root / "vsd.toml").read_bytes()
    anna.send("end", floor="ground", place="entrance", until="2026-12-01")
    assert load_site(site.root).areas[0].end_day == date(2026, 12, 1)
    assert "no longer from Tue 1 Dec" in anna.client.get(PAGE).text
    anna.send("undo-mark", floor="ground", line="entrance ended")
    assert (site.root / "vsd.toml").read_bytes() == text


def test_clicks_on_the_plan_are_corners_in_metres_and_the_keyboard_adds_none(site: Site, anna: DeskBrowser) -> None:
    # the floor has no plan: the area of 4 m, with 1 m around it, is drawn; a click is sent in pixels from the corner
    scale = 6 / WIDTHS_PX["wide"]
    corners = drawn(anna, **{"wide.x": "170", "wide.y": "170"})
    assert corners == f"{round(-1 + 170 * scale, 1):g},{round(5 - 170 * scale, 1):g}"
    more = drawn(anna, corners=corners, **{"narrow.x": "144", "narrow.y": "72"})
    assert more == f"{corners} 2,3.5"
    assert drawn(anna, corners=more, **{"narrow.x": "0", "narrow.y": "0"}) == more
    assert drawn(anna, corners=more, drop="1") == corners
    assert not (site.root / "places.jsonl").exists(), "nothing is written before it is saved"


@given(points)
def test_corners_are_read_as_they_are_written(corners: list[tuple[float, float]]) -> None:
    assert corners_of(corners_text(corners)) == tuple(corners)
    assert corners_of("; ".join(f"{x} , {y}" for x, y in corners)) == tuple(corners)


@pytest.mark.parametrize("text", ["1", "1,2 3", "a,b c,d e,f", "1,2 3,4 5,6 x", "1e9,2 3,4 5,6", "nan,1 2,2 3,3"])
def test_what_is_no_corner_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="no corner"):
        corners_of(text)


@given(st.integers(1, 679), st.integers(1, 400), st.sampled_from(sorted(WIDTHS_PX)))
def test_a_click_is_drawn_where_it_was_made(
    tmp_path_factory: pytest.TempPathFactory, x: int, y: int, size: str
) -> None:
    site = desk_site(tmp_path_factory.mktemp("shop"))
    plan, width_px = PlanPicture(site, site.floors[0], day=NOW.date()), WIDTHS_PX[size]
    place = plan.place_m((x, y), width_px=width_px)
    assert place is not None
    px_per_m = width_px / 6
    assert abs((place[0] + 1) * px_per_m - x) <= 0.05 * px_per_m + 1
    assert abs((5 - place[1]) * px_per_m - y) <= 0.05 * px_per_m + 1


@pytest.mark.parametrize(
    ("job", "fields", "words"),
    [
        ("mark", {"kind": "door"}, "Choose what it is."),
        ("mark", {"name": ""}, "Give it a name"),
        ("mark", {"name": "x" * 500}, "Give it a name"),
        ("mark", {"from": "soon"}, "This is no day."),
        ("mark", {"from": "2026-11-15"}, "Choose a day of this week or later."),
        ("mark", {"corners": "here"}, "Give three corners or more"),
        ("mark", {"corners": "1,1 2,2"}, "Give three corners or more"),
        ("mark", {"corners": "0,0 4,4 4,0 0,4"}, "Give three corners or more"),
        ("end", {"place": "gone", "until": "2026-11-20"}, "The floor has no such area or fixture"),
        ("end", {"place": "entrance", "until": "2026-11-01"}, "Choose a day of this week or later."),
        ("end", {"place": "entrance", "until": ""}, "This is no day."),
    ],
)
def test_a_mistake_is_said_at_its_field_and_nothing_is_written(
    site: Site, anna: DeskBrowser, job: str, fields: dict[str, str], words: str
) -> None:
    text = (site.root / "vsd.toml").read_bytes()
    sent = anna.send(job, **{**PLACE, **fields})
    assert sent.status_code == 422
    assert sent.text.count(words) >= 2, "above, and at the field"
    assert 'aria-invalid="true"' in sent.text
    if job == "mark" and "name" not in fields:
        assert 'value="Display"' in sent.text, "what was filled in is still there"
    assert (site.root / "vsd.toml").read_bytes() == text
    assert not (site.root / "places.jsonl").exists()


def test_hostile_words_are_words(site: Site, anna: DeskBrowser) -> None:
    assert anna.send("mark", **{**PLACE, "name": HOSTILE}).status_code == 303
    page = anna.client.get(PAGE).text
    assert "<script>" not in page
    assert load_site(site.root).fixtures[0].name == HOSTILE
    assert "<script>" not in anna.send("draw", **{**PLACE, "name": HOSTILE, "corners": HOSTILE}).text
    assert anna.client.get("/desk/places/%3Cscript%3E").status_code == 404
    assert anna.send("mark", **{**PLACE, "floor": "\r\nSet-Cookie: a=b"}).status_code == 422


def test_nobody_draws_without_the_right_and_a_form_sent_twice_is_done_once(site: Site, anna: DeskBrowser) -> None:
    nobody = DeskBrowser(desk_app(site.root), writer=None)
    assert nobody.client.get(PAGE).headers["location"] == f"/desk/sign-in?after={PAGE}"
    assert nobody.client.post("/desk/draw", data=PLACE).headers["location"] == "/desk/sign-in"
    assert anna.send("draw", **{**PLACE, "form": "wrong"}).status_code == 403
    assert anna.send("draw", {"Origin": "http://elsewhere"}, **PLACE).status_code == 403
    hidden = anna.hidden()
    for _ in range(2):
        assert anna.client.post("/desk/mark", data={**hidden, **PLACE}).status_code == 303
    assert len(standing(load_site(site.root))) == 1
