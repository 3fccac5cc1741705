"""The site's planned experiments: what a change is expected to do, one JSON object a line in `plans.jsonl`.

A plan is written before the change and never altered: what it predicts is scored afterwards.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any, Final

import msgspec

from vsd_analytics.errors import InputError, Where
from vsd_analytics.site.model import Site

FILE: Final = "plans.jsonl"
LOCK: Final = Path("status") / "plans.lock"


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
    return tuple(_plan(line, number=n) for n, line in _lines(site))


def add_plan(site: Site, plan: Plan) -> bool:
    """Add a plan, durably: it is on disk when this returns. Returns False where the same plan is there already.

    The file is replaced as a whole, under a lock, so that it holds all of the plan or nothing.

    Raises:
        InputError: E110, a line of the file is not a plan; nothing is written.
        DiskError: E304 to E306, the disk refused.
    """
    from vsd_analytics.store.durable import exclusive, publish, sweep_temporaries

    path = (site.root / FILE).resolve()  # what a link points to
    with exclusive(site.root / LOCK):
        sweep_temporaries(path.parent, file_name=path.name)
        if plan in read_plans(site):
            return False
        lines = [line for _, line in _lines(site)]
        publish(path, b"".join(line + b"\n" for line in [*lines, json.dumps(plan_dict(plan)).encode()]))
    return True


def plan_dict(plan: Plan) -> dict[str, Any]:
    """Return a plan as it is written in the file."""
    written: dict[str, Any] = msgspec.to_builtins(plan)
    return {k: v for k, v in written.items() if k != "in_turn" or v is not None}


def _lines(site: Site) -> list[tuple[int, bytes]]:
    path = site.root / FILE
    if not path.exists():
        return []
    return [(n, line) for n, line in enumerate(path.read_bytes().split(b"\n"), start=1) if line.strip()]


def _plan(line: bytes, *, number: int) -> Plan:
    try:
        return msgspec.json.decode(line, type=Plan)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise InputError(
            f"line {number} of {FILE} is not a plan",
            code="E110",
            where=Where(FILE, number, line.decode(errors="replace")[:200]),
            why=str(error),
            fix="correct or delete the line; vsd plan --area ID --effect -0.15 makes a new plan",
        ) from None
