"""`vsd inbox`: what a button of the page writes, and replies to the weekly mail, become answers after a look."""

from __future__ import annotations

import re
from datetime import date
from email.message import EmailMessage
from html import unescape
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest
from report import sample_weeks as weeks
from site_text import site_text

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.asked_questions import remember
from vsd_analytics.config.change_log import read_answers
from vsd_analytics.config.project import load_site
from vsd_analytics.report.pages.questions import choose
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.report.send.mail_answers import NoAnswerError, mail_answer
from vsd_analytics.site.model import Site
from vsd_analytics.site.questions import AskedQuestion
from vsd_analytics.wording.languages import speaking

DAY = "Tue, 17 Nov 2026 09:30:00 +0100"


@pytest.fixture
def site(tmp_path: Path) -> Site:
    (tmp_path / "vsd.toml").write_text(site_text(timezone="Europe/Rome"), encoding="utf-8")
    site = load_site(tmp_path)
    asked = choose(weeks.normal())
    longer = AskedQuestion(date(2026, 11, 2), "ground", f"{asked.question_id}-more", "x", "wait", "Longer?", None)
    remember(site, [AskedQuestion(date(2026, 11, 9), "ground", asked.question_id, "x", "wait", asked.text), longer])
    return site


def mail(subject: str, body: str, sender: str = "Anna Rossi <anna@shop.example>") -> bytes:
    made = EmailMessage()
    made["Subject"], made["From"], made["Date"] = subject, sender, DAY
    made.set_content(body)
    return made.as_bytes()


def inbox(site: Site, *words: str) -> int:
    return run(cli, ["-C", str(site.root), "inbox", *words])


@pytest.mark.parametrize("language", ["en", "it"])
def test_what_the_buttons_write_is_read(site: Site, language: str) -> None:
    with speaking(language):
        page = render_html(weeks.normal())
    links = [unescape(link) for link in re.findall(r'href="(mailto:[^"]*)"', page)]
    found = []
    for link in links:
        query = parse_qs(urlsplit(link).query)
        found.append(mail_answer(mail(query["subject"][0], query["body"][0]), site))
    assert [f.kind for f in found] == ["tried", "later", "not-possible"]
    assert {(f.question_id, f.text, f.by) for f in found} == {(choose(weeks.normal()).question_id, "", "Anna Rossi")}
    body = parse_qs(urlsplit(links[0]).query)["body"][0].splitlines()
    filled = "\r\n".join([f"{body[0]}Mat moved", body[1], f"{body[2]}2026-11-16 07:00", *body[3:]])
    tried = mail_answer(mail(parse_qs(urlsplit(links[0]).query)["subject"][0], filled), site)
    assert (tried.text, str(tried.at)) == ("Mat moved", "2026-11-16 07:00:00+01:00")


@pytest.mark.parametrize(
    ("first", "kind", "text"),
    [
        ("TRIED. Mat moved.", "tried", "Mat moved"),
        ("provato: tappeto spostato", "tried", "tappeto spostato"),
        ("Not possible, the fire door", "not-possible", "the fire door"),
        ("Rimandato", "later", ""),
    ],
)
def test_a_reply_begins_with_its_answer_and_leaves_the_question_in_the_quote(
    site: Site, first: str, kind: str, text: str
) -> None:
    quoted = f"> Answer ... and leave {choose(weeks.normal()).question_id} in it. LATER\n"
    found = mail_answer(mail("Re: Shop, week 46", f"{first}\n\nOn Mon, 16 Nov vsd wrote:\n{quoted}"), site)
    assert (found.kind, found.text.rstrip(".")) == (kind, text)


@pytest.mark.parametrize(
    ("subject", "body", "why"),
    [
        ("Re: Shop", "tried", "names no question"),
        ("{id}: perhaps", "I do not know", "none of the answers"),
        ("{id}: tried", "When: some day", "cannot be read"),
        ("{id}: tried", "What was done, or why not: " + "x" * 501, "longer than 500"),
        ("x{id}: tried", "tried", "names no question"),
    ],
)
def test_a_mail_that_is_no_answer_says_why_and_stores_nothing(
    site: Site, capsys: pytest.CaptureFixture[str], subject: str, body: str, why: str
) -> None:
    data = mail(subject.format(id=choose(weeks.normal()).question_id), body)
    with pytest.raises(NoAnswerError, match=why):
        mail_answer(data, site)
    (site.root / "a.eml").write_bytes(data)
    assert inbox(site, str(site.root / "a.eml"), "--yes") == 1
    assert "a.eml is no answer" in capsys.readouterr().err
    assert read_answers(site) == ()


@pytest.mark.parametrize(
    "data", [b"", b"\xff" * 100, b"Subject: =?utf-8?q?=ff?=\n\n\xff", b"Content-Type: a/b; charset=x\n\nx"]
)
def test_bytes_that_are_no_mail_are_no_answer(site: Site, data: bytes) -> None:
    with pytest.raises(NoAnswerError):
        mail_answer(data, site)


def test_answers_are_stored_with_yes_only_and_once(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    folder = site.root / "answers"
    folder.mkdir()
    question = choose(weeks.normal()).question_id
    (folder / "a.eml").write_bytes(mail(f"{question}: later", "What was done, or why not: \x1b[31mno time\n"))
    (folder / "b.eml").write_bytes(mail(f"{question}: not-possible", "", sender='"<b>\x1b[2J" <bea@shop.example>'))
    assert inbox(site, str(folder)) == 1  # control characters in the text of the first
    said = capsys.readouterr()
    assert "nothing was stored" in said.err
    assert "\x1b" not in said.out + said.err
    assert read_answers(site) == ()
    for _ in range(2):
        inbox(site, str(folder), "--yes")
    assert [a.kind for a in read_answers(site)] == ["not-possible"]
