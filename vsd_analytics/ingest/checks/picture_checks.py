"""Checks of positions in the picture (W226)."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from typing import Final

import numpy as np

from vsd_analytics.ingest.checks.check_case import (
    ROWS_MIN,
    Case,
    SourceCheck,
    SourceWarning,
    always,
    has_columns,
    picture_px,
)
from vsd_analytics.ingest.checks.place_checks import as_metres
from vsd_analytics.ingest.checks.sample import Floats, extent, is_known
from vsd_analytics.ingest.reading.column_hints import letters, place_like, side_named
from vsd_analytics.ingest.reading.table_head import TableHead

_BOX_SIDES: Final = {"right": "size", "bottom": "size", "width": "corner", "height": "corner"}
"""Sides of a box, and what the name of their column must not say."""

HALF_SHARE: Final = 0.55
"""Feet that all lie this near to the upper left corner, in both directions: the engine saw a picture half as large."""
WIDE_SHARE: Final = 0.8
CORNER_SHARE: Final = 0.99
SHARES: Final = 1000
SQUARES: Final = (320, 416, 512, 640, SHARES)
PICTURE_MIN_PX, PICTURE_MAX_PX = 100, 5_120


def _names_centre(name: str) -> bool:
    return "cent" in name.lower() or letters(name.rpartition(".")[2]) in ("cx", "cy", "xc", "yc")


def _square_side(places: Floats) -> int | None:
    """Return the side of the square that places fill to 85 % or more in one direction, of those that detectors use."""
    square_side = next((side for side in SQUARES if 0.85 * side <= float(places.max()) <= side), None)
    is_whole = bool((places * 2 % 1 == 0).all())  # the middle of two whole sides
    return square_side if square_side != SHARES or is_whole else None


def _pixels(case: Case) -> Iterator[SourceWarning]:
    places = case.sample.picture_px[is_known(case.sample.picture_px)]
    if len(places) < 3 or case.sample.has_floor:
        return
    if case.head is not None:
        yield from _columns(case.head)
        yield from _boxes(case, case.head, places)
    yield from _scale(case, *places.T)


def _as_centre(head: TableHead) -> str | None:
    """Return how to read the corner of a box as its centre."""
    return head.map_option(center_x="left", center_y="top", width="width", height="height")


def _columns(head: TableHead) -> Iterator[SourceWarning]:
    """Yield warnings whether columns hold feet, or the corners of boxes, by their names."""
    names = head.plan.names
    centre = [theirs for ours, theirs in names.items() if ours in ("left", "top") and "cent" in theirs.lower()]
    if centre:
        what = f"a box's corner is read from {centre[0][:80]!r}, which names its centre"
        fix = _as_centre(head) or "map the centre as center_x and center_y, beside width and height"
        yield SourceWarning(what, "foot points would be half a box away", fix, is_sure=True)
    sizes = [name for name in head.ignored if side_named(name) == "size"]
    if "u_px" in names and len(sizes) >= 2:
        beside = place_like(["left", "top", *sizes])
        point, size = (names["u_px"], names["v_px"]), (beside.get("width", sizes[0]), beside.get("height", sizes[1]))
        sides = ((*ours, "width", "height") for ours in (("left", "top"), ("center_x", "center_y")))
        renames = (",".join(f"{o}={n}" for o, n in zip(ours, point + size, strict=True)) for ours in sides)
        corner, centre_of_box = (f"--map {shlex.quote(rename)}" for rename in renames)
        yield SourceWarning(
            f"{names['u_px'][:80]!r} is read as a point, and the file has the size of a box beside it",
            "people's places are where their feet are: the lower edge of the box, and not its corner or centre",
            f"{corner} if it is the upper left corner; {centre_of_box} if it is the centre",
            is_sure=True,
        )
    elif "u_px" in names and (centre := [n for n in (names["u_px"], names["v_px"]) if _names_centre(n)]):
        yield SourceWarning(
            f"u_px, v_px are read from {centre[0][:80]!r}, which names the centre of a box",
            "people's places are where their feet are: half a box further down",
            "export the lower edge of boxes, or their centre, width and height (center_x, center_y, width, height)",
        )
    if letters(corner := names.get("left", "")).endswith("xywh"):
        yield SourceWarning(
            f"{corner[:80]!r} is read as the corner of a box: some programs write its centre under this name",
            "people's places would be half a box to the right and further down",
            f"{_as_centre(head) or 'map center_x, center_y'} if it is the centre, as ultralytics has it",
            is_note=True,
        )


def _boxes(case: Case, head: TableHead, places: Floats) -> Iterator[SourceWarning]:
    """Yield warnings whether the sides of boxes are the ones they are read as."""
    boxes = head.boxes
    if boxes.n_wide > WIDE_SHARE * boxes.n > 0:
        yield SourceWarning(
            f"{boxes.n_wide:,} of {boxes.n:,} boxes are clearly wider than high",
            "people who stand are higher than wide: the axes, or sides and sizes, may be exchanged",
            "map each side to the column that holds it (--map)",
        )
    if boxes.n_slim > 0.5 * boxes.n > 0 and (side := _square_side(places)) is not None:
        yield SourceWarning(
            f"no position is beyond {side:,}, and {boxes.n_slim:,} of {boxes.n:,} boxes are too slim",
            f"pictures that were stretched to a square of {side:,} pixels, or shares of {side:,}, look like this",
            f"divide by {side:,}, and read them with --size WIDTHxHEIGHT, if they are",
        )
    if boxes.n_like_corners > max(5 * ROWS_MIN, CORNER_SHARE * boxes.n):
        yield SourceWarning(
            f"the width and height of {boxes.n_like_corners:,} of {boxes.n:,} boxes are larger than "
            "their left and top sides",
            "hardly anybody is so near to the upper left corner: they seem to be the far corner of the box",
            f"{_as_corners(case)} if they are",
        )
    names = head.plan.names.items()
    wrong = [theirs for ours, theirs in names if side_named(theirs) == _BOX_SIDES.get(ours, "")]
    if wrong:
        is_size = side_named(wrong[0]) == "size"
        what = f"{wrong[0][:80]!r} names the {'size' if is_size else 'far corner'} of a box, and is read as the other"
        fix = (
            head.map_option(left="left", top="top", width="right", height="bottom")
            if is_size
            else head.map_option(left="left", top="top", right="width", bottom="height")
        ) or "map each side to the column that holds it (--map)"
        yield SourceWarning(what, "foot points would be elsewhere in the picture", fix, is_sure=True)
    if boxes.n_upside_down > 0.5 * boxes.n:
        what = f"the bottom of {boxes.n_upside_down:,} of {boxes.n:,} boxes is above their top"
        why = "y seems to point up, or top and bottom are exchanged; pixels are counted from the upper edge down"
        yield SourceWarning(
            what, why, "export y from the upper edge, or map top and bottom the other way", is_sure=True
        )


def _as_corners(case: Case) -> str:
    """Return the options that read width and height as right and bottom sides."""
    columns = case.options.columns or (tuple(case.columns.plan.names) if case.columns.n_columns else ())
    if not columns:
        option = case.columns.map_option(left="left", top="top", right="width", bottom="height")
        return option or "map them as right and bottom (--map)"
    ours = {"width": "right", "height": "bottom"}
    more = ["_"] * (case.columns.n_columns - len(columns))
    return f"--format table --columns {','.join([*(ours.get(name, name) for name in columns), *more])}"


def _mirrored(case: Case) -> Iterator[SourceWarning]:
    head = case.columns
    left, right = (head.plan.names.get(side, "") for side in ("left", "right"))
    is_upside_down = head.boxes.n_upside_down > 0.5 * head.boxes.n
    if side_named(right) == "size" or (is_upside_down and side_named(right) != "corner"):
        return  # sizes that are read as sides
    if head.boxes.n_mirrored > 0.5 * head.boxes.n > 0:
        yield SourceWarning(
            f"{right[:80]!r} is left of {left[:80]!r} in {head.boxes.n_mirrored:,} of {head.boxes.n:,} boxes",
            "the sides seem to be exchanged: no such box has a size, and none of them is read",
            f"--map left={right},right={left}",
            is_sure=True,
        )


def _scale(case: Case, u: Floats, v: Floats) -> Iterator[SourceWarning]:
    """Yield warnings whether positions are pixels, and of a picture of this size."""
    size = case.options.size_px or picture_px(case)
    if (shares := _shares(u, v, size)) is not None:
        yield shares
    elif size is None:
        yield from _size_unknown(case.head, u, v)
    elif len(u) >= ROWS_MIN:
        yield from _size_known(case, u, v, size)


def _shares(u: Floats, v: Floats, size_px: tuple[int, int] | None) -> SourceWarning | None:
    """Return the warning about positions that all are shares of the picture."""
    if ((u >= -0.1) & (u <= 1.1) & (v >= -0.1) & (v <= 1.1)).all():
        shown = "1280x720" if size_px is None else f"{size_px[0]}x{size_px[1]}"
        return SourceWarning(
            "all positions are between 0 and 1: shares of the picture, not pixels",
            "everybody would stand on one pixel",
            f"--size {shown} (width and height of the picture) converts them",
            is_sure=True,
        )
    if ((np.abs(u) <= 1.1) & (np.abs(v) <= 1.1)).all():
        what = "all positions are between -1 and 1: shares of the picture from its middle, not pixels"
        fix = "export pixels, or shares from 0 to 1 with --size WIDTHxHEIGHT: (1 + x) / 2 and (1 - y) / 2"
        return SourceWarning(what, "everybody would stand on one pixel", fix, is_sure=True)
    return None


def _size_unknown(head: TableHead | None, u: Floats, v: Floats) -> Iterator[SourceWarning]:
    if len(u) >= ROWS_MIN and max(np.quantile(u, 0.9), np.quantile(v, 0.9)) > PICTURE_MAX_PX:
        what = f"positions reach to u {u.max():,.0f}, v {v.max():,.0f}"
        why = f"hardly any camera has more than {PICTURE_MAX_PX:,} pixels: engines count to 8191 or 10000 like this"
        yield SourceWarning(what, why, "export pixels, or shares from 0 to 1 with --size WIDTHxHEIGHT")
    if len(u) >= 5 * ROWS_MIN and max(np.quantile(u, 0.99), np.quantile(v, 0.99)) <= PICTURE_MIN_PX:
        yield SourceWarning(
            f"nobody is beyond u {u.max():,.0f}, v {v.max():,.0f}",
            "hardly any camera has so few pixels: metres, or shares or percents of the picture, look like this",
            f"{as_metres(head)} if they are metres; --size WIDTHxHEIGHT if they are shares of 1; "
            "picture_px of the camera in vsd.toml if it has so few pixels",
        )


def _size_known(case: Case, u: Floats, v: Floats, size_px: tuple[int, int]) -> Iterator[SourceWarning]:
    width, height = size_px
    beyond = float(((u < -0.02 * width) | (u > 1.02 * width) | (v < -0.02 * height) | (v > 1.1 * height)).mean())
    is_percent = u.max() <= 100 and v.max() <= 100 and min(size_px) >= 300
    if is_percent and max(u.max(), v.max()) > 20:
        yield SourceWarning(
            f"all positions are between 0 and 100, and the picture has {width} x {height} pixels: percents of it?",
            "everybody would stand in its upper left corner",
            "export pixels, or shares of 0 to 1 with --size",
            is_sure=True,
        )
        return
    is_corner = bool(np.quantile(u, 0.99) < 0.05 * width and np.quantile(v, 0.99) < 0.05 * height)
    if beyond > 0.1 or is_corner:
        usual = extent(case.sample.picture_px)
        assert usual is not None
        where = f"u {usual[0]:,.0f} to {usual[1]:,.0f}, v {usual[2]:,.0f} to {usual[3]:,.0f}"
        yield SourceWarning(
            f"positions do not fit the picture of {width} x {height} pixels: {where}",
            "the engine's pictures may have another resolution, or the positions another unit",
            f"calibrate with the resolution that the engine works at; {as_metres(case.head)} if they are metres",
            is_sure=beyond > 0.5 or is_corner,
        )
    elif len(u) >= 5 * ROWS_MIN and (share := max(u.max() / width, v.max() / height)) <= HALF_SHARE:
        yield SourceWarning(
            f"everybody would be in the upper left {share:.0%} of the picture of {width} x {height} pixels",
            "positions of a smaller picture look like this, such as one that was scaled down for the detector",
            "picture_px = [...] of the camera with the size that the engine works at, and a calibration for it",
        )


PICTURE_CHECKS: Final = (
    SourceCheck("W226", always, _pixels, "positions in the picture that are no pixels of it"),
    SourceCheck("W226", has_columns, _mirrored, "boxes whose right side is left of their left one"),
)
