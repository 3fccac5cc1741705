"""The report's sentences on privacy: what is stored, since when, and what was deleted, from the store itself."""

from __future__ import annotations

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say


def privacy(report: WeekReport) -> str:
    """Return what is stored about people, until when, and what was deleted."""
    stored, rules = report.stored, report.rules
    key = "pseudonyms" if stored is None or stored.has_pseudonyms else "ids"
    said = [
        say(
            "about.privacy_text",
            numbers=say(f"about.privacy_{key}"),
            below=rules.mask_below,
            masked=fmt.masked(rules.mask_below),
        )
    ]
    if stored is not None and stored.first_day is not None:
        said.append(say("about.privacy_since", first=fmt.date_long(stored.first_day)))
        n, days = stored.n_overdue_days, rules.retention_days
        if n:
            said.append(say("about.privacy_overdue", plural=n, n=n, days=days))
        else:
            said.append(say("about.privacy_in_time", on=fmt.date_long(report.generated_at.date()), days=days))
    if stored is not None and stored.purged_before is not None and stored.purged_on is not None:
        before, on = fmt.date_long(stored.purged_before), fmt.date_long(stored.purged_on)
        said.append(say("about.privacy_purged", before=before, on=on))
    return " ".join(said)
