"""WILDTRACK's people followed over its seven views: nobody is joined with somebody else, and identities go on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from prove_joined_views import false_of, idf1, outcome, wildtrack

pytestmark = pytest.mark.realdata


@pytest.mark.parametrize(("cut_every", "apart_at_most", "joined_at_least"), [(0, 0.65, 0.95), (20, 0.45, 0.7)])
def test_nobody_is_joined_with_somebody_else_and_identities_go_on(
    realdata: Callable[[str], Path], tmp_path: Path, cut_every: int, apart_at_most: float, joined_at_least: float
) -> None:
    site, _, records, _ = wildtrack(realdata("wildtrack/H_image_to_ground_m.json").parent, cut_every=cut_every)
    apart = outcome(replace(site, root=tmp_path / "apart"), records)
    joining = site.settings.with_values({"join_views": True})
    joined = outcome(replace(site, root=tmp_path / "joined", settings=joining), records)
    assert apart.joined == []
    assert idf1(apart) < apart_at_most
    assert len(joined.joined) > 1400
    assert false_of(joined) == 0
    assert idf1(joined) > joined_at_least
    assert joined.followed.total() > 1.5 * apart.followed.total()
