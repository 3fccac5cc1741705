"""The grammar of opening hours against a brute-force set of minutes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.config.opening import WEEKDAYS, OpeningError, parse_clock, parse_days, parse_opening, show_clock

_edges = st.lists(st.integers(0, 96), min_size=2, max_size=6, unique=True).map(lambda q: [x * 15 for x in sorted(q)])


def minutes(spans: tuple[tuple[int, int], ...]) -> set[int]:
    return {m for start, end in spans for m in range(start, end)}


@given(edges=_edges, day=st.sampled_from(WEEKDAYS), order=st.randoms())
def test_spans_open_exactly_the_minutes_they_say(edges: list[int], day: str, order: object) -> None:
    pairs = list(zip(edges[::2], edges[1::2], strict=False))
    order.shuffle(pairs)  # type: ignore[attr-defined]
    week, wrong = parse_opening({day: [f"{show_clock(a)}-{show_clock(b)}" for a, b in pairs]})
    assert wrong == []
    expected = {m for a, b in pairs for m in range(a, b)}
    assert [minutes(spans) for spans in week] == [expected if d == day else set() for d in WEEKDAYS]


@given(first=st.integers(0, 6), n=st.integers(1, 6))
def test_range_of_days_goes_on_over_sunday(first: int, n: int) -> None:
    expected = [(first + i) % 7 for i in range(n)]
    assert list(parse_days(f"{WEEKDAYS[first]}-{WEEKDAYS[expected[-1]]}")) == expected


@given(a=st.integers(0, 1440), b=st.integers(0, 1440))
def test_overlap_is_refused_and_touching_is_not(a: int, b: int) -> None:
    a, b = a // 15 * 15, b // 15 * 15
    spans = [(a, min(a + 60, 1440)), (b, min(b + 60, 1440))]
    if any(start >= end for start, end in spans):
        return
    _, wrong = parse_opening({"mon": [f"{show_clock(s)}-{show_clock(e)}" for s, e in spans]})
    overlaps = bool(minutes((spans[0],)) & minutes((spans[1],)))
    assert bool(wrong) == overlaps


def test_day_not_named_is_closed_and_closed_is_a_word() -> None:
    week, wrong = parse_opening({"mon": "00:00-24:00", "tue": "closed", "wed": []})
    assert (week[0], week[1:], wrong) == (((0, 1440),), ((),) * 6, [])


@pytest.mark.parametrize("text", ["24:15", "8", "08:60", "-1:00", "08:00:00", "08:07", "٠٨:٠٠"])
def test_what_is_no_quarter_hour_of_a_day_is_refused(text: str) -> None:
    with pytest.raises(OpeningError):
        parse_clock(text)
