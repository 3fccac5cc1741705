"""How predictions came out: the running verdict of the logged change that names a receipt, against its range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.config.change_log import read_log
from vsd_analytics.config.predictions import LayoutPrediction
from vsd_analytics.figures.before_after import BeforeAfterFigure
from vsd_analytics.figures.values import known
from vsd_analytics.site.model import Site

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


def prediction_answers(
    predictions: Sequence[LayoutPrediction], logged: Sequence[LoggedPrediction], site: Site, *, today: date
) -> tuple[Answer, Answer]:
    """Return the receipts, and how those that logged changes name came out, as tables.

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
    said = Reason(
        "whatif.score", held=sum(row["held"] is True for row in due), scored=len(due), open=len(rows) - len(due)
    )
    first, last = min((p.first for p in predictions), default=today), max((p.last for p in predictions), default=today)
    if logged:
        last = max(last, today - timedelta(days=1))
    holds = HoldsFor(site.site_id, None, first, last)
    return (
        Answer("predictions", PREDICTIONS, tuple(listed), holds),
        Answer("prediction_scores", SCORES, tuple(rows), holds, notes=((None, said),)),
    )


def _scores(prediction: LayoutPrediction, logged: LoggedPrediction) -> list[Row]:
    so_far = logged.figure.running
    theta = None if so_far is None else so_far.value
    n_weeks = 0 if so_far is None else so_far.n_weeks
    is_due = theta is not None and n_weeks >= DUE_WEEKS
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
            "measured_change": known(None if theta is None else theta - 1, why),
            "n_weeks_after": n_weeks,
            "is_scored": is_due,
            "held": None if theta is None or not is_due else ranged.lo <= theta - 1 <= ranged.hi,
        }
        for ranged in prediction.ranges
        if ranged.place == logged.figure.area_id
    ]
