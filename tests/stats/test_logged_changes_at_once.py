"""The proof of logged changes computes many sites at once: what it counts is what the product says, week by week."""

from __future__ import annotations

import pytest
from claim_worlds import OFFICE, SHOP, Site, draw
from prove_logged_changes import one_by_one, readings


@pytest.mark.parametrize(
    "site",
    [
        OFFICE.but(name="a fall", effect=0.7),
        SHOP.but(name="all of it moves", effect=0.5, moves=(1.0, 1)),
        OFFICE.but(name="uneven", whole=(0.7, 0.4)),
    ],
)
def test_what_the_proof_counts_is_what_the_product_says(site: Site) -> None:
    drawn = draw(site, 20, weeks_after=9, seed=3)
    many, one = readings(drawn), one_by_one(drawn)
    for name in ("is_clear", "is_fall", "works"):
        assert (getattr(many, name) == getattr(one, name)).all(), name
    assert many.is_clear.any()
    assert many.works.any() == (site.name == "a fall")
