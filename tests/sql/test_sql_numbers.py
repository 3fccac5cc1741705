"""Numbers in SQL: a threshold is a setting or a rule, in `params`; every other one is here with its reason."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

import pytest
from given_expect import all_relations

from vsd_analytics.figures.floor_days import MART_CELL_M
from vsd_analytics.warehouse.sqlfiles import Relation

UNITS: Final = {
    "0", "1", "1.0", "0.0",  # nothing, and one
    "2",  # twice, half, squares, pairs of two: in every formula
    "1000", "1000.0",  # thousandths
    "3600", "3600000", "86400000",  # seconds and milliseconds of an hour, milliseconds of a day
    "900", "900000", "96", "24",  # seconds and milliseconds of a quarter, quarters and hours of a day
}  # fmt: skip

QUARTERS_OF_AN_HOUR: Final = r"\b(bucket_)?quarter / 4\b"
ORDINALS: Final = r"\b(group|order) by [\d, ]+$"

CROWD = "more people than this are too many for all pairs: what bounds the time, not a figure"
DIRECTIONS = "cosines and sines of sixteen directions, in thousandths"
CELL = "side of the cells of this mart, a multiple of the stored ones: MART_CELL_M"

REASONS: Final[Mapping[str, Mapping[str, str]]] = {
    "marts/area_people": {"4": "quarters of an hour"},
    "marts/walks": {"4": "quarters of an hour"},
    "facts/camera_days": {"0.5": "the median"},
    "facts/episode_segments": {
        "500": "class of distances of M11, part of its definition and of the column's name",
        "1500": "class of distances of M11, part of its definition and of the column's name",
        "8": "the cubic through four points at its middle",
    },
    "staging/pairs": {"40": CROWD},
    "tables/area_hours": {"0.5": "the middle of a cell"},
    "tables/cells": {"0.5": "the middle of a cell"},
    "facts/same_pairs": {
        "3": "a stretch of at most 4 s holds at most four whole seconds",
        "2000": "twice the side of the squares, 1 m, that candidates are looked for in; no threshold",
    },
    "facts/joined_tracks": {"3": "a stretch of at most 4 s holds at most four whole seconds"},
    "facts/sequence_runs": {
        "5": "a count below 5 is too short to say that a fall to 0 or 1 is a new count",
        "60000": "a number that falls after a minute of silence is a new count of the engine",
    },
    "marts/cell_days": {"500": CELL},
    "marts/planner_cells": {"500": CELL},
    "staging/gathering_clusters": dict.fromkeys(("195", "383", "556", "707", "831", "924", "981"), DIRECTIONS),
    "staging/shared_tracks": dict.fromkeys("345678", "8 neighbours in order of ids"),
}  # fmt: skip


def numbers(relation: Relation) -> set[str]:
    """Return the numbers of a query besides ordinals, comments, texts and quarters of an hour."""
    body = re.sub(r"'[^']*'", "''", re.sub(r"--.*", "", relation.sql))
    body = re.sub(QUARTERS_OF_AN_HOUR, "hour", re.sub(ORDINALS, "", body, flags=re.M))
    return set(re.findall(r"(?<![\w.])\d[\d_]*(?:\.\d+)?(?:e\d+)?\b", body))


@pytest.mark.parametrize("relation", all_relations(), ids=lambda r: f"{r.layer}/{r.name}")
def test_every_number_is_a_unit_or_has_its_reason(relation: Relation) -> None:
    """A new threshold is a setting marked "sql" in `settings.py` or a rule of `warehouse/rules.py`."""
    assert numbers(relation) - UNITS == set(REASONS.get(f"{relation.layer}/{relation.name}", {}))


def test_reasons_are_of_files_that_exist() -> None:
    assert set(REASONS) <= {f"{r.layer}/{r.name}" for r in all_relations()}


def test_the_cells_of_marts_are_those_that_the_figures_expect() -> None:
    assert REASONS["marts/cell_days"].keys() == {f"{MART_CELL_M * 1000:g}"}
