"""Small counts cannot be worked out: what is held back leaves every small count at least two ways."""

from __future__ import annotations

from itertools import product

from hypothesis import assume, given
from hypothesis import strategies as st

from vsd_analytics.figures.share.counts import held_back, is_small

counts = st.dictionaries(st.integers(0, 5), st.integers(0, 14), min_size=1, max_size=5)


@given(counts, st.integers(3, 6), st.integers(0, 1))
def test_a_reader_who_knows_the_total_cannot_tell_a_small_count(
    counts: dict[int, int], below: int, n_others: int
) -> None:
    held = held_back(counts, below=below, give=sorted(counts), n_others=n_others)
    assert held.small == {k for k, n in counts.items() if is_small(n, below=below)}
    assert all(counts[k] >= below for k in held.others)
    assume(held.small and held.is_total_safe)
    keys = [*sorted(held.small), *sorted(held.others)]
    ranges = [range(1, below) if k in held.small else range(below, 30) for k in keys]
    total = sum(counts[k] for k in keys)
    possible = [p for p in product(*ranges) if sum(p) == total]
    for i in range(len(held.small)):
        assert len({p[i] for p in possible}) >= 2


@given(counts, st.integers(3, 6))
def test_nothing_is_held_back_without_a_small_count(counts: dict[int, int], below: int) -> None:
    large = {k: n if n == 0 else n + below for k, n in counts.items()}
    held = held_back(large, below=below, give=sorted(large))
    assert not held.small
    assert not held.others
    assert held.is_total_safe


def test_one_small_count_takes_the_first_other_with_it() -> None:
    held = held_back({"a": 3, "b": 40, "c": 9}, below=5, give=["c", "b"])
    assert held.small == {"a"}
    assert held.others == {"c"}
    assert held.is_total_safe
    assert "a" in held
    assert "c" in held
    assert "b" not in held


def test_the_total_must_go_when_nothing_else_hides_a_small_count() -> None:
    assert not held_back({"a": 3, "b": 0}, below=5, give=["b", "a"]).is_total_safe
    assert held_back({"a": 2, "b": 3}, below=5, give=[]).is_total_safe
