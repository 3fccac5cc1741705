"""One secret gives every day its key on every machine, and none of the days before it begins."""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path

import pytest

from vsd_analytics.errors import StoreError
from vsd_analytics.store.day_chain import DayChain, new_chain, read_chain, write_chain
from vsd_analytics.store.secrets import DayKeys

DAY = date(2026, 11, 9)


def test_a_chain_gives_the_same_keys_wherever_it_begins_and_none_before() -> None:
    chain = new_chain()
    later = chain.from_day(DAY)
    assert later.day == DAY
    days = [DAY + timedelta(days=n) for n in range(5)]
    assert [later.key(day) for day in days] == [chain.key(day) for day in days]
    assert len({chain.key(day) for day in days}) == 5
    assert later.key(DAY - timedelta(days=1)) is None
    assert later.mark() == chain.mark() != new_chain().mark()


def test_a_published_chain_does_not_change() -> None:
    chain = DayChain(date(2026, 1, 1), bytes(range(32)))
    key = chain.key(date(2026, 1, 3))
    assert key is not None
    assert key.hex() == "411654990f625704760e3f3cd31fa2a464090b813fb38cd34f892c458fa2ba5c"


def test_days_that_have_a_key_keep_it_and_others_come_from_the_chain(tmp_path: Path) -> None:
    keys = DayKeys(tmp_path)
    random_key = keys.key(DAY)
    chain = keys.chain()
    assert DayKeys(tmp_path).chain() == chain
    assert DayKeys(tmp_path).key(DAY) == random_key != chain.key(DAY)
    other = DAY - timedelta(days=400)
    assert DayKeys(tmp_path).key(other) == chain.key(other)


def test_forgetting_a_day_leaves_no_way_to_its_key_and_keeps_later_ones(tmp_path: Path) -> None:
    keys = DayKeys(tmp_path)
    chain = keys.chain()
    before, after = DAY - timedelta(days=3), DAY + timedelta(days=1)
    held = keys.key(before)
    keys.key(DAY)
    keys.forget([DAY])
    left = read_chain(tmp_path)
    assert left is not None
    assert left.day == after
    assert DayKeys(tmp_path).key(before) == held, "a day that has its own key keeps it"
    assert DayKeys(tmp_path).key(after) == chain.key(after)
    closed = DayKeys(tmp_path).closed()
    assert DAY in closed
    assert before not in closed
    assert DAY - timedelta(days=1) in closed, "a chain has no gaps: earlier days without a key are forgotten with it"
    for day in (DAY, DAY - timedelta(days=1)):
        with pytest.raises(StoreError) as caught:
            DayKeys(tmp_path).key(day)
        assert caught.value.code == "E303"


def test_a_chain_made_after_forgetting_begins_after_it(tmp_path: Path) -> None:
    keys = DayKeys(tmp_path)
    keys.key(DAY)
    keys.forget([DAY])
    assert keys.chain().day == DAY + timedelta(days=1)


def test_who_has_other_keys_cannot_join(tmp_path: Path) -> None:
    site, node = DayKeys(tmp_path / "site"), DayKeys(tmp_path / "node")
    chain = site.chain()
    node.key(DAY)
    with pytest.raises(StoreError) as caught:
        node.join(chain, {}, ())
    assert caught.value.code == "E320"
    fresh = DayKeys(tmp_path / "fresh")
    fresh.join(chain, {}, ())
    fresh.join(chain, {}, ())
    assert fresh.key(DAY) == chain.key(DAY)


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"day": "2026-11-09", "state": "00"}', '{"day": 1, "state": "00"}'])
def test_a_damaged_chain_is_refused(tmp_path: Path, text: str) -> None:
    write_chain(tmp_path, new_chain())
    (tmp_path / "chain.json").write_text(text)
    for act in (DayKeys(tmp_path).chain, lambda: DayKeys(tmp_path).key(DAY)):
        with pytest.raises(StoreError) as caught:
            act()
        assert caught.value.code == "E303"


def test_a_chain_is_for_its_owner_only(tmp_path: Path) -> None:
    DayKeys(tmp_path / "secrets").chain()
    assert (tmp_path / "secrets" / "chain.json").stat().st_mode & 0o777 == 0o600
