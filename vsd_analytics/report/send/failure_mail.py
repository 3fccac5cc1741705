"""The mail that says that services of a site failed, with the last lines that they printed."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from email.message import EmailMessage
from typing import Final

from vsd_analytics.errors import CONTROL
from vsd_analytics.report.pages.mail import message
from vsd_analytics.site.model import Site
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import speaking

MOST_LINES: Final = 60
LINE_MAX_CHARS: Final = 300


def failure_mail(
    site: Site, *, services: Sequence[str], printed: str, sender: str | None, to: Sequence[str], at: datetime
) -> EmailMessage:
    """Return a mail, of text alone, in the language of the site.

    Args:
        site: The site that the services belong to.
        services: Names of what failed, such as units of systemd.
        printed: What they printed last; of more than 60 lines, the last 60.
        sender: Address it comes from.
        to: Addresses it goes to.
        at: Aware instant of its `Date`.
    """
    lines = [CONTROL.sub(" ", line)[:LINE_MAX_CHARS] for line in printed.splitlines()[-MOST_LINES:]]
    names = ", ".join(CONTROL.sub(" ", name) for name in services)
    with speaking(site.language):
        text = say(
            "failed.text",
            site=site.name,
            names=names,
            lines="\n".join(lines) or say("failed.nothing_printed"),
            folder=site.root,
            starts=names.replace(",", ""),
        )
        subject = say("failed.subject", site=site.name, names=names)
    return message(name="failed", subject=subject, text=text, html=None, sender=sender, to=to, date=at)
