"""The page as text: closed to the outside, without small counts, bounded by the floor, the same every time."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest
from forbidden_words import forbidden_in
from planner import dense_floor as dense
from planner import planted_shop as planted
from report.sample_space import AREAS, space

from vsd_analytics.answer import Reason
from vsd_analytics.figures.cell_places import CellPlace
from vsd_analytics.figures.hotspots import ResolvedSpot
from vsd_analytics.planner import cell_counts
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData
from vsd_analytics.site.model import Site
from vsd_analytics.wording.reasons import read_reason, reason_text


@pytest.fixture(scope="module")
def texts(pages: dict[str, Path]) -> dict[str, str]:
    return {name: path.read_text(encoding="utf-8") for name, path in pages.items()}


def test_however_many_cameras_are_read_at_once_the_page_is_the_same(
    shop: Site, texts: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cell_counts, "CAMERAS_AT_ONCE", 1)
    data = planted.known(planted.with_settings(shop, **planted.WHOLE))
    assert render_planner(data) == texts["exact"]


def test_the_page_asks_nobody_for_anything(texts: dict[str, str]) -> None:
    for text in texts.values():
        bare = text.replace("http://www.w3.org/2000/svg", "").replace("http://www.w3.org/1999/xlink", "")
        assert not re.search(r"https?://", bare)
        assert not re.search(r"\sstyle=|\son\w+=|<link(?! rel=\"icon\")|fetch\(|XMLHttpRequest|import\(", bare)


def test_the_policy_names_the_style_and_the_script(texts: dict[str, str]) -> None:
    for text in texts.values():
        policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)
        assert policy is not None
        for kind, pattern in (("style", r"<style>(.*?)</style>"), ("script", r"<script>(.*?)</script>")):
            found = re.findall(pattern, text, flags=re.DOTALL)
            assert len(found) == 1
            digest = base64.b64encode(hashlib.sha256(found[0].encode()).digest()).decode()
            assert f"{kind}-src 'sha256-{digest}'" in policy[1]
        assert "default-src 'none'" in policy[1]
        assert "unsafe" not in policy[1]


def test_headings_tables_and_language_are_in_order(texts: dict[str, str]) -> None:
    text = texts["masked"]
    assert text.count("<h1") == 1
    assert '<html lang="en-GB">' in text
    assert all('scope="' in cell for cell in re.findall(r"<th\b[^>]*>", text))


def test_what_people_read_has_none_of_the_words_that_are_not_said(texts: dict[str, str]) -> None:
    body = re.sub(r"<(style|script)\b.*?</\1>", " ", texts["masked"], flags=re.DOTALL)
    said = re.sub(r"<[^>]+>", " ", body) + " ".join(re.findall(r'aria-label="([^"]*)"', body))
    script = re.findall(r"<script>(.*?)</script>", texts["masked"], flags=re.DOTALL)[0]
    spoken = " ".join(re.findall(r"'([A-Z][^'\n]{8,})'|`([A-Z][^`\n]{8,})`", script)[k][0] for k in range(3))
    assert forbidden_in(said) == []
    assert forbidden_in(spoken) == []


def test_the_report_s_figures_are_there_without_script(masked: PlannerData, texts: dict[str, str]) -> None:
    table = re.search(r'id="figures">(.*?)</table>', texts["masked"], flags=re.DOTALL)
    assert table is not None
    for row in masked.places:
        assert row.violation_rate.value is not None
        assert f">{row.name}<" in table[1]
        assert f"<td>{row.violation_rate.value:.0f} <small>likely between" in table[1]


def test_a_place_with_too_few_is_not_reported(tmp_path: Path) -> None:
    shop = planted.build(tmp_path / "shop")  # of its own: what the page hides now, it hides ever after
    data = planted.known(planted.with_settings(shop, mask_below=250))
    door = next(k for k, row in enumerate(data.places) if row.place_id == "area:door")
    assert "fewer than 250" in reason_text(data.week.hidden[door])
    assert len(data.week.hidden) > 1  # another, or the sum would tell it
    page = render_planner(data)
    figures = page[page.index('id="figures"') :]
    assert "fewer than 250 violations were counted" in figures


def test_equal_data_give_equal_bytes(masked: PlannerData, texts: dict[str, str]) -> None:
    assert render_planner(masked) == texts["masked"]


def test_a_place_that_is_watched_after_a_change_is_named_below_the_hotspots(masked: PlannerData) -> None:
    ring = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    place = CellPlace(
        x_m=0.5, y_m=0.5, peak_x_m=0.5, peak_y_m=0.5, area_id="door", area_name="Door",
        nearest_id=None, nearest_name=None, nearest_m=None, polygons=((ring,),), area_m2=1.0,
    )  # fmt: skip
    spot = ResolvedSpot("ground-x0-y0", place, 2.0, None, None, None, None, (), changed_on=date(2026, 11, 9))
    found = replace(masked.hotspots, watching=(spot,))
    said = "Door: changed on Mon 9 Nov; watching since."
    assert said not in render_planner(masked)
    assert said in render_planner(replace(masked, hotspots=found))


def test_hostile_names_stay_text(masked: PlannerData) -> None:
    site = replace(masked.site, name=planted.HOSTILE)
    places = tuple(replace(p, name=planted.HOSTILE) for p in masked.places)
    page = render_planner(replace(masked, site=site, places=places, why_not_compared=read_reason(planted.HOSTILE)))
    assert "<img" not in page
    assert page.count("<script") == 5
    assert page.count("</script>") == 5
    meta = re.search(r'id="meta">(.*?)</script>', page, flags=re.DOTALL)
    assert meta is not None
    assert json.loads(meta[1])["notCompared"] == planted.HOSTILE


def test_a_floor_without_places_has_a_page_without_map(masked: PlannerData) -> None:
    week = replace(masked.week, cells=None)
    page = render_planner(
        replace(
            masked,
            week=week,
            before=None,
            shown=None,
            walkable=None,
            why_no_map=Reason("nobody.seen"),
            why_not_compared=Reason("compare.no_other_week"),
        )
    )
    assert "nobody was seen" in page
    assert "<svg id=" not in page


@pytest.mark.parametrize("n_violations", [20_000, 2_000_000])
def test_the_size_is_bounded_by_the_floor(exact: PlannerData, n_violations: int) -> None:
    page = render_planner(dense.planner(exact, n_violations=n_violations))
    assert len(page.encode()) <= 800_000


def test_five_areas_that_ask_how_they_are_used_leave_the_file_within_800_kb(exact: PlannerData) -> None:
    floor, area, *others = exact.places
    areas = [replace(area, place_id=f"area:{key}", name=name) for key, name in AREAS.items()]
    assert exact.shown is not None
    outline = exact.shown.areas[0]
    drawn = tuple(
        replace(outline, area_id=key, name=name, ring=tuple((x + 2 * k, y) for x, y in outline.ring))
        for k, (key, name) in enumerate(AREAS.items())
    )
    data = replace(
        exact,
        places=(floor, *areas, others[-1]),
        shown=replace(exact.shown, areas=drawn),
        space=space(),
    )
    page = render_planner(dense.planner(data, n_violations=2_000_000))
    assert page.count("data-from=") >= 3
    assert "How the space is used" in page
    assert 700_000 < len(page.encode()) <= 800_000
