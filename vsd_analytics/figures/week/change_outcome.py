"""What may be said of a logged change: one rule for the page, its ledger, its answers and the planner."""

from __future__ import annotations

from typing import Final

from vsd_analytics.figures.week.model_sections import Outcome, Redesign

WORKS_E: Final = 40.0
"""Evidence (e-value) from which a page says that a change works: twice that of a clear verdict. A site that logs a
change a month then reads it wrongly in fewer than one year of twenty (docs/statistics.md, "A year of pages")."""
MOSTLY_MOVED: Final = 0.5
"""A fall of which the rest of the floor took up this part has moved rather than gone."""


def outcome(change: Redesign) -> Outcome:
    """Return what may be said of a logged change of an area.

    "works" and "moved" need a running verdict beside areas that were left alone: a clear fall with evidence of at least
    `WORKS_E`, nothing that speaks against the comparison, and a whole floor that did not clearly rise. "moved" is such
    a fall of which the rest of the floor took up most.
    """
    running = change.running
    if change.state == "ok" and change.design == "alone":
        return "alone"
    if change.state != "ok" or running is None or running.change is None:
        return "too_early"
    match running.verdict:
        case "clear_fall" if _is_shown(change):
            return "moved" if (change.moved_elsewhere or 0.0) >= MOSTLY_MOVED else "works"
        case "clear_fall":
            return "doubtful"
        case "clear_rise":
            return "rose"
        case "about_same":
            return "about_same"
        case _:
            return "cannot_tell"


def _is_shown(change: Redesign) -> bool:
    """Tell whether a clear fall beside other areas may be laid to the change."""
    return (
        change.is_credible
        and not change.doubts
        and (change.e_value or 0.0) >= WORKS_E
        and change.net is not None
        and change.net.verdict != "clear_rise"
    )
