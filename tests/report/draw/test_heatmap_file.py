"""The heatmap as a picture file: classes, clear cells, scale, hostile names, equal bytes, colours that can be read."""

from __future__ import annotations

import io
import re
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from vsd_analytics.errors import ReportError, UsageError
from vsd_analytics.report.draw import heatmap_file
from vsd_analytics.report.draw.svg import RAMP_LIGHT
from vsd_analytics.site.model import Area, Floor, Site

REPOSITORY = Path(__file__).resolve().parents[3]
SQUARE = ((2.0, 2.0), (8.0, 2.0), (8.0, 6.0), (2.0, 6.0))
STEPS = (1.0, 2.0, 4.0, 8.0, 16.0)


def site(floor: Floor | None = None, *, name: str = "Checkout queue") -> Site:
    floors = (floor or Floor("ground", "Ground floor"),)
    return Site("shop", "Shop", "UTC", Path(), floors=floors, areas=(Area("queue", name, "ground", SQUARE),))


def cells(*rows: tuple[int, int, float]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=["cx", "cy", "records"])


def draw(folder: Path, frame: pd.DataFrame, *, of: Site | None = None, name: str = "map.png", **more: object) -> Path:
    path = folder / name
    given: dict[str, object] = {"floor_id": None, "cell_m": 1.0, "title": "Violation records", **more}
    heatmap_file.draw_heatmap(frame, of or site(), path=path, **given)  # type: ignore[arg-type]
    return path


def n_pixels(path: Path, colour: str) -> int:
    wanted = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
    return int((np.asarray(Image.open(path).convert("RGB")) == wanted).all(axis=2).sum())


def test_each_class_has_its_colour_and_missing_cells_are_clear(tmp_path: Path) -> None:
    frame = cells((0, 0, 1), (2, 0, 2), (4, 0, 4), (6, 0, 8), (8, 0, 1600))
    drawn = draw(tmp_path, frame, steps=STEPS)
    bare = draw(tmp_path, cells(), name="bare.png", steps=STEPS)
    cell_px = [n_pixels(drawn, c) - n_pixels(bare, c) for c in RAMP_LIGHT]
    assert min(cell_px) > 1000
    assert max(cell_px) < 1.2 * min(cell_px), "one cell in each of the five classes"
    nobody_px = n_pixels(drawn, heatmap_file.NOBODY_CLOSE) - n_pixels(bare, heatmap_file.NOBODY_CLOSE)
    assert abs(nobody_px) < 0.1 * min(cell_px), "cells not in the frame stay clear"


@pytest.mark.parametrize("width", [1, 3, 10, 80])
def test_the_circle_of_the_distance_fits_below_the_floor(width: int) -> None:
    from matplotlib.patches import Circle

    shop = Site("shop", "Shop", "UTC", Path(), floors=(Floor("ground", "Ground floor"),))
    frame = cells((0, 0, 1), (width, 0, 5))
    with heatmap_file._own_style():
        figure = heatmap_file._figure(frame, shop, floor=shop.floors[0], cell_m=1.0, title="", steps=STEPS)
    (circle,) = (p for p in figure.axes[0].patches if isinstance(p, Circle))
    low, high = circle.center[1] - circle.radius, circle.center[1] + circle.radius
    assert figure.axes[0].get_ylim()[0] < low
    assert high < -1.0, "the floor's box begins a cell below the lowest cell"


def test_recorded_zero_is_drawn_and_is_not_missing(tmp_path: Path) -> None:
    zero = draw(tmp_path, cells((0, 0, 0), (5, 5, 3)), name="zero.png", steps=STEPS)
    missing = draw(tmp_path, cells((5, 5, 3)), name="missing.png", steps=STEPS)
    assert n_pixels(zero, heatmap_file.NOBODY_CLOSE) > 2 * n_pixels(missing, heatmap_file.NOBODY_CLOSE)


