"""The card of the day as a page and as a mail: one column for a phone, no script, no request, no clock of its own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from email.message import EmailMessage

from markupsafe import Markup

from vsd_analytics.figures.today import Today, publishable
from vsd_analytics.report.draw.day_hours import day_hours
from vsd_analytics.report.pages import mail
from vsd_analytics.report.pages.week import policy_hash, rendered, shipped_style
from vsd_analytics.report.words.today import TodayWords, today_words
from vsd_analytics.site.model import Site
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say


@dataclass(frozen=True, slots=True, kw_only=True)
class TodayPage:
    """Everything the templates may use.

    Attributes:
        card: The words.
        title: Title of the window.
        at: The clock, for machines.
        style, style_hash: The page's only style, and its hash for the content security policy.
        chart: The hours as a drawing; empty without an open hour.
        has_missing, has_unusual: Marks of the chart to explain.
        is_made_up: The data are those of `vsd demo`.
    """

    card: TodayWords
    title: str
    at: datetime
    style: Markup
    style_hash: str
    chart: Markup
    has_missing: bool
    has_unusual: bool
    is_made_up: bool


def make_today_page(found: Today, site: Site, *, is_made_up: bool = False) -> TodayPage:
    """Return what the templates show, in the language in force; see `TodayPage`.

    Args:
        found: The numbers.
        site: The site.
        is_made_up: The data are those of `vsd demo`.
    """
    card = today_words(found, site)
    style = shipped_style("report.css") + shipped_style("today.css")
    days = {
        found.at.date() + timedelta(days=k): say(f"today.day_{name}") for k, name in enumerate(("today", "tomorrow"))
    }
    days[found.at.date() - timedelta(days=1)] = say("today.day_yesterday")
    unusual = {(row.day, row.hour) for row in found.unusual.rows}
    return TodayPage(
        card=card,
        title=say("today.title", site=site.name, day=fmt.date_short(found.at.date()), headline=card.headline),
        at=found.at,
        style=Markup(style),
        style_hash=policy_hash(style),
        chart=day_hours(
            publishable(found.hours, below=site.settings.mask_below),
            names=days,
            unusual=unusual,
            label=say("today.chart_label"),
        ),
        has_missing=any(h.is_over and h.violations is None for h in found.hours),
        has_unusual=bool(unusual),
        is_made_up=is_made_up,
    )


def today_html(page: TodayPage) -> str:
    """Return the card as one self-contained HTML file."""
    return re.sub(r"\n\s*\n+", "\n", rendered("today.html.j2", page))


def today_mail(
    page: TodayPage, *, sender: str | None = None, to: Sequence[str] = (), date: datetime | None = None
) -> EmailMessage:
    """Return the card as a mail: text, and the same words as HTML with inline styles.

    Args:
        page: The card.
        sender: Address it comes from; None = a draft.
        to: Addresses it goes to.
        date: Aware instant of its `Date`; None = the clock of the card.
    """
    return mail.message(
        name=page.at.date().isoformat(),
        subject=page.title,
        text=mail.filled("today_mail.txt.j2", page),
        html=mail.filled("today_mail.html.j2", page),
        sender=sender,
        to=to,
        date=date or page.at,
    )
