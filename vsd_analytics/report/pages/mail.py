"""The week as a mail: text, an HTML part of tables with inline styles, one small picture inside, the PDF attached.

For the reader it is the product, so it says what the first page says and no more. The same week gives the same bytes:
no clock, no random boundary, a Message-ID made from the content. Nothing is loaded from anywhere and nothing tells who
read it. Names from data are text: they can neither end a header nor begin a tag.
"""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from email.message import EmailMessage
from email.policy import SMTP
from email.utils import format_datetime
from typing import Any, Final

from vsd_analytics.errors import CONTROL
from vsd_analytics.report.draw.svg import RAMP_LIGHT
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.key_figures import Tile
from vsd_analytics.report.pages.single_figures import map_svg, to_png
from vsd_analytics.report.pages.spoken import in_its_words
from vsd_analytics.report.pages.week import Page, make_page, rendered
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say

PICTURE_MAX_BYTES: Final = 60_000
PICTURE_CID: Final = "map@vsd-analytics"
NOBODY: Final = "vsd-analytics@localhost.invalid"
SUBJECT_MAX_CHARS: Final = 180
_SIZES: Final = ((1120, 64), (1120, 32), (840, 32), (560, 64), (560, 32), (420, 32), (280, 16))


@dataclass(frozen=True, slots=True, kw_only=True)
class Attachment:
    """A file that goes with the mail.

    Attributes:
        name: File name.
        kind: Subtype of `application/`, such as pdf.
        data: Its bytes.
    """

    name: str
    kind: str
    data: bytes


@in_its_words
def make_mail(
    report: WeekReport,
    *,
    sender: str | None = None,
    to: Sequence[str] = (),
    subject: str | None = None,
    date: datetime | None = None,
    link: str | None = None,
    attachments: Sequence[Attachment] = (),
) -> EmailMessage:
    """Return the mail of a week.

    Args:
        report: The finished week.
        sender: Address it comes from; None = a draft, which mail programs open for writing.
        to: Addresses it goes to; empty = to be filled in.
        subject: None = site, week and headline.
        date: Aware instant of its `Date`; None = the report's own.
        link: Address of the HTML page, to be read in a browser; None = there is none.
        attachments: Files that go with it; the words of the mail name a PDF among them.

    Returns:
        A message whose every header and boundary follows from the arguments; `as_bytes()` is the `.eml` file.
    """
    page = make_page(report)
    picture = map_picture(report)
    words = _words(page, link=link, attachments=attachments, has_picture=picture is not None)
    text = filled("mail.txt.j2", words)
    html = filled("mail.html.j2", words)
    title = subject if subject is not None else _subject(page)
    return message(
        name=report.week.iso,
        subject=title,
        text=text,
        html=html,
        sender=sender,
        to=to,
        date=date or report.generated_at,
        picture=picture,
        attachments=attachments,
    )


def message(
    *,
    name: str,
    subject: str,
    text: str,
    html: str | None,
    sender: str | None,
    to: Sequence[str],
    date: datetime,
    picture: bytes | None = None,
    attachments: Sequence[Attachment] = (),
) -> EmailMessage:
    """Return a message whose every header and boundary follows from the arguments.

    Args:
        name: What the mail is about; begins its Message-ID.
        subject: Its subject.
        text: Its words as plain text.
        html: The same as HTML; None = text alone.
        sender: Address it comes from; None = a draft, which mail programs open for writing.
        to: Addresses it goes to; empty = to be filled in.
        date: Aware instant of its `Date`.
        picture: PNG that the HTML shows; None = none.
        attachments: Files that go with it.
    """
    title = one_line(subject)
    hashed = hashlib.blake2b(digest_size=16)
    for part in (title, text, html or "", sender or "", *to):
        hashed.update(f"{len(part)}:{part}".encode())
    identity = hashed.hexdigest()

    mail = EmailMessage(policy=SMTP)
    mail["Subject"] = title
    mail["From"] = sender or NOBODY
    if to:
        mail["To"] = ", ".join(to)
    mail["Date"] = format_datetime(date)
    mail["Message-ID"] = f"<{name}.{identity}@{(sender or NOBODY).rpartition('@')[2]}>"
    mail["Auto-Submitted"] = "auto-generated"
    if sender is None or not to:
        mail["X-Unsent"] = "1"
    mail.set_content(text, cte="quoted-printable")
    if html is not None:
        mail.add_alternative(html, subtype="html", cte="quoted-printable")
    if picture is not None:
        body = mail.get_body(("html",))
        assert isinstance(body, EmailMessage)
        body.add_related(picture, "image", "png", cid=f"<{PICTURE_CID}>", filename="map.png", disposition="inline")
    for each in attachments:
        mail.add_attachment(each.data, "application", each.kind, filename=each.name)
    for i, inner in enumerate(p for p in mail.walk() if p.is_multipart()):
        inner.set_boundary(f"=_{identity}.{i}")
    return mail


def as_bytes(mail: EmailMessage) -> bytes:
    """Return the mail as a file and as servers take it: lines end with CR LF."""
    return mail.as_bytes(policy=SMTP)


