"""Tables that may leave the operator's hands: small counts are held back, and what would tell them with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from vsd_analytics.report.privacy import is_small

if TYPE_CHECKING:
    import pandas as pd

_PEOPLE = ("person_records", "exposure_s")
_VIOLATIONS = ("violation_records", "n_violations", "violation_s")


def shared_hours(frame: pd.DataFrame, *, below: int) -> pd.DataFrame:
    """Return the hourly table with counts of 1 to `below` - 1 held back.

    A small count of violations takes the other figures about violations of its row with it, a small count of people all
    of them; zeros stay. Exposure of areas is left out, as nobody knows how few people it was.

    Args:
        frame: As `warehouse.figures.hours` returns it.
        below: Counts from here on are shown (`mask_below`).

    Returns:
        The same rows, with a column `masked`; what is held back is missing.
    """
    frame = frame.copy() if "person_records" in frame else frame.drop(columns="exposure_s")
    few_people = _is_any_small(frame, ("person_records",), below=below)
    few_violations = few_people | _is_any_small(frame, ("violation_records", "n_violations"), below=below)
    is_masked = few_people & False
    for columns, is_few in ((_PEOPLE, few_people), (_VIOLATIONS, few_violations)):
        for column in (c for c in columns if c in frame):
            is_held = is_few & (frame[column].fillna(0) > 0)
            frame[column] = frame[column].mask(is_held)
            is_masked |= is_held
    return frame.assign(masked=is_masked)


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
