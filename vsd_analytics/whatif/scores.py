"""How predictions came out: the running verdict of the logged change that names a receipt, against its range."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.config.change_log import read_log
from vsd_analytics.config.predictions import LayoutPrediction
from vsd_analytics.figures.before_after import BeforeAfterFigure, before_after
from vsd_analytics.figures.change_weeks import days_needed
from vsd_analytics.figures.values import known
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.warehouse import Warehouse

DUE_WEEKS: Final = 4
"""Weeks after the change from which a prediction is scored."""
PREDICTIONS: Final = (
    Column("number", "key"),
    Column("predicted_on", "fact"),
    Column("first_date", "fact"),
    Column("last_date", "fact"),
    Column("n_ranges", "number"),
    Column("n_refused", "number"),
    Column("edit_print", "fact"),
)
"""Columns of `predictions`."""
SCORES: Final = (
    Column("number", "key"),
    Column("entry", "key"),
    Column("edit", "key"),
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("predicted_lo", "rate", "change"),
    Column("predicted_hi", "rate", "change"),
    Column("measured_change", "rate", "change"),
    Column("n_weeks_after", "fact"),
    Column("is_scored", "fact"),
    Column("held", "fact"),
)
"""Columns of `prediction_scores`: `held` is empty until the prediction is scored."""


RECORD: Final = (
    Column("record_of", "key", "record_of"),
    Column("n_scored", "number"),
    Column("n_held", "number"),
    Column("held_share", "share", "share"),
    Column("wider_by", "rate", "change"),
)
"""Columns of `prediction_record`."""
HOLDS: Final = 0.9
"""Share of the cases that a range is to hold."""
SHIPPED: Final = (("exit", 4, 4), ("entrance", 3, 3), ("opening", 301, 313), ("scene", 54, 60))
"""Ranges that held, and those that were tested, at 2 m. On recordings of others: widths of corridors, and squares of
4 m with people shifted in time (`tests/realdata/prove_whatif.py`). In scenes of another simulator: around fixtures
(`tests/whatif/prove_scenes.py`)."""


@dataclass(frozen=True, slots=True)
class SiteRecord:
    """How the scored predictions of a site came out.

    Attributes:
        n_scored: Predictions that were scored.
        n_held: Of these, those that held.
        wider_by: By how much later ranges reach farther on both sides, as a share of the time too close.
    """

    n_scored: int
    n_held: int
    wider_by: float


@dataclass(frozen=True, slots=True)
class LoggedPrediction:
    """A receipt that an entry of the change log names.

    Attributes:
        number: Of the receipt, from 1.
        entry: Place of the entry in the log, from 1.
        figure: What became of its area.
    """

    number: int
    entry: int
    figure: BeforeAfterFigure


def foreseen_entries(site: Site, predictions: Sequence[LayoutPrediction]) -> list[tuple[int, int]]:
    """Return the receipts that entries of the change log name, and the places of these entries.

    An entry counts only where it names an area, and was made on the day of the receipt or later.
    """
    return [
        (entry.prediction, place)
        for place, entry in enumerate(read_log(site), start=1)
        if entry.prediction is not None and entry.area_id is not None and entry.prediction <= len(predictions)
        if predictions[entry.prediction - 1].made <= entry.at.astimezone(site.zone).date()
    ]


def logged_predictions(
    site: Site,
    predictions: Sequence[LayoutPrediction],
    opened: Callable[[date, date], AbstractContextManager[Warehouse]],
) -> list[LoggedPrediction]:
    """Return what became of the predictions that entries of the change log name.

    Args:
        site: The site.
        predictions: All receipts, in the order in which they were made.
        opened: Opens a warehouse from one day to another.
    """
    logged = []
    for number, place in foreseen_entries(site, predictions):
        with opened(*days_needed(site, place)) as warehouse:
            warehouse.materialise("violations", "camera_hours", "area_hours")
            logged.append(LoggedPrediction(number, place, before_after(warehouse, place)))
    return logged


def prediction_answers(
    predictions: Sequence[LayoutPrediction], logged: Sequence[LoggedPrediction], site: Site, *, today: date
) -> tuple[Answer, Answer, Answer]:
    """Return the receipts, how those that logged changes name came out, and the record of both, as tables.

    A prediction of an area held where the ratio measured by the running verdict, beside the comparison areas, lies in
    its range once four weeks are over. The note counts them: "2 of 3 predictions held".

    Args:
        predictions: All receipts, in the order in which they were made.
        logged: Those that are named.
        site: The site.
        today: Day it holds for without a receipt.
    """
    listed: list[Row] = [
        {
            "number": number,
            "predicted_on": p.made,
            "first_date": p.first,
            "last_date": p.last,
            "n_ranges": Value(len(p.ranges)),
            "n_refused": Value(len(p.refusals)),
            "edit_print": p.edit_print,
        }
        for number, p in enumerate(predictions, start=1)
    ]
    rows = [row for one in logged for row in _scores(predictions[one.number - 1], one)]
    due = [row for row in rows if row["is_scored"]]
    score = Reason(
        "whatif.score", held=sum(row["held"] is True for row in due), scored=len(due), open=len(rows) - len(due)
    )
    first, last = min((p.first for p in predictions), default=today), max((p.last for p in predictions), default=today)
    if logged:
        last = max(last, today - timedelta(days=1))
    holds = HoldsFor(site.site_id, None, first, last)
    return (
        Answer("predictions", PREDICTIONS, tuple(listed), holds),
        Answer("prediction_scores", SCORES, tuple(rows), holds, notes=((None, score),)),
        Answer("prediction_record", RECORD, tuple(_record(site_record(predictions, logged))), holds),
    )


def site_record(predictions: Sequence[LayoutPrediction], logged: Sequence[LoggedPrediction]) -> SiteRecord:
    """Return the record of a site: where fewer than 90 % of its predictions held, later ranges reach farther.

    They reach as much farther on both sides as 90 % of the scored predictions would have needed to hold: by the
    ceil(0.9 n)-th smallest of the distances of what was measured from its range, 0 inside of it.

    Args:
        predictions: All receipts, in the order in which they were made.
        logged: Those that entries of the change log name.
    """
    missed = sorted(
        max(ranged.lo - change, change - ranged.hi, 0.0)
        for one in logged
        if (change := _measured(one)) is not None and _n_weeks(one) >= DUE_WEEKS
        for ranged in predictions[one.number - 1].ranges
        if ranged.place == one.figure.area_id
    )
    wider_by = missed[math.ceil(HOLDS * len(missed)) - 1] if missed else 0.0
    return SiteRecord(len(missed), sum(by == 0 for by in missed), wider_by)


def _measured(logged: LoggedPrediction) -> float | None:
    """Return the change that the running verdict measures so far."""
    so_far = logged.figure.running
    return None if so_far is None or so_far.value is None else so_far.value - 1


def _n_weeks(logged: LoggedPrediction) -> int:
    return 0 if logged.figure.running is None else logged.figure.running.n_weeks


def _record(record: SiteRecord) -> Iterator[Row]:
    for record_of, n_held, n_scored, wider in (
        ("site", record.n_held, record.n_scored, record.wider_by),
        *((kind, held, scored, None) for kind, held, scored in SHIPPED),
    ):
        yield {
            "record_of": record_of,
            "n_scored": Value(n_scored),
            "n_held": Value(n_held),
            "held_share": known(n_held / n_scored if n_scored else None, Reason("whatif.not_scored")),
            "wider_by": known(wider, Reason("whatif.shipped")),
        }


def _scores(prediction: LayoutPrediction, logged: LoggedPrediction) -> list[Row]:
    change, n_weeks = _measured(logged), _n_weeks(logged)
    is_due = change is not None and n_weeks >= DUE_WEEKS
    why = logged.figure.reason or Reason("whatif.not_measured")
    return [
        {
            "number": logged.number,
            "entry": logged.entry,
            "edit": ranged.edit,
            "area_id": ranged.place,
            "name": logged.figure.area_name,
            "predicted_lo": Value(ranged.lo),
            "predicted_hi": Value(ranged.hi),
            "measured_change": known(change, why),
            "n_weeks_after": n_weeks,
            "is_scored": is_due,
            "held": None if change is None or not is_due else ranged.lo <= change <= ranged.hi,
        }
        for ranged in prediction.ranges
        if ranged.place == logged.figure.area_id
    ]
