"""Nobody who looks at the live page in every minute works out the time of fewer than five people."""

from __future__ import annotations

from pathlib import Path

from hypothesis import assume, given
from hypothesis import strategies as st
from privacy import live_pages, person_times, sequences
from privacy.hidden_counts import BELOW

from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.share.now import Band, beside_usual, in_steps

MASK = Mask(BELOW)
FEW = st.lists(st.floats(0, BELOW - 1), min_size=4, max_size=4)
MANY = st.lists(st.floats(0, 60), min_size=4, max_size=4)


def test_pages_of_every_minute_beside_all_other_outputs_tell_no_time_of_few_people(tmp_path: Path) -> None:
    versions = sequences.lived(tmp_path, 1, n_weeks=2, days=(2,), has_live_page=True)
    [times], [world] = versions.times, versions.worlds
    n_hours = sum(source.startswith("live") for *_, source in times.rows)
    assert n_hours >= 8
    assert person_times.few_people(world)
    assert sequences.broken(versions) == []
    assert sequences.times_worked_out(versions) == {}


@given(few=FEW, many=MANY, lo=st.floats(0, 40), width=st.floats(0, 20), has_usual=st.booleans())
def test_an_hour_of_few_people_beside_the_hour_that_is_hidden_with_it_is_told_by_no_bands(
    few: list[float], many: list[float], lo: float, width: float, has_usual: bool
) -> None:
    """A report gives the sum of both; quarter by quarter the live page gives a band of each."""

    def band(n: float) -> Band:
        return beside_usual(n, lo, lo + width, MASK) if has_usual else in_steps(n, MASK)

    time_h, both_h = sum(few) / 4, (sum(few) + sum(many)) / 4
    assume(time_h > 1e-6)
    low, high = (sum(ends) / 4 for ends in zip(*(live_pages.people_told(band(n)) for n in few), strict=True))
    other_low, other_high = (
        sum(ends) / 4 for ends in zip(*(live_pages.people_told(band(n)) for n in many), strict=True)
    )
    least, most = max(low, both_h - other_high), min(high, both_h - other_low)
    assert least - 1e-9 <= time_h <= most + 1e-9
    assert most - least > person_times.NEAR * time_h


def test_numbers_of_quarter_hours_in_place_of_bands_would_tell_it() -> None:
    """Else the test above would hold because it reads nothing."""
    few, many = [1.0, 0.0, 2.0, 1.0], [12.0, 15.0, 9.0, 20.0]
    both_h = (sum(few) + sum(many)) / 4
    assert both_h - sum(round(n) for n in many) / 4 == sum(few) / 4
