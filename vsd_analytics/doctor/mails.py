"""Checks of `vsd doctor` on the weekly mail: whether the last week reached everybody it is meant for."""

from __future__ import annotations

import re
from collections.abc import Iterator

from vsd_analytics.doctor.finding import NEEDS_YOU, Finding
from vsd_analytics.report.send.sent_mails import FILE, FOLDER, last_steps
from vsd_analytics.site.model import Site

_WEEK = re.compile(r"\d{4}-W\d\d")


def examine_mails(site: Site) -> Iterator[Finding]:
    """Yield a finding on the newest mailed week, and on a page made since that was not mailed.

    Nothing is yielded where `[mail]` names nobody.
    """
    if site.mail is None or not site.mail.to:
        return
    meant = {address.casefold() for address in site.mail.to}
    steps = last_steps(site.root / FOLDER / FILE)
    mailed = max((week for _, week, _ in steps if _WEEK.fullmatch(week)), default="")
    pages = (_WEEK.match(path.name) for path in (site.root / "reports").glob("*-W*.html"))
    newest = max((page[0] for page in pages if page is not None), default="")
    left = {to for (_, week, to), step in steps.items() if week == mailed and step != "sent" and to in meant}
    if left:
        fix = f"vsd report --week {mailed} --mail --send; it says why not"
        yield Finding("mail", NEEDS_YOU, f"{mailed} is not known to have reached {', '.join(sorted(left))}", fix)
    elif newest > mailed:
        fix = f"vsd report --week {newest} --mail --send; a timer mails with VSD_REPORT in /etc/vsd (docs/timers.md)"
        yield Finding("mail", "note", f"the page of {newest} was made and not mailed", fix)
    elif mailed:
        yield Finding("mail", "ok", f"{mailed} was sent to everybody")
