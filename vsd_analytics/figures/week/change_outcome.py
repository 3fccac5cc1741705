"""What may be said of a logged change: one rule for the page, its log, its answers and the planner."""

from __future__ import annotations

from typing import Final

from vsd_analytics.figures.week.model_sections import LoggedChangeEffect, Outcome

WORKS_E: Final = 40.0
"""Evidence (e-value) from which a page says that a change works: twice that of a clear verdict. A site that logs a
change a month then reads it wrongly in fewer than one year of twenty (docs/statistics.md, "A year of pages")."""
SURE: Final = 1.5
"""How much wider than printed the interval of the whole floor is taken before a page says that a change works, or that
its fall moved: about 3 standard errors. A page is read every week, and one chance in forty each week is too often."""
MOSTLY_MOVED: Final = 0.5
"""A fall of which the rest of the floor took up this part has moved rather than gone."""


def outcome(change: LoggedChangeEffect) -> Outcome:
    """Return what may be said of a logged change of an area.

    "works", "moved" and "fell" need a running verdict beside areas that were left alone: a clear fall with evidence of
    at least `WORKS_E`, nothing that speaks against the comparison, and a whole floor that did not clearly rise. What
    the rest of the floor took up follows from the net effect, and is as uncertain: the change works where the whole
    floor clearly fell too, it moved where even the low end of what others took up is most of it; else it "fell". Both
    need an interval of the floor that is `SURE` times as wide as the printed one.
    """
    running = change.running
    if change.state == "ok" and change.design == "alone":
        return "alone"
    if change.state != "ok" or running is None or running.change is None:
        return "too_early"
    match running.verdict:
        case "clear_fall":
            return _of_a_fall(change)
        case "clear_rise":
            return "rose"
        case "about_same":
            return "about_same"
        case _:
            return "cannot_tell"


def _of_a_fall(change: LoggedChangeEffect) -> Outcome:
    net, own = change.net, change.contribution or 0.0
    is_shown = change.is_credible and not change.doubts and (change.e_value or 0.0) >= WORKS_E
    if not is_shown or net is None or net.verdict == "clear_rise":
        return "doubtful"
    if net.change is None or net.change_lo is None or net.change_hi is None:
        return "fell"
    low, high = (net.change + SURE * (end - net.change) for end in (net.change_lo, net.change_hi))
    if own < 0 and (low - own) / -own >= MOSTLY_MOVED:
        return "moved"
    is_gone = net.verdict == "clear_fall" and high < 0 and (change.moved_elsewhere or 0.0) < MOSTLY_MOVED
    return "works" if is_gone else "fell"
