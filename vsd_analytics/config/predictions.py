"""Receipts of predictions: what an edit of the layout was said to do, one JSON object a line in `predictions.jsonl`.

A receipt is written before the change and never altered. An entry of the change log that names it has it scored.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from typing import Any, Final

import msgspec

from vsd_analytics.config.append_only import AppendOnlyFile
from vsd_analytics.site.model import Site

FILE: Final = "predictions.jsonl"


@dataclass(frozen=True, slots=True)
class PredictedRange:
    """The range of one place.

    Attributes:
        edit: Number of the edit in its file, from 1.
        place: Id of the area, "around" the edit, or the key of the floor.
        lo, hi: Change of the time too close per open hour, relative: -0.1 = 10 % less.
    """

    edit: int
    place: str
    lo: float
    hi: float


@dataclass(frozen=True, slots=True)
class LayoutPrediction:
    """A receipt.

    Attributes:
        made: Local day it was made on.
        edit: The file of edits.
        edit_print: Hash of its values.
        inputs: Hash of the facts that it rests on.
        settings: Id of the settings in force.
        first, last: Their days.
        floor: The floor.
        ranges: What was predicted.
        refusals: Codes of the reasons for which edits were refused, by number of the edit.
    """

    made: date
    edit: str
    edit_print: str
    inputs: str
    settings: str
    first: date
    last: date
    floor: str
    ranges: tuple[PredictedRange, ...]
    refusals: dict[int, str]


def prediction_dict(prediction: LayoutPrediction) -> dict[str, Any]:
    """Return a receipt as it is written in the file."""
    written: dict[str, Any] = msgspec.to_builtins(prediction)
    return written


PREDICTIONS: Final = AppendOnlyFile(
    FILE, LayoutPrediction, written=prediction_dict, what="a receipt of a prediction",
    fix="vsd whatif EDIT.toml makes a new one",
)  # fmt: skip


def read_predictions(site: Site) -> tuple[LayoutPrediction, ...]:
    """Return the receipts in the order in which they were made.

    Raises:
        InputError: E110, a line is none.
    """
    return PREDICTIONS.read(site)


def add_prediction(site: Site, prediction: LayoutPrediction) -> int:
    """Add a receipt, durably, and return its number, from 1; that of an equal one where it is there already.

    Raises:
        InputError: E110, a line of the file is no receipt; nothing is written.
        DiskError: E304 to E306, the disk refused.
    """
    PREDICTIONS.add(site, prediction)
    return read_predictions(site).index(prediction) + 1
