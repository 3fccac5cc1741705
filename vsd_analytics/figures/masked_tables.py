"""Tables that may leave the operator's hands: small counts are held back, and what would tell them with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import TYPE_CHECKING

import numpy as np

from vsd_analytics.figures.operator_counts import local_iso
from vsd_analytics.figures.share.counts import held_back, is_small
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.warehouse.warehouse import Warehouse

if TYPE_CHECKING:
    import pandas as pd

_PEOPLE = ("person_records", "exposure_s")
_VIOLATIONS = ("violation_records", "n_violations", "violation_s")


@dataclass(frozen=True, slots=True)
class ReportsHold:
    """What the weekly reports of some days hold back.

    Attributes:
        hours: Local starts of hours, as in the table.
        areas: First day of the week, floor, area (None: the rest of the floor).
    """

    hours: frozenset[str] = frozenset()
    areas: frozenset[tuple[date, str, str | None]] = frozenset()


def reports_hold(warehouse: Warehouse) -> ReportsHold:
    """Return what the reports hold back of the weeks of a warehouse, which is opened over whole weeks."""
    hours: set[str] = set()
    areas: set[tuple[date, str, str | None]] = set()
    for floor in warehouse.site.floors:
        for k in range(((warehouse.last - warehouse.first).days + 1) // 7):
            data = WeekData(warehouse, floor=floor, monday=warehouse.first + timedelta(weeks=k))
            starts = data.hours.start_ms
            hours |= {local_iso(warehouse, int(starts[i])) for i in data.hidden.hours.small | data.hidden.hours.others}
            of_week = data.hidden.places.small | data.hidden.places.others
            areas |= {(data.monday, floor.floor_id, area_id) for area_id in of_week}
    return ReportsHold(frozenset(hours), frozenset(areas))


def shared_hours(frame: pd.DataFrame, *, below: int, reports: ReportsHold | None = None) -> pd.DataFrame:
    """Return the hourly table with counts of 1 to `below` - 1 held back.

    A small count of violations takes the other figures about violations of its row with it, a small count of people all
    of them; zeros stay. What the weekly report holds back is held back here, too; by camera or area, so are the counts
    of the same hour, and of the same camera or area and week, that would tell a small one. Exposure of areas is left
    out, as nobody knows how few people it was.

    Args:
        frame: As `warehouse.figures.hours` returns it.
        below: Counts from here on are shown (`mask_below`).
        reports: What the reports of these weeks hold back; None = nothing.

    Returns:
        The same rows, with a column `masked` for small counts and what goes with them, and a column `held_back` for
        others that would tell them; what is held back is missing.
    """
    frame = frame.copy() if "person_records" in frame else frame.drop(columns="exposure_s")
    few_people = _is_any_small(frame, ("person_records",), below=below)
    few_violations = few_people | _is_any_small(frame, ("violation_records", "n_violations"), below=below)
    others = few_people & False if reports is None else _others(frame, few_violations, reports, below=below)
    is_masked, is_other = few_people & False, few_people & False
    for columns, is_few, reveals in (
        (_PEOPLE, few_people, few_people & False),
        (_VIOLATIONS, few_violations, others & ~few_violations),
    ):
        for column in (c for c in columns if c in frame):
            is_any = frame[column].fillna(0) > 0
            is_masked |= is_few & is_any
            is_other |= reveals & is_any
            frame[column] = frame[column].mask((is_few | reveals) & is_any)
    return frame.assign(masked=is_masked, held_back=is_other)


def _others(frame: pd.DataFrame, few: pd.Series[bool], reports: ReportsHold, *, below: int) -> pd.Series[bool]:
    """Return the rows held back beside small ones: the reports' own, then what sums would tell."""
    days = [date.fromisoformat(start[:10]) for start in frame["start"]]
    weeks = [day - timedelta(days=day.weekday()) for day in days]
    parts = [c for c in ("camera_id", "floor_id", "area_id") if c in frame]
    named = frame[parts].astype(object).where(frame[parts].notna(), None)
    names = list(named.itertuples(index=False, name=None))
    starts = frame["start"].tolist()
    chosen = {row for row, is_few in enumerate(few) if is_few or starts[row] in reports.hours}
    if not parts:
        return few | np.isin(np.arange(len(frame)), list(chosen))
    chosen |= {row for row, at in enumerate(zip(weeks, names, strict=True)) if (at[0], *at[1]) in reports.areas}
    counts = dict(enumerate(frame["n_violations"].fillna(0).astype(int)))
    groups: dict[object, list[int]] = {}
    for row, (start, week, name) in enumerate(zip(starts, weeks, names, strict=True)):
        groups.setdefault(start, []).append(row)
        groups.setdefault((week, name), []).append(row)
    size = -1
    while size != len(chosen):
        size = len(chosen)
        for rows in groups.values():
            of_group = {row: counts[row] for row in rows}
            first = next((row for row in rows if is_small(counts[row], below=below)), rows[0])
            give = sorted(rows, key=lambda row: (row not in chosen, abs(row - first)))
            n_small = sum(is_small(n, below=below) for n in of_group.values())
            n_chosen = sum(row in chosen for row in rows if counts[row] >= below)
            # a count that is held back alone in its hour, or in its week, is the rest of the sum
            n_others = max(n_chosen, 2 - n_small) if n_small + n_chosen else 0
            held = held_back(of_group, below=below, give=give, n_others=n_others)
            chosen |= held.small | held.others
    return few | np.isin(np.arange(len(frame)), list(chosen))


def _is_any_small(frame: pd.DataFrame, columns: Sequence[str], *, below: int) -> pd.Series[bool]:
    """Return the rows in which any of some counts is small."""
    import pandas as pd

    found = pd.Series(False, index=frame.index)
    for column in (c for c in columns if c in frame):
        found |= frame[column].fillna(0).map(lambda n: is_small(n, below=below)).astype(bool)
    return found


def shared_cells(frame: pd.DataFrame, *, below: int) -> pd.DataFrame:
    """Return the cells of a heatmap in which something was counted, counts of 1 to `below` - 1 held back.

    Cells in which people only stood, and how long, are left out: a single path would show.

    Args:
        frame: As `warehouse.figures.heatmap` returns it.
        below: Counts from here on are shown (`mask_below`).

    Returns:
        Columns cx, cy, records (missing where held back), masked.
    """
    found = frame[frame["records"] > 0][["cx", "cy", "records"]].astype({"records": "Int64"})
    held = _is_any_small(found, ("records",), below=below)
    return found.assign(records=found["records"].mask(held), masked=held)
