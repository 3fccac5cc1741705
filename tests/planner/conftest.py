"""The planted floor, once for all tests of the planner."""

from __future__ import annotations

from pathlib import Path

import pytest
from planner import planted_shop as planted

from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData
from vsd_analytics.site.model import Site


@pytest.fixture(scope="session")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return planted.build(tmp_path_factory.mktemp("planner") / "shop")


@pytest.fixture(scope="session")
def exact(shop: Site) -> PlannerData:
    """What the page knows where no count is small."""
    return planted.known(planted.with_settings(shop, **planted.WHOLE))


@pytest.fixture(scope="session")
def masked(shop: Site) -> PlannerData:
    """What the page knows under the default settings, but for the person-hours a rate needs."""
    return planted.known(planted.with_settings(shop, min_exposure_h=2.0))


@pytest.fixture(scope="session")
def pages(exact: PlannerData, masked: PlannerData, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("planner-pages")
    made = {}
    for name, data in (("exact", exact), ("masked", masked)):
        made[name] = folder / f"{name}.html"
        made[name].write_text(render_planner(data), encoding="utf-8")
    return made
