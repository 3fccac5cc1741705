"""What may be said of a logged change: one rule for the page, its log, its answers, the planner and `vsd compare`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from vsd_analytics.answer import Outcome

if TYPE_CHECKING:
    from vsd_analytics.figures.before_after import BeforeAfterFigure

WORKS_E: Final = 40.0
"""Evidence (e-value) from which it is said that a change works: twice that of a clear verdict. A site that logs a
change a month then reads it wrongly in fewer than one year of twenty (docs/statistics.md, "A year of pages")."""
WORKS_WEEKS: Final = 4
"""Weeks from which on it is said: a broken machine or a short holiday is over by then."""
MOSTLY_MOVED: Final = 0.5
"""A fall of which the rest of the floor took up this part has moved rather than gone."""


def outcome(found: BeforeAfterFigure) -> Outcome:
    """Return what may be said of a logged change of an area.

    All of it follows from the running verdict beside areas that were left alone. A clear fall "works" after at least
    four weeks, with evidence of at least `WORKS_E`, nothing that speaks against the comparison, a whole floor that did
    not clearly rise, and where neither the rest of the floor rose by half of the area's fall, nor the two places that
    have most more beside the areas left alone have half of it. It "moved" where they have and one of them clearly rose.
    Else it "fell", or is "doubtful" where something speaks against it.
    """
    running = found.running
    if found.state == "ok" and found.design == "alone":
        return "alone"
    if found.state != "ok" or running is None or running.value is None:
        return "too_early"
    match running.verdict:
        case "clear_fall":
            return _of_a_fall(found, running.e_value or 0.0, running.n_weeks)
        case "clear_rise":
            return "rose"
        case "about_same":
            return "about_same"
        case _:
            return "cannot_tell"


def _of_a_fall(found: BeforeAfterFigure, e_value: float, n_weeks: int) -> Outcome:
    floor = found.floor
    is_shown = found.is_credible and not found.doubts and e_value >= WORKS_E
    if not is_shown or floor is None or floor.net.verdict == "clear_rise":
        return "doubtful"
    taken = found.taken_up
    share = None if taken is None else taken.share
    if share is not None and share >= MOSTLY_MOVED and found.risers:
        return "moved"
    is_gone = share is not None and share < MOSTLY_MOVED and (floor.moved_elsewhere or 0.0) < MOSTLY_MOVED
    return "works" if is_gone and n_weeks >= WORKS_WEEKS else "fell"