def test_one_odd_cell_does_not_decide_the_scale() -> None:
    usual = [10.0 * (1 + i % 8) for i in range(400)]
    assert heatmap_file.doubling_steps([*usual, 1e6]) == heatmap_file.doubling_steps(usual) == (1, 10, 20, 40, 80)


@given(st.lists(st.integers(0, 10**7), max_size=300))
def test_steps_ascend_and_double_whatever_the_counts(counts: list[int]) -> None:
    steps = heatmap_file.doubling_steps(counts)
    assert len(steps) == 5
    assert steps[0] == 1
    assert [b / a for a, b in pairwise(steps[1:])] == [2, 2, 2]
    top = np.percentile([c for c in counts if c] or [0], 99)
    assert steps[-1] <= top < 2.5 * steps[-1] or top < 40


def test_given_steps_are_used_so_that_two_weeks_compare(tmp_path: Path) -> None:
    used = heatmap_file.draw_heatmap(
        cells((0, 0, 7)),
        site(),
        floor_id="ground",
        cell_m=1.0,
        path=tmp_path / "a.svg",
        title="",
        steps=(5, 10, 20, 40, 80),
    )
    assert used == (5, 10, 20, 40, 80)


@pytest.mark.parametrize("steps", [(1, 2, 3), (1, 2, 2, 4, 8), (0, 1, 2, 4, 8)])
def test_steps_that_are_no_classes_are_refused(tmp_path: Path, steps: tuple[float, ...]) -> None:
    with pytest.raises(UsageError, match="ascending"):
        draw(tmp_path, cells((0, 0, 1)), steps=steps)


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_same_input_gives_the_same_bytes(tmp_path: Path, kind: str) -> None:
    frame = cells((0, 0, 3), (4, 2, 90))
    one, two = (draw(tmp_path, frame, name=f"{n}.{kind}").read_bytes() for n in "ab")
    assert one == two
    assert not re.search(rb"\d{4}-\d\d-\d\dT|Matplotlib v", one)


@pytest.mark.parametrize("name", ["<script>alert(1)</script>", r"$\frac{1}{0$ and $x", "100 % & more", "売り場\x07"])
def test_hostile_names_are_text(tmp_path: Path, name: str) -> None:
    path = draw(tmp_path, cells((0, 0, 3)), of=site(name=name), name="a.svg", title=name)
    tags = {e.tag.rpartition("}")[2] for e in ET.parse(path).iter()}
    assert "script" not in tags


