"""What may be said of a logged change: one rule for the page, its log, its answers, the planner and `vsd compare`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from vsd_analytics.answer import Outcome, Reason
from vsd_analytics.stats.running_verdict import LAST_WEEKS, RunningVerdict

if TYPE_CHECKING:
    from vsd_analytics.figures.before_after import BeforeAfterFigure

WORKS_E: Final = 40.0
"""Evidence (e-value) from which it is said that a change works: twice that of a clear verdict. A site that logs a
change a month then reads it wrongly in fewer than one year of twenty (docs/methods/pages.md)."""
WORKS_WEEKS: Final = 8
"""Weeks from which on it is said: a broken machine, or a school holiday that one area feels, is over by then."""
MOSTLY_MOVED: Final = 0.5
"""A fall of which the rest of the floor took up this part has moved rather than gone."""


def outcome(figure: BeforeAfterFigure) -> tuple[Outcome, Reason | None]:
    """Return what may be said of a logged change of an area, and why a fall is not said to work.

    All of it follows from the running verdict beside areas that were left alone. A clear fall "works" after at least
    eight weeks, of which the last two hold half of it, with evidence of at least `WORKS_E`, nothing that speaks against
    the comparison, a whole floor that did not clearly rise, and where neither the rest of the floor rose by half of the
    area's fall, nor the two places that have most more beside the areas left alone have half of it. It "moved" where
    they have and one of them clearly rose. Else it "fell", or is "doubtful" where something speaks against it.
    """
    running = figure.running
    if figure.state == "ok" and figure.design == "alone":
        return "alone", None
    if figure.state != "ok" or running is None or running.value is None:
        return "too_early", None
    match running.verdict:
        case "clear_fall":
            return _of_a_fall(figure, running)
        case "clear_rise":
            return "rose", None
        case "about_same":
            return "about_same", None
        case _:
            return "cannot_tell", None


def _of_a_fall(figure: BeforeAfterFigure, running: RunningVerdict) -> tuple[Outcome, Reason | None]:
    floor = figure.floor
    is_shown = figure.is_credible and not figure.doubts and (running.e_value or 0.0) >= WORKS_E
    if not is_shown or floor is None or floor.net.verdict == "clear_rise":
        return "doubtful", None
    taken = figure.taken_up
    share = None if taken is None else taken.share
    if share is not None and share >= MOSTLY_MOVED and figure.risers:
        return "moved", None
    if share is None or share >= MOSTLY_MOVED or (floor.moved_elsewhere or 0.0) >= MOSTLY_MOVED:
        return "fell", Reason("logged_change.not_yet_gone")
    if not running.is_lasting:
        return "fell", Reason("logged_change.not_yet_lasting", n=LAST_WEEKS)
    if running.n_weeks < WORKS_WEEKS:
        return "fell", Reason("logged_change.not_yet_long", least=WORKS_WEEKS)
    return "works", None
