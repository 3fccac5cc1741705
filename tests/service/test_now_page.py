"""The live page over HTTP and in words: who may see it, what it says in each state, what it never says."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra serve is not installed")
pytest.importorskip("httpx", reason="the extra test is not installed")

from service.desk_site import NOW, READ_TOKEN, DeskBrowser, desk_app, desk_site
from service.live_states import AT, BUSY, HOSTILE, QUIET, STATES, site_of_two_floors
from starlette.testclient import TestClient
from warehouse.small_projects import T0, Person, beats, put

from vsd_analytics.figures.now import Fullest
from vsd_analytics.report.pages.week import shipped_style
from vsd_analytics.service.access import RateLimit
from vsd_analytics.service.answers import ReportAnswers
from vsd_analytics.service.app import make_app
from vsd_analytics.service.now_page import now_policy, render_now
from vsd_analytics.wording.languages import speaking

BEARER = {"Authorization": f"Bearer {READ_TOKEN}"}


def page(state: Any, root: Path = Path(), language: str = "en") -> str:
    with speaking(language):
        return render_now(state, site_of_two_floors(root), floor_id="ground", at=AT)


def heading(html: str) -> str:
    return re.findall(r"<h1[^>]*>(.*?)</h1>", html)[0]


def texts(html: str) -> str:
    """Return what is read, without tags."""
    body = re.sub(r"<(style|script|title).*?</\1>", "", html, flags=re.DOTALL)
    return " ".join(re.sub(r"<[^>]+>", " ", body).split())


@pytest.mark.parametrize("words", STATES)
def test_the_first_words_say_the_state(words: str) -> None:
    assert heading(page(STATES[words])) == words


@pytest.mark.parametrize("words", STATES)
def test_every_state_has_its_own_words_in_italian(words: str) -> None:
    english, italian = page(STATES[words]), page(STATES[words], language="it")
    assert heading(english) != heading(italian)
    assert re.search('<html lang="it', italian)


def test_the_instruction_has_its_record() -> None:
    said = texts(page(BUSY))
    assert "Be ready for 18:00: most people come then. Right on 7 of the last 10 Saturdays" in said
    assert "Most people come now, until 18:00." in texts(page(replace(BUSY, fullest=Fullest(17, 7, 10))))


def test_without_a_record_and_while_closed_there_is_no_instruction() -> None:
    assert "Next" not in texts(page(QUIET))
    assert "Next" not in texts(page(replace(BUSY, is_open=False)))


def test_a_queue_above_its_limit_is_marked_and_says_the_limit() -> None:
    assert re.search(r'<div class="above"><dt>Tills</dt><dd>more than 6</dd>', page(BUSY))
    assert "fewer than 5" in texts(page(BUSY))


def test_silent_cameras_are_named_with_their_time_and_the_others_are_not_said_to_send() -> None:
    said = texts(page(BUSY))
    assert "Camera 1: silent since 16:15." in said
    assert "Camera 2: silent all day." in said
    assert "send data" not in said
    assert "All 3 send data." in texts(page(QUIET))


def test_names_from_data_are_text() -> None:
    html = page(BUSY)
    assert HOSTILE not in html
    assert "&lt;script&gt;" in html
    assert html.count("<script>") == 1


def test_the_smallest_words_of_a_wall_are_read_from_four_metres() -> None:
    """On a wall of 1920 px no size is below 24 px, and the first words have 150 px or more."""
    style = shipped_style("now.css")
    greatest = [int(px) for px in re.findall(r"font-size: clamp\(\d+px, [\d.]+vw, (\d+)px\)", style)]
    assert min(greatest) >= 24
    assert max(greatest) >= 150


# ---- over HTTP ----


def client(root: Path, at: datetime = NOW, clock: Callable[[], float] = lambda: 0.0) -> TestClient:
    answers = ReportAnswers(root, now=at, clock=clock)
    app = make_app(answers, token=READ_TOKEN, limit=RateLimit(per_min=1e6, burst=10**6), title="Shop")
    return TestClient(app, raise_server_exceptions=False)


def test_the_live_page_needs_the_token_of_readers(tmp_path: Path) -> None:
    desk_site(tmp_path / "shop")
    http = client(tmp_path / "shop")
    assert http.get("/now").status_code == 401
    assert http.get("/now", headers=BEARER).status_code == 200
    assert http.get("/now/ground", headers=BEARER).text == http.get("/now", headers=BEARER).text
    assert http.get("/now/attic", headers=BEARER).status_code == 404


def test_browsers_are_asked_for_a_password_in_a_header_of_its_own(tmp_path: Path) -> None:
    """Chromium reads only the first of several challenges in one header, and shows an error where it is Bearer."""
    desk_site(tmp_path / "shop")
    asked = client(tmp_path / "shop").get("/now").headers.get_list("www-authenticate")
    assert [one.split()[0] for one in asked] == ["Basic", "Bearer"]


def test_an_empty_store_is_said_and_no_error(tmp_path: Path) -> None:
    desk_site(tmp_path / "shop")
    answer = client(tmp_path / "shop").get("/now", headers=BEARER)
    assert heading(answer.text) == "Nothing is stored yet"


def test_the_page_may_ask_its_server_and_nobody_else(tmp_path: Path) -> None:
    desk_site(tmp_path / "shop")
    answer = client(tmp_path / "shop").get("/now", headers=BEARER)
    assert answer.headers["content-security-policy"] == now_policy()
    assert "connect-src 'self'" in now_policy()
    assert re.findall(r'(?:src|href|action)="(?!data:|/now)', answer.text) == []


def test_a_page_of_records_says_the_last_quarter_hour_and_changes_with_the_next(tmp_path: Path) -> None:
    site = desk_site(tmp_path / "shop", more="")
    records = [*beats(T0, T0 + 1_800_000, camera="cam-1")]
    records += [
        Person(t, f"p{k}", 500 + 400 * k, 8000, camera="cam-1")
        for n, first in ((11, T0), (21, T0 + 900_000))
        for t in range(first, first + 900_000, 1000)
        for k in range(n)
    ]
    put(site, records)
    start = datetime.fromtimestamp(T0 / 1000, tz=NOW.tzinfo)
    said = [
        heading(client(site.root, start + timedelta(minutes=m)).get("/now", headers=BEARER).text) for m in (17, 30, 32)
    ]
    assert said == ["About 10 people", "About 10 people", "About 20 people"]


def test_at_the_desk_who_is_signed_in_sees_it_and_others_sign_in(tmp_path: Path) -> None:
    desk_site(tmp_path / "shop")
    app = desk_app(tmp_path / "shop")
    stranger, anna = DeskBrowser(app, writer=None), DeskBrowser(app)
    assert stranger.client.get("/desk/now/ground").headers["location"] == "/desk/sign-in?after=/desk/now/ground"
    shown = anna.client.get("/desk/now/ground")
    assert heading(shown.text) == "Nothing is stored yet"
    assert shown.headers["content-security-policy"] == now_policy()
    assert 'href="/desk/now/ground"' in anna.page()