def test_floor_is_to_scale(tmp_path: Path) -> None:
    wide = Floor("ground", "Ground floor", _plan(tmp_path, (200, 100)), 0.1, (0.0, 0.0))
    path = draw(tmp_path, cells((0, 0, 20), (0, 4, 20)), of=site(wide), steps=STEPS)
    red = np.asarray(Image.open(path).convert("RGB")).astype(int)
    mask = (abs(red - [0x93, 0x44, 0x44]) < 6).all(axis=2)
    rows, columns = np.nonzero(mask[:, : mask.shape[1] // 2])
    height_px, width_px = rows.max() - rows.min() + 1, columns.max() - columns.min() + 1
    assert height_px / width_px == pytest.approx(5.0, rel=0.04), "two square cells, five cells from end to end"


def test_cells_beside_the_plan_are_left_out(tmp_path: Path) -> None:
    floor = Floor("ground", "Ground floor", _plan(tmp_path, (100, 100)), 0.1, (0.0, 0.0))
    here = draw(tmp_path, cells((1, 1, 5)), of=site(floor), name="here.png", steps=STEPS)
    there = draw(tmp_path, cells((1, 1, 5), (9_000_000, 9_000_000, 5)), of=site(floor), name="there.png", steps=STEPS)
    assert here.read_bytes() == there.read_bytes()


def test_dark_lines_of_a_plan_lie_over_the_colours(tmp_path: Path) -> None:
    blank, lined = (Floor("ground", "", _plan(tmp_path, (100, 100), line=x), 0.1, (0.0, 0.0)) for x in (False, True))
    frame = cells(*((x, y, 20) for x in range(10) for y in range(10)))
    without, with_line = (
        draw(tmp_path, frame, of=site(f), name=n, steps=STEPS) for f, n in ((blank, "a.png"), (lined, "b.png"))
    )
    assert n_pixels(with_line, RAMP_LIGHT[4]) < 0.95 * n_pixels(without, RAMP_LIGHT[4])


def test_svg_plan_gives_areas_only(tmp_path: Path) -> None:
    plan = tmp_path / "plan.svg"
    plan.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 200 100"><rect width="200" height="100"/></svg>'
    )
    path = draw(tmp_path, cells((1, 1, 5)), of=site(Floor("ground", "", plan, 0.1, (0.0, 0.0))))
    assert Image.open(path).width > 600


def test_damaged_plan_is_an_error_for_people(tmp_path: Path) -> None:
    plan = _plan(tmp_path, (100, 100), noise=True)
    plan.write_bytes(plan.read_bytes()[:2000])
    with pytest.raises(ReportError, match="cannot be shown") as caught:
        draw(tmp_path, cells((1, 1, 5)), of=site(Floor("ground", "", plan, 0.1, (0.0, 0.0))))
    assert caught.value.code == "E501"


def test_too_many_cells_are_refused_before_memory_is(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match="too large"):
        draw(tmp_path, cells((0, 0, 1), (10**6, 10**6, 1)))


def test_unknown_suffix_and_floor_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="neither"):
        draw(tmp_path, cells(), name="map.pdf")
    with pytest.raises(UsageError, match="which floor"):
        draw(tmp_path, cells(), floor_id="attic")


def test_drawing_touches_no_global_state(tmp_path: Path) -> None:
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    before = plt.get_fignums()
    with mpl.rc_context({"axes.facecolor": "red", "font.size": 40}):
        styled = draw(tmp_path, cells((0, 0, 3)), name="a.png")
        assert mpl.rcParams["font.size"] == 40
    assert styled.read_bytes() == draw(tmp_path, cells((0, 0, 3)), name="b.png").read_bytes()
    assert plt.get_fignums() == before


def test_no_colour_map_that_misleads_is_used_anywhere() -> None:
    """Rainbow-like colour maps make edges where there are none, and fail on paper and for colour-blind readers."""
    names = "jet|turbo|rainbow|gist_rainbow|nipy_spectral|gist_ncar|prism|flag|hsv"
    misleading = re.compile(rf"(?i)(?<![a-z])({names})(?![a-z])")
    named = re.compile(r"""(?i)cmap\s*=\s*["']|get_cmap\(|colormaps\[|COLORMAP_""")
    found = []
    for folder, ending in (("vsd_analytics", "*.py"), ("reports", "*"), ("notebooks", "*.ipynb")):
        for path in sorted((REPOSITORY / folder).rglob(ending)):
            if path.is_file() and path.parent.name != "__pycache__":  # templates are compiled beside themselves
                lines = path.read_text(encoding="utf-8").splitlines()
                found += [
                    f"{path.name}:{i}"
                    for i, line in enumerate(lines, 1)
                    if named.search(line) and misleading.search(line)
                ]
    assert found == []
    assert named.search('cmap="jet"')
    assert misleading.search("cv2.COLORMAP_JET")


def _plan(folder: Path, size: tuple[int, int], *, line: bool = False, noise: bool = False) -> Path:
    pixels = np.full((size[1], size[0], 3), 255, dtype=np.uint8)
    if line:
        pixels[:, size[0] // 2 - 4 : size[0] // 2 + 4] = 0
    if noise:
        pixels[:] = np.random.default_rng(1).integers(0, 255, pixels.shape)
    data = io.BytesIO()
    Image.fromarray(pixels).save(data, "png")
    path = folder / f"plan-{line}.png"
    path.write_bytes(data.getvalue())
    return path
