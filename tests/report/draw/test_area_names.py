"""Names of areas on a map: none runs over another, over a fixture's name or off the map, however small its area."""

from __future__ import annotations

import re
from itertools import combinations, product

import pytest

from vsd_analytics.figures.week.model_map import FloorMap, MapArea, MapFixture
from vsd_analytics.figures.week.results import Rules
from vsd_analytics.report.draw.area_names import Box, area_names
from vsd_analytics.report.draw.cell_map import floor_ink
from vsd_analytics.report.draw.floor_frame import FONT_FIXTURE, FONT_PHONE, Frame, name_box, text_width
from vsd_analytics.report.draw.floor_plan import FONT_PRINT, floor_map
from vsd_analytics.report.pages.single_figures import _large

SIZES = {float(FONT_PRINT): float(FONT_FIXTURE), float(FONT_PHONE): float(FONT_PHONE)}
TEXT = re.compile(r'<text class="(pt[^"]*)"[^>]* font-size="(\d+)"[^>]* x="(\d+)" y="(\d+)"[^>]*>([^<]*)</text>')


def area(name: str, x0: float, y0: float, x1: float, y1: float) -> MapArea:
    return MapArea(area_id=name.lower(), name=name, ring=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


def fixture(name: str, x0: float, y0: float, x1: float, y1: float) -> MapFixture:
    ring = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    return MapFixture(fixture_id=name.lower(), name=name, kind="shelf", ring=ring)


def floor(areas: tuple[MapArea, ...], fixtures: tuple[MapFixture, ...] = ()) -> FloorMap:
    return FloorMap(kind="floor", title="Floor", extent=(0.0, 0.0, 24.0, 16.0), areas=areas, fixtures=fixtures)


def is_over(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


ROW = tuple(area(f"Self-service till {k}", 1 + 2 * k, 6.0, 2 + 2 * k, 7.0) for k in range(10))
GRID = tuple(area(f"Booth {x}.{y}", 4.0 * x, 4.0 * y, 4.0 * x + 3, 4.0 * y + 3) for x, y in product(range(6), range(4)))
BELOW_A_SHELF = (
    (area("End of aisle 2", 8.0, 13.0, 12.0, 15.4),),
    (fixture("Bakery and dairy", 2.0, 15.4, 18.0, 16.0),),
)


@pytest.mark.parametrize(
    "shown", [floor(ROW), floor(GRID), floor(*BELOW_A_SHELF)], ids=["a row of tills", "booths", "below a shelf"]
)
def test_no_name_runs_over_another_or_off_the_map(shown: FloorMap) -> None:
    frame = Frame(shown, width=960, height=900)
    found = area_names(shown.areas, shown.fixtures, frame, sizes=SIZES)
    assert found
    for size, beside in SIZES.items():
        boxes = [name.box(size) for name in found if size in name.sizes]
        assert not any(is_over(a, b) for a, b in combinations(boxes, 2))
        for fixed in shown.fixtures:
            named = name_box(fixed, frame, beside)
            assert named is None or not any(is_over(box, named) for box in boxes)
        assert all(min(b[:2]) >= 0 and b[2] <= frame.width and b[3] <= frame.height for b in boxes)


def test_neighbours_are_named_above_and_below_in_turn_and_never_inside_the_next() -> None:
    frame = Frame(floor(ROW), width=960, height=900)
    found = area_names(ROW, (), frame, sizes={13.0: 15.0})
    assert [name.text for name in found] == [a.name for a in ROW]
    assert len({name.y for name in found}) >= 2
    for name, own in product(found, ROW):
        x, y = zip(*frame.ring(own.ring), strict=True)
        assert name.text == own.name or not is_over(name.box(13), (min(x), min(y), max(x), max(y)))


def test_a_name_without_room_is_left_out_and_one_inside_a_larger_area_has_it() -> None:
    tight = tuple(area(f"A long name {k}", 4.0 * k, 0.0, 4.0 * k + 4, 16.0) for k in range(6))
    hall, till = area("Hall", 0.0, 0.0, 24.0, 16.0), area("Till", 4.0, 4.0, 6.0, 6.0)
    for areas, named in ((tight, 0), ((hall, till), 2)):
        shown = floor(areas)
        assert len(area_names(areas, (), Frame(shown, width=240, height=900), sizes={13.0: 15.0})) == named


def test_a_name_alone_is_above_its_area_and_one_at_the_top_inside_it() -> None:
    alone, top = area("Door", 2.0, 2.0, 6.0, 6.0), area("Stage", 12.0, 13.0, 18.0, 16.0)
    shown = floor((alone, top))
    above, inside = area_names(shown.areas, (), Frame(shown, width=960, height=900), sizes=SIZES)
    assert above.y < (16 - 6) * 40 < inside.box(FONT_PRINT)[1] + (16 - 6) * 40
    assert above.sizes == set(SIZES)


def test_the_mail_leaves_out_names_that_its_large_letters_have_no_room_for() -> None:
    drawn = str(floor_map(floor(*BELOW_A_SHELF), index=0, rules=Rules(distance_m=2.0), label=""))
    names = {m[5]: m for m in TEXT.finditer(drawn)}
    assert {"End of aisle 2", "Bakery and dairy"} <= set(names)
    mailed = _large(drawn)
    assert "End of aisle 2" in mailed
    assert "Bakery and dairy" not in mailed  # letters of 28 are higher than the shelf


def test_a_map_of_the_python_api_has_no_name_over_another() -> None:
    drawn = str(floor_ink(floor(ROW)))
    found = re.findall(r'<text [^>]*font-size="(\d+)" x="(\d+)" y="(\d+)"[^>]*>([^<]*)</text>', drawn)
    boxes = [(int(x), int(y) - int(s), int(x) + text_width(t, int(s)), float(y)) for s, x, y, t in found]
    assert len(boxes) >= 5
    assert not any(is_over(a, b) for a, b in combinations(boxes, 2))
