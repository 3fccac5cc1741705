"""What may be said of a logged change: the one rule, and the same answer on page, planner, command and in Python."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest

from vsd_analytics.answer import Reason
from vsd_analytics.figures.before_after import BeforeAfterFigure
from vsd_analytics.figures.change_outcome import outcome
from vsd_analytics.figures.change_verdicts import FloorEffect, Receiver
from vsd_analytics.stats.logged_change import TakenUp
from vsd_analytics.stats.net_effect import net_effect
from vsd_analytics.stats.running_verdict import no_verdict, running_verdict

REFERENCE = [0.1, -0.05, 0.02, 0.0, -0.1, 0.07, 0.01, -0.02, 0.05, -0.03, 0.0, -0.05]
FALL = [-0.7, -0.65, -0.72, -0.68, -0.7, -0.66, -0.71, -0.69]
NET = net_effect([[100.0, 104, 98, 101], [50.0, 52, 49, 51]], [70] * 4, [[50.0, 52, 48], [51.0, 50, 50]], [70] * 3)
ROSE = net_effect([[100.0, 101, 99, 100]], [70] * 4, [[300.0, 305, 298]], [70] * 3)
GONE = TakenUp(1.0, (0.1, 0.0), 0.1)
MOVED = TakenUp(1.0, (0.9, 0.0), 0.9)
RISER = (Receiver("aisle", "Aisle", 0.4, 0.2, 0.6),)


def figure(weeks: list[float] = FALL, **more: Any) -> BeforeAfterFigure:
    made = BeforeAfterFigure(
        1, datetime(2026, 10, 7, tzinfo=UTC), "Moved", "door", "Door", "ok", None, "beside",
        running=running_verdict(REFERENCE, weeks), floor=FloorEffect(NET, ("door", None), None, 0.0), taken_up=GONE,
    )  # fmt: skip
    return replace(made, **more)


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (figure(), "works"),
        (figure(FALL[:7]), "fell"),
        (figure([*FALL, -0.2, -0.25]), "fell"),
        (figure(taken_up=MOVED), "fell"),
        (figure(taken_up=MOVED, risers=RISER), "moved"),
        (figure(taken_up=None), "fell"),
        (figure(floor=FloorEffect(NET, ("door", None), None, 0.6)), "fell"),
        (figure(floor=FloorEffect(ROSE, ("door", None), None, 0.0)), "doubtful"),
        (figure(floor=None), "doubtful"),
        (figure(is_credible=False), "doubtful"),
        (figure(doubts=(Reason("logged_change.other_change", day="2026-10-09"),)), "doubtful"),
        (figure([-0.2, -0.15, -0.22, -0.18] * 2), "works"),
        (figure([-0.1, -0.05, -0.12, -0.01]), "cannot_tell"),
        (figure([0.0] * 9), "about_same"),
        (figure([0.6, 0.7, 0.65, 0.7]), "rose"),
        (figure(design="alone", running=None), "alone"),
        (figure(running=no_verdict(Reason("logged_change.week_after", days=0))), "too_early"),
        (figure(state="not_measurable"), "too_early"),
    ],
)
def test_what_may_be_said_of_a_change(made: BeforeAfterFigure, said: str) -> None:
    assert outcome(made)[0] == said


def test_works_needs_twice_the_evidence_of_a_clear_fall() -> None:
    running = running_verdict(REFERENCE, FALL)
    assert outcome(figure(running=replace(running, e_value=39.0)))[0] == "doubtful"
    assert outcome(figure(running=replace(running, e_value=41.0)))[0] == "works"


@pytest.mark.parametrize(
    ("made", "code"),
    [
        (figure(FALL[:7]), "long"),
        (figure([*FALL, -0.2, -0.25]), "lasting"),
        (figure([*FALL[:4], -0.2, -0.25]), "lasting"),
        (figure(taken_up=MOVED), "gone"),
        (figure(taken_up=None), "gone"),
    ],
)
def test_a_fall_says_why_it_is_not_said_to_work(made: BeforeAfterFigure, code: str) -> None:
    said, why = outcome(made)
    assert said == "fell"
    assert why is not None
    assert why.code == f"logged_change.not_yet_{code}"


def test_a_fall_to_nobody_lasts_while_nobody_comes() -> None:
    cleared = replace(running_verdict(REFERENCE, FALL), all_value=0.0, last_value=0.0)
    assert cleared.is_lasting
    assert not replace(cleared, last_value=0.4).is_lasting
