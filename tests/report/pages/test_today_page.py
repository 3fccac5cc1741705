"""The card of the day: what it says in each situation, in each language, and how it looks to a browser."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from email import message_from_bytes
from email.policy import default
from pathlib import Path
from typing import Any

import pytest
from report import sample_cards as cards

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.figures.share.counts import rough
from vsd_analytics.figures.share.days import closed_days
from vsd_analytics.report.pages.mail import as_bytes
from vsd_analytics.report.pages.today import TodayWords, make_today_page, today_html, today_mail, today_words
from vsd_analytics.resources import LANGUAGES
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import speaking

ENGLISH = re.compile(r"\b(the|and|violations|hours?|week|weeks|cameras?|since|between|likely|more|than|people|data)\b")


def words(name: str) -> TodayWords:
    return today_words(cards.ALL[name](), cards.site())


@pytest.mark.parametrize(
    ("name", "headline"),
    [
        ("usual", "Violations are in their usual range"),
        ("above", "More violations than usual so far today"),
        ("unusual", "An unusual hour: Saturday 10:00"),
        ("one_silent", "Camera “Aisles” is not sending data"),
        ("stopped", "No camera is sending data"),
        ("first_weeks", "What is usual is not known yet"),
        ("closed", "Closed yesterday and today"),
    ],
)
def test_the_headline_names_what_matters_most(name: str, headline: str) -> None:
    assert words(name).headline == headline


def test_two_silent_cameras_share_a_headline_and_a_sentence() -> None:
    site = cards.site(cameras=("Entrance", "Aisles", "Tills"))
    said = today_words(cards.card(silent=cards.silent("cam-1", "cam-3"), n_cameras=3), site)
    assert said.headline == "“Entrance” and “Tills” are not sending data"
    assert said.silent[0] == "“Entrance” and “Tills”: no data since Fri 13 Nov, 17:00, which is 10 hours of opening."


def test_a_day_without_a_usual_range_is_not_called_usual() -> None:
    said = words("first_weeks")
    assert [d.position for d in said.days] == [None, None]
    assert "needs 4 earlier days" in said.days[0].notes[0]
    assert said.ahead == ("No forecast: a forecast needs 4 recorded weeks, has 2.",)


def test_what_to_expect_of_closed_hours_and_of_hours_that_few_weeks_recorded() -> None:
    over = tuple(h for h in cards.card().hours if h.is_over)
    coming = replace(over[0], day=cards.SUNDAY, is_over=False, violations=None, people=None, usual=None)
    site = cards.site()
    assert words("closed").ahead == ("Closed for the rest of today, and tomorrow.",)
    assert today_words(cards.card(hours=over), site).ahead == ("Closed for the rest of today, and tomorrow.",)
    said = today_words(cards.card(hours=(*over, coming)), site).ahead
    assert said == ("No forecast: the open hours ahead were recorded in too few weeks.",)


def test_hours_that_were_not_recorded_are_a_dash_and_not_zero() -> None:
    yesterday, so_far = words("stopped").days
    assert (yesterday.value, so_far.value) == ("150", "–")
    assert so_far.notes[0] == "No usual range: nothing or too little was recorded."


def test_the_card_is_exact_and_says_that_it_is_the_operator_s() -> None:
    few = cards.card(so_far=cards.level(cards.SATURDAY, 3.0), unusual=cards.unusual(cards.odd_hour(3)))
    said = today_words(few, cards.site())
    assert said.days[1].value == "3"
    assert say("page.exact") in today_html(make_today_page(few, cards.site()))


def test_what_is_mailed_and_published_is_of_days_that_are_over_in_round_numbers(
    demo_project: Path, tmp_path: Path
) -> None:
    asked = ["-C", str(demo_project), "--now", "2026-11-14T14:20+01:00", "today", "--mail", "--out", str(tmp_path)]
    assert run(cli, asked) == 0
    page = (tmp_path / "today.html").read_text(encoding="utf-8")
    mail = message_from_bytes((tmp_path / "today.eml").read_bytes(), policy=default)
    part = mail.get_body(preferencelist=("plain",))
    assert part is not None
    text = " ".join(part.get_content().split())
    assert "Today until 14:00" in page
    assert "Today until" not in text
    assert re.search(r"Yesterday, Fri 13 Nov: about [\d,]*0 violations", text)
    assert say("today.closed_days") in text


def test_a_reader_s_card_says_of_a_small_day_that_it_is_small() -> None:
    small = closed_days(cards.card(yesterday=cards.level(cards.FRIDAY, 3.0)), cards.site())
    assert today_words(small, cards.site()).days[0].value == "<5"
    assert today_words(small, cards.site()).days[1:] == ()


@pytest.mark.parametrize(("n", "given"), [(0, 0), (1, None), (4, None), (5, 10), (14, 10), (15, 20), (104, 100)])
def test_counts_of_a_day_are_given_in_steps_of_twice_the_limit(n: int, given: int | None) -> None:
    assert rough(n, below=5) == given


def test_a_number_that_makes_up_for_a_camera_is_called_an_estimate() -> None:
    said = today_words(cards.card(yesterday=cards.level(cards.FRIDAY, 140.0, estimate=151.4)), cards.site())
    assert said.days[0].value == "140"
    assert "For all cameras, in the hours recorded enough: about 151." in said.days[0].notes


def test_what_to_expect_names_the_fullest_hour_that_is_not_over() -> None:
    assert (
        words("usual").ahead[0]
        == "Most people: Saturday 20:00, about 8.0 in view at a time, likely between 4.0 and 9.0."
    )


@pytest.mark.parametrize("name", list(cards.ALL))
def test_no_english_word_is_left_in_another_language(name: str) -> None:
    with speaking("it"):
        page = make_today_page(cards.ALL[name](), cards.site(name="Mercato", cameras=("Porta", "Corsia")))
        html = today_html(page)
    assert set(LANGUAGES) == {"en", "it"}
    body = re.sub(r"<(style|title)>.*?</\1>|<[^>]+>|vsd-analytics", " ", html[html.index("<body") :], flags=re.DOTALL)
    assert not ENGLISH.findall(body)
    assert 'lang="it-IT"' in html


def test_names_are_text_in_page_and_mail() -> None:
    evil = '<script>alert(1)</script>"\r\nBcc: a@example.org'
    page = make_today_page(cards.card(silent=cards.silent("cam-1")), cards.site(name=evil, cameras=(evil, "B")))
    assert "<script>" not in today_html(page)
    mail = today_mail(page, sender="a@example.org", to=("b@example.org",))
    assert mail["Bcc"] is None
    assert "\n" not in str(mail["Subject"])
    html = mail.get_body(("html",))
    assert html is not None
    assert "<script>" not in html.get_content()  # type: ignore[attr-defined]


def test_the_same_day_gives_the_same_bytes() -> None:
    pages = [make_today_page(cards.card(), cards.site()) for _ in range(2)]
    assert today_html(pages[0]) == today_html(pages[1])
    assert as_bytes(today_mail(pages[0])) == as_bytes(today_mail(pages[1]))


def test_the_command_writes_page_and_mail_and_prints_the_same_words(
    demo_project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["-C", str(demo_project), "--now", "2026-11-14T14:20+01:00", "today"]
    assert run(cli, [*asked, "--out", str(tmp_path), "--mail"]) == 0
    printed = capsys.readouterr().out
    assert {p.name for p in tmp_path.iterdir()} == {"today.html", "today.eml"}
    assert "WHAT IS USUAL IS NOT KNOWN YET" in printed
    assert run(cli, [*asked, "--json"]) == 0
    [found] = json.loads(capsys.readouterr().out)["today"]
    [_, so_far] = found["answers"]["today_days"]["rows"]
    assert f"{so_far['n_violations']['value']:,} violations" in printed
    assert so_far["until_hour"] == 14


def test_cameras_that_stopped_ask_for_somebody(demo_project: Path, tmp_path: Path) -> None:
    asked = ["-C", str(demo_project), "--now", "2026-11-16T12:10+01:00", "today", "--out", str(tmp_path)]
    assert run(cli, asked) == 1
    assert "No camera is sending data" in (tmp_path / "today.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("arguments", [("--to", "a@example.org"), ("--again",), ("--json", "--mail"), ("--floor", "x")])
def test_options_that_do_not_go_together_are_refused(demo_project: Path, arguments: tuple[str, ...]) -> None:
    assert run(cli, ["-C", str(demo_project), "--now", "2026-11-14T14:20+01:00", "today", *arguments]) == 2


@pytest.mark.browser
@pytest.mark.parametrize("name", list(cards.ALL))
def test_the_card_fits_a_phone_and_is_accessible(
    tab: Callable[..., Any], axe: Callable[..., Any], tmp_path: Path, name: str
) -> None:
    path = tmp_path / f"{name}.html"
    path.write_text(today_html(make_today_page(cards.ALL[name](), cards.site())), encoding="utf-8")
    page = tab(path.as_uri(), bypass_csp=True)
    for scheme, width in (("light", 320), ("dark", 390), ("light", 1280)):
        page.emulate_media(color_scheme=scheme)
        page.set_viewport_size({"width": width, "height": 700})
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
        assert axe(page) == [], (scheme, width)
