"""The sentence on privacy says what is stored, and never promises what was not done."""

from __future__ import annotations

from dataclasses import replace
from datetime import date

import pytest
from report.sample_weeks import normal

from vsd_analytics.figures.week.stored_records import StoredRecords
from vsd_analytics.report.pages.week import privacy

SINCE = date(2026, 10, 26)


@pytest.mark.parametrize(
    ("stored", "said", "unsaid"),
    [
        (
            StoredRecords(first_day=SINCE),
            ["where people were", "change daily", "start on Monday 26 October 2026", "none was older than the 14 days"],
            ["deleted"],
        ),
        (
            StoredRecords(first_day=SINCE, n_overdue_days=6, has_pseudonyms=False),
            ["numbers that the cameras gave them", "Those of 6 days are past the 14 days", "have them deleted"],
            ["none was older", "change daily"],
        ),
        (
            StoredRecords(first_day=SINCE, purged_before=SINCE, purged_on=date(2026, 11, 16)),
            ["before Monday 26 October 2026 were deleted", "Monday 16 November 2026", "Only counts are left"],
            ["please"],
        ),
        (
            StoredRecords(purged_before=SINCE, purged_on=date(2026, 11, 16)),
            ["were deleted"],
            ["start on", "none was older"],
        ),
        (None, ["where people were"], ["deleted", "older than"]),
    ],
    ids=["in time", "overdue", "purged", "nothing left", "not known"],
)
def test_it_follows_the_store(stored: StoredRecords | None, said: list[str], unsaid: list[str]) -> None:
    text = privacy(replace(normal(), stored=stored))
    assert [words for words in said if words not in text] == []
    assert [words for words in unsaid if words in text] == []
