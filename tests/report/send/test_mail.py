"""The mail: what the first page says, safe in every header, the same bytes each time, nothing loaded from anywhere."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from datetime import datetime, timedelta
from email import message_from_bytes, policy
from email.message import EmailMessage
from html.parser import HTMLParser
from typing import Any, cast

import pytest
from forbidden_words import forbidden_in
from PIL import Image
from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.mail import PICTURE_MAX_BYTES, Attachment, as_bytes, make_mail, map_picture
from vsd_analytics.report.pages.week import make_page
from vsd_analytics.wording import catalogue

ALL = {**weeks.ALL, **sections.MORE}
PARTIES: dict[str, Any] = {"sender": "reports@example.org", "to": ("manager@example.org",)}
PDF = Attachment(name="2026-W46.pdf", kind="pdf", data=b"%PDF-1.4 %%EOF")
INJECTED = "Shop\r\nBcc: thief@example.org\r\n\r\n<script>alert(1)</script>\u202e\x00"


@pytest.fixture(autouse=True)
def _any_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw a dot in place of the map: drawing maps takes time, and has tests of its own below."""
    out = io.BytesIO()
    Image.new("RGB", (4, 3), "white").save(out, "PNG")
    monkeypatch.setattr(
        "vsd_analytics.report.pages.mail.map_picture", lambda report: out.getvalue() if report.maps else None
    )


def read(report: WeekReport, **more: Any) -> EmailMessage:
    """Return the mail as a reader's program parses it."""
    return cast(
        EmailMessage, message_from_bytes(as_bytes(make_mail(report, **(PARTIES | more))), policy=policy.default)
    )


def part(mail: EmailMessage, kind: str) -> str:
    body = mail.get_body((kind,))
    assert body is not None
    return str(body.get_content())


