"""What `vsd flow` prints of links over floor where nobody is followed: estimates, apart from the flow that was seen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from vsd_analytics.cli.estimates import share_dict, share_text
from vsd_analytics.cli.output import rounded, table
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.figures.links import Links


def links_dict(of: Links) -> dict[str, Any]:
    """Return links as the JSON output has them: shares only, as counts of pairs are no counts of people."""
    found = [
        {
            "from_area_id": link.origin.area_id,
            "to_area_id": link.to.area_id,
            "share": share_dict(link.share),
            "is_estimated": True,
        }
        for link in of.found
    ]
    printed: dict[str, Any] = rounded({"found": found, "recorded_share": of.recorded_share})
    return printed


def link_lines(of: Links) -> list[str]:
    """Return the lines of the text output, an empty one first; none without a link."""
    if not of.found:
        return []
    rows = [("from", "to", "share of those who leave")]
    rows += [
        (link.origin.name, link.to.name, share_text(link.share, missing=reason_text(link.share.reason)))
        for link in of.found
    ]
    return [
        "",
        "Estimated over floor where nobody is followed, by time and walking speed; in no share above",
        *table(rows),
        f"of the {of.recorded_share:.0%} of the opening hours in which all cameras recorded; stops unseen are missing",
    ]