def map_picture(report: WeekReport, *, max_bytes: int = PICTURE_MAX_BYTES) -> bytes | None:
    """Return the week's first map as a PNG of few colours, smaller until it fits; None when the week has no map.

    Args:
        report: The finished week.
        max_bytes: Largest size.
    """
    svg = map_svg(report)
    if svg is None:
        return None
    data = b""
    for width_px, n_colours in _SIZES:
        data = _few_colours(to_png(svg, width_px=width_px), n_colours=n_colours)
        if len(data) <= max_bytes:
            return data
    raise AssertionError(f"a map of {_SIZES[-1][0]} px has {len(data)} bytes")


def one_line(text: str) -> str:
    """Return text that fits a header: no line end or control character, single spaces, not too long."""
    plain = " ".join(CONTROL.sub(" ", text).split())
    return plain if len(plain) <= SUBJECT_MAX_CHARS else plain[: SUBJECT_MAX_CHARS - 1].rstrip() + "…"


def _few_colours(png: bytes, *, n_colours: int) -> bytes:
    from PIL import Image

    with Image.open(io.BytesIO(png)) as image:
        reduced = image.convert("RGB").quantize(n_colours, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    out = io.BytesIO()
    reduced.save(out, "PNG", optimize=True)
    return out.getvalue()


def _subject(page: Page) -> str:
    site, week = page.report.site, page.report.week.number
    place = say("mail.subject_floor", site=site.name, floor=site.floor_name) if len(site.floors) > 1 else site.name
    return one_line(say("mail.subject", place=place, week=week, headline=page.story.headline))


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """What the two templates may use; they hold no word of their own.

    Attributes:
        page: The page of the week.
        title: Name of the document.
        span: Week and days.
        made_up: Says that the data are made up; empty when they are not.
        tiles: The two headline numbers.
        question: Heading of the question.
        asked: Heading of what earlier weeks asked.
        answer: How to answer the question; empty where it has no id.
        unit: Of the map.
        cid: Of the picture; None = there is no map.
        alt: Its text alternative.
        spots: Number and name of each spot marked on the map.
        ramp: Colour and words of each step of the map.
        more: Heading of what follows.
        link: Address of the page; None = none.
        read: Words of the link.
        page_line: The same as a line of text; empty for none.
        attached: What is attached, as sentences.
        footer: Lines below the rule.
    """

    page: Page
    title: str
    span: str
    made_up: str
    tiles: tuple[Tile, ...]
    question: str
    asked: str
    answer: str
    unit: str
    cid: str | None
    alt: str
    spots: tuple[tuple[int, str], ...]
    ramp: tuple[tuple[str, str], ...]
    more: str
    link: str | None
    read: str
    page_line: str
    attached: tuple[str, ...]
    footer: tuple[str, ...]


def _words(page: Page, *, link: str | None, attachments: Sequence[Attachment], has_picture: bool) -> Words:
    report = page.report
    week, rules = report.week.number, report.rules
    spots = page.maps[0].shown.spots if has_picture and page.has_spots else ()
    named = "; ".join(say("where.label_spot", number=s.number, name=s.name) for s in spots)
    archives = [a.name for a in attachments if a.kind == "zip"]
    pdf = [say("mail.pdf")] if any(a.kind == "pdf" for a in attachments) else []
    return Words(
        page=page,
        title=say("page.title", site=report.site.name, week=week, headline=page.story.headline),
        span=say("mail.span", week=week, first=page.span[0], last=page.span[1]),
        made_up=say("page.made_up") if report.provenance.is_made_up else "",
        tiles=tuple(t for t in page.tiles if t.is_large)[:2],
        question=say("question.title"),
        asked=say("asked.title"),
        answer=say("asked.how_mail", id=page.story.question_id) if page.story.question_id else "",
        unit=say("mail.unit_unseen" if has_picture and page.maps[0].shown.unseen else "mail.unit"),
        cid=PICTURE_CID if has_picture else None,
        alt=say("mail.map_spots" if spots else "mail.map", title=page.titles["where"], spots=named),
        spots=tuple((s.number, s.name) for s in spots),
        ramp=tuple((colour, step.text) for colour, step in zip(RAMP_LIGHT, page.heat_legend, strict=True)),
        more=say("mail.more"),
        link=link,
        read=say("mail.read"),
        page_line=say("mail.page", link=link) if link else "",
        attached=(*pdf, *(say("mail.archive", name=name) for name in archives)),
        footer=(
            say("mail.violation", distance=page.distance, time=fmt.seconds(rules.episode_min_s)),
            say("mail.ranges", confidence=fmt.percent(rules.confidence), share=fmt.percent(report.coverage.share)),
            say("mail.made_by", version=report.provenance.version),
        ),
    )


def filled(template: str, words: Any) -> str:
    """Return a template of a mail filled with the fields of a dataclass; text has no control characters."""
    text = rendered(template, words)
    if template.endswith(".txt.j2"):
        return CONTROL.sub(" ", text.replace("\n", "\t")).replace("\t", "\n")
    return re.sub(r"\n\s*\n+", "\n", text)