class Tags(HTMLParser):
    """Collects elements with their attributes, and what is read."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.words = ""
        self._is_style = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {k: v or "" for k, v in attrs}))
        self._is_style = tag == "style"

    def handle_endtag(self, tag: str) -> None:
        self._is_style = False

    def handle_data(self, data: str) -> None:
        if not self._is_style:
            self.words += f" {data}"


@pytest.mark.parametrize("name", list(ALL))
def test_both_parts_of_every_week_say_headline_things_and_question(name: str) -> None:
    report = ALL[name]()
    page = make_page(report)
    mail = read(report, attachments=(PDF,), link="https://intranet.example.org/d/2026-W46.html")
    for said in (part(mail, "plain"), Tags(part(mail, "html")).words):
        squeezed = re.sub(r"\W+", "", said).casefold()
        story = page.story
        things = [w for t in story.things for w in (t.title, t.text)]
        lead = "".join(s.text for s in story.lead)
        for wanted in (story.headline, lead, *things, story.question, *story.notes, *(t.value for t in page.tiles[:2])):
            assert re.sub(r"\W+", "", wanted).casefold() in squeezed, wanted
        assert forbidden_in(said) == []
    assert "https://intranet.example.org/d/2026-W46.html" in part(mail, "plain")


@pytest.mark.parametrize("name", list(ALL))
def test_every_number_of_the_mail_is_on_the_page(name: str) -> None:
    from vsd_analytics.report.pages.week import render_html

    def numbers(text: str) -> set[str]:
        return set(re.findall(r"\d[\d,.:]*\d|\d", text))

    report = ALL[name]()
    page = numbers(Tags(render_html(report)).words)
    for kind in ("plain", "html"):
        said = part(read(report), kind)
        assert numbers(Tags(said).words if kind == "html" else said) <= page


@pytest.mark.parametrize("name", list(ALL))
def test_the_html_is_tables_with_inline_styles_and_loads_nothing(name: str) -> None:
    html = part(read(ALL[name](), link="https://intranet.example.org/d/w.html"), "html")
    found = Tags(html).tags
    kinds = {tag for tag, _ in found}
    assert kinds <= {
        *(
            "html",
            "head",
            "meta",
            "title",
            "style",
            "body",
            "table",
            "tr",
            "td",
            "h1",
            "h2",
            "div",
            "b",
            "br",
            "a",
            "img",
        )
    }
    assert sum(tag == "h1" for tag, _ in found) == 1
    for tag, attributes in found:
        assert not {a for a in attributes if a.startswith("on") or a in ("srcset", "background", "action")}
        if tag == "img":
            assert attributes["src"].startswith("cid:")
            assert attributes["alt"]
            assert attributes["width"]
        if tag == "a":
            assert attributes["href"] == "https://intranet.example.org/d/w.html"
        if tag == "table":
            assert attributes["role"] == "presentation"
        if tag in ("td", "div", "h1", "h2") and "mut" in attributes.get("class", "").split():
            assert "color:" in attributes["style"], attributes
    assert not re.search(r"url\(|@import|@font-face|position:|display:\s*(flex|grid)", html)
    assert len(html.encode()) < 100_000  # what is longer is cut off by some programs


def test_parts_are_nested_as_mail_programs_expect() -> None:
    mail = read(weeks.normal(), attachments=(PDF, Attachment(name="2026-W46.zip", kind="zip", data=b"PK")))
    kinds = [p.get_content_type() for p in mail.walk()]
    assert kinds == [
        *("multipart/mixed", "multipart/alternative", "text/plain", "multipart/related", "text/html", "image/png"),
        *("application/pdf", "application/zip"),
    ]
    [picture] = [p for p in mail.walk() if p.get_content_type() == "image/png"]
    assert f"cid:{str(picture['Content-ID'])[1:-1]}" in part(mail, "html")
    assert [a.get_filename() for a in mail.iter_attachments()] == ["2026-W46.pdf", "2026-W46.zip"]
    for inner in mail.walk():
        if not inner.is_multipart():
            assert inner["Content-Transfer-Encoding"] in ("quoted-printable", "base64")
    assert max(len(line) for line in as_bytes(make_mail(weeks.normal(), **PARTIES)).split(b"\r\n")) <= 998


def test_without_a_map_there_is_no_picture() -> None:
    mail = read(weeks.ALL["no_data"]())
    assert "image/png" not in [p.get_content_type() for p in mail.walk()]
    assert "cid:" not in part(mail, "html")


@pytest.mark.parametrize("field", ["site", "floor", "subject", "headline"])
def test_no_name_ends_a_header(field: str) -> None:
    report = weeks.normal()
    more: dict[str, Any] = {}
    match field:
        case "site":
            report = replace(report, site=replace(report.site, name=INJECTED))
        case "floor":
            site = replace(report.site, floor_name=INJECTED, floors=("ground", "first"))
            report = replace(report, site=site)
        case "headline":
            story = make_page(report).story
            report = replace(report, story=replace(story, headline=INJECTED))
        case _:
            more["subject"] = INJECTED
    data = as_bytes(make_mail(report, **PARTIES, **more))
    head, _, _ = data.partition(b"\r\n\r\n")
    assert not re.search(rb"(?im)^bcc:", head)
    mail = message_from_bytes(data, policy=policy.default)
    assert mail["Bcc"] is None
    assert mail["To"] == "manager@example.org"
    assert "thief@example.org" in mail["Subject"]
    assert not re.search(r"[\x00-\x1f\u202e]", mail["Subject"])
    assert "<script" not in part(cast(EmailMessage, mail), "html")


def test_names_are_escaped_and_stay_one_line_in_the_text() -> None:
    mail = read(weeks.hostile())
    tags = {tag for tag, _ in Tags(part(mail, "html")).tags}
    assert not tags & {"script", "iframe", "svg"}
    assert [a["src"][:4] for tag, a in Tags(part(mail, "html")).tags if tag == "img"] == ["cid:"]
    report = replace(weeks.normal(), site=replace(weeks.normal().site, name="Shop\n.\nQUIT\n"))
    assert not re.search(r"(?m)^\.$|^QUIT$", part(read(report), "plain"))


def test_the_same_week_is_the_same_mail() -> None:
    one, two = (as_bytes(make_mail(weeks.normal(), **PARTIES, attachments=(PDF,))) for _ in range(2))
    assert one == two
    assert len(set(re.findall(rb'boundary="([^"]*)"', one))) == 3


def test_the_message_id_follows_the_words_and_not_the_clock() -> None:
    report = weeks.normal()
    plain = make_mail(report, **PARTIES)
    later = make_mail(report, **PARTIES, date=report.generated_at + timedelta(days=1))
    assert later["Message-ID"] == plain["Message-ID"]
    assert later["Date"] != plain["Date"]
    assert datetime.strptime(str(plain["Date"]), "%a, %d %b %Y %H:%M:%S %z") == report.generated_at.replace(
        microsecond=0
    )
    others = [
        make_mail(weeks.ALL["empty"](), **PARTIES),
        make_mail(report, **(PARTIES | {"to": ("other@example.org",)})),
        make_mail(report, **PARTIES, subject="Another"),
    ]
    assert len({str(m["Message-ID"]) for m in (plain, *others)}) == 4
    assert re.fullmatch(r"<2026-W46\.[0-9a-f]{32}@example\.org>", str(plain["Message-ID"]))


def test_a_draft_says_so_and_a_mail_does_not() -> None:
    assert make_mail(weeks.normal())["X-Unsent"] == "1"
    assert make_mail(weeks.normal(), sender="a@example.org")["X-Unsent"] == "1"
    sent = make_mail(weeks.normal(), **PARTIES)
    assert sent["X-Unsent"] is None
    assert sent["Auto-Submitted"] == "auto-generated"


def test_the_subject_is_cut_before_it_is_too_long() -> None:
    mail = make_mail(weeks.normal(), **PARTIES, subject="word " * 200)
    assert len(str(mail["Subject"])) <= 180
    assert str(mail["Subject"]).endswith("…")


@pytest.mark.parametrize("name", ["normal", "hostile", "always_open_picture"])
def test_the_picture_is_small_and_sharp(name: str) -> None:
    data = map_picture(ALL[name]())
    assert data is not None
    assert len(data) <= PICTURE_MAX_BYTES
    with Image.open(io.BytesIO(data)) as image:
        assert image.width >= 534


def test_a_picture_that_is_too_large_becomes_smaller() -> None:
    full, less = map_picture(weeks.normal()), map_picture(weeks.normal(), max_bytes=8000)
    assert full is not None
    assert less is not None
    assert len(less) <= 8000 < len(full)


def test_a_mail_of_another_language_has_no_word_of_this_one(monkeypatch: pytest.MonkeyPatch) -> None:
    real = catalogue.template
    monkeypatch.setattr(catalogue, "template", lambda key, /, plural=None: f"⟦{real(key, plural=plural)}⟧")
    mail = read(weeks.ALL["no_data"](), attachments=(PDF,), link="https://x.example/w.html")
    for text in (part(mail, "plain"), Tags(part(mail, "html")).words):
        said = re.sub(r"\s+", " ", text)
        fewer = ""
        while fewer != said:
            fewer, said = said, re.sub(r"⟦[^⟦⟧]*⟧", "", said)
        report = weeks.ALL["no_data"]()
        names = [report.site.name, report.site.floor_name, *(c.name for c in report.coverage.cameras)]
        assert set(re.findall(r"[A-Za-z]{3,}", re.sub("|".join(map(re.escape, names)), "", said))) == set()
