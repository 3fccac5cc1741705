"""The site's planned experiments: what a change is expected to do, one JSON object a line in `plans.jsonl`.

A plan is written before the change and never altered: what it predicts is scored afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from typing import Any, Final

import msgspec

from vsd_analytics.config.append_only import AppendOnlyFile
from vsd_analytics.site.model import Site

FILE: Final = "plans.jsonl"


@dataclass(frozen=True, slots=True)
class DaysInTurn:
    """Days with and without a change in turn.

    Attributes:
        seed: Of the coins.
        pairs: Day with the change and day without it, of one weekday in two successive weeks.
    """

    seed: int
    pairs: tuple[tuple[date, date], ...]

    def __post_init__(self) -> None:
        """Refuse what is no such calendar: ValueError, which a reader of the file sees as its line's fault."""
        days = [day for pair in self.pairs for day in pair]
        if not days:
            raise ValueError("there are no days in turn")
        if len(set(days)) < len(days):
            raise ValueError("a day stands in it twice")
        if any(abs((one - other).days) != 7 for one, other in self.pairs):
            raise ValueError("the two days of a pair are not a week apart")


@dataclass(frozen=True, slots=True)
class Plan:
    """A planned experiment.

    Attributes:
        made: Local day it was made on.
        area: Id of the area that is to be changed.
        effect: Effect looked for, relative: -0.15 = 15 % less time too close per open hour.
        power: Chance of a clear verdict asked for.
        first, last: Days from which the site's variation was taken.
        weeks_before: Reference weeks the plan counts on.
        weeks_after: Weeks after the change; None = even the most allowed are not enough.
        power_then: Chance of a clear verdict by then.
        theta_lo, theta_hi: Where the measured ratio will lie in 95 of 100 cases if the effect is as planned.
        compared_with: Ids of the comparison areas.
        in_turn: Days with and without the change over `weeks_after` weeks; None = the change is there for good.
    """

    made: date
    area: str
    effect: float
    power: float
    first: date
    last: date
    weeks_before: int
    weeks_after: int | None
    power_then: float
    theta_lo: float
    theta_hi: float
    compared_with: tuple[str, ...]
    in_turn: DaysInTurn | None = None


def read_plans(site: Site) -> tuple[Plan, ...]:
    """Return the plans in the order in which they were made.

    Raises:
        InputError: E110, a line is not a plan.
    """
    return PLANS.read(site)


def add_plan(site: Site, plan: Plan) -> bool:
    """Add a plan, durably: it is on disk when this returns. Returns False where the same plan is there already.

    Raises:
        InputError: E110, a line of the file is not a plan; nothing is written.
        DiskError: E304 to E306, the disk refused.
    """
    return PLANS.add(site, plan)


def plan_dict(plan: Plan) -> dict[str, Any]:
    """Return a plan as it is written in the file."""
    written: dict[str, Any] = msgspec.to_builtins(plan)
    return {k: v for k, v in written.items() if k != "in_turn" or v is not None}


PLANS: Final = AppendOnlyFile(
    FILE, Plan, written=plan_dict, what="a plan", fix="vsd plan --area ID --effect -0.15 makes a new plan"
)
