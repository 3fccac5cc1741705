"""A floor heatmap as a picture file, for slides and notebooks; the report draws its own map (`report.floorplan`).

Matplotlib without pyplot: no global state, no window, and the same bytes for the same input.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from vsd_analytics.errors import ReportError, UsageError, Where
from vsd_analytics.geometry.scale_bar import nice_metres
from vsd_analytics.report.draw.svg import HATCH, INK, MUTED, RAMP_LIGHT, WHITE
from vsd_analytics.site.places import known_floor
from vsd_analytics.wording.format import metres

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from vsd_analytics.geometry.camera_views import Bounds
    from vsd_analytics.site.model import Floor, Site

GRID_MAX: Final = 4_000_000
"""Most cells a picture may have."""
WIDTH_IN, HEIGHT_MAX_IN, DPI = 10.0, 12.0, 144
PLAN_MAX_PX: Final = 2000
NOBODY_CLOSE: Final = "#efece4"
"""Colour of a cell where people stood and fewer records lie than the first step: recorded, not missing."""
N_CLASSES: Final = len(RAMP_LIGHT)
KINDS: Final = {".png": "png", ".svg": "svg"}


def draw_heatmap(
    frame: pd.DataFrame,
    site: Site,
    *,
    floor_id: str | None,
    cell_m: float,
    path: str | Path,
    title: str,
    steps: Sequence[float] | None = None,
) -> tuple[float, ...]:
    """Draw records per floor cell over the floor plan, in five classes.

    Cells nobody was recorded in stay clear; cells where people stood without a record are pale. A PNG or JPG plan lies
    over the colours; an SVG plan cannot be drawn here, so that only the outlines of the areas show where things are.

    Args:
        frame: Columns cx, cy (floor(x / cell), floor(y / cell)) and records, as `figures.heatmap` returns them. With a
            plan, what lies beside it is left out.
        site: The site; its plan, areas and legal distance are drawn.
        floor_id: Floor; None when there is only one.
        cell_m: Side of a cell in metres.
        path: File to write; its suffix, .png or .svg, decides.
        title: Words above the picture, taken literally.
        steps: Lower ends of the five classes, in records per cell, ascending; None = `doubling_steps` of the records.
            Give the same steps to pictures that shall be compared.

    Returns:
        The lower ends of the classes that were used.

    Raises:
        UsageError: E101, no such floor, an unknown suffix, or steps that are not five ascending numbers.
        ReportError: E500, the cells span more than `GRID_MAX`; E501, the plan cannot be read.
    """
    file = Path(path)
    kind = KINDS.get(file.suffix.lower())
    if kind is None:
        raise UsageError(f"{file.name} is neither a .png nor a .svg file", fix="--out where.png")
    floor = known_floor(site, floor_id)
    classes = doubling_steps(frame["records"]) if steps is None else tuple(float(s) for s in steps)
    if len(classes) != N_CLASSES or any(a >= b for a, b in pairwise(classes)) or classes[0] <= 0:
        raise UsageError(f"a heatmap has {N_CLASSES} ascending steps above 0, not {list(classes)}")
    with _own_style():
        figure = _figure(frame, site, floor=floor, cell_m=cell_m, title=title, steps=classes)
        metadata: dict[str, str | None] = {"Software": None} if kind == "png" else {"Date": None, "Creator": None}
        figure.savefig(file, format=kind, dpi=DPI, metadata=metadata, bbox_inches="tight", pad_inches=0.2)
    return classes


def doubling_steps(records: Sequence[float] | pd.Series[Any]) -> tuple[float, ...]:
    """Return the lower ends of five classes of counts: 1, then s, 2 s, 4 s, 8 s.

    8 s is the largest of 8 times 2, 5, 10, 20, 50, ... that does not exceed the 99th percentile of the counts above 0
    (s = 2 where they are small): one odd cell does not decide the scale, and a class is twice the one below.
    """
    import numpy as np

    counts = np.asarray(records, dtype=np.float64)
    counts = counts[counts > 0]
    top = float(np.percentile(counts, 99)) if counts.size else 0.0
    s = 2.0
    while (larger := _next_round(s)) * 2 ** (N_CLASSES - 2) <= top:
        s = larger
    return (1.0, *(s * 2**k for k in range(N_CLASSES - 1)))


def _next_round(value: float) -> float:
    """Return the number after `value` in 2, 5, 10, 20, 50, ..."""
    power = 10.0 ** math.floor(math.log10(value))
    return {1: 2.0, 2: 5.0, 5: 10.0}[round(value / power)] * power


@contextmanager
def _own_style() -> Iterator[None]:
    """Work with matplotlib's own defaults, whatever matplotlibrc says, and keep its remarks about fonts to itself."""
    import warnings

    import matplotlib as mpl

    own = {**mpl.rcParamsDefault, "svg.hashsalt": "vsd-analytics", "font.family": "DejaVu Sans", "text.usetex": False}
    own.pop("backend", None)
    with mpl.rc_context(own), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _figure(
    frame: pd.DataFrame, site: Site, *, floor: Floor, cell_m: float, title: str, steps: tuple[float, ...]
) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from vsd_analytics.geometry.camera_views import plan_bounds

    areas = [a for a in site.areas if a.floor_id == floor.floor_id]
    plan = plan_bounds(floor)
    x0, y0, x1, y1 = plan or _extent(frame, [p for a in areas for p in a.polygon], cell_m)
    width, height = x1 - x0, y1 - y0
    # room for the circle of `_scale`, also below a floor hardly wider than it
    foot = max(0.12 * max(width, 0.6 * height), 1.25 * site.settings.distance_m)
    side = min(WIDTH_IN, (HEIGHT_MAX_IN - 1.0) * width / (height + foot))
    figure = Figure(figsize=(max(side, 6.0) + 2.2, max(side, 3.0) * (height + foot) / width + 0.8))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.02, 0.02, 0.78, 0.88))
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_xlim(x0, x1)
    axes.set_ylim(y0 - foot, y1)
    axes.set_title(_literal(title), loc="left", fontsize=13, color=INK, parse_math=False)
    _cells(axes, _inside(frame, plan, cell_m), cell_m=cell_m, steps=steps)
    if plan is not None and floor.plan is not None and floor.plan.suffix.lower() != ".svg":
        axes.imshow(_ink(floor.plan), extent=(x0, x1, y0, y1), origin="upper", interpolation="antialiased", zorder=2)
    axes.plot([x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0], color=HATCH, linewidth=0.8, zorder=3)
    named: list[Any] = []
    for area in areas:
        ring = [*area.polygon, area.polygon[0]]
        axes.plot([p[0] for p in ring], [p[1] for p in ring], color=MUTED, linewidth=1, linestyle=(0, (3, 3)), zorder=4)
        left, top = min(p[0] for p in ring), max(p[1] for p in ring)
        name = axes.annotate(
            _literal(area.name),
            (left, top),
            xytext=(2, 3),
            textcoords="offset points",
            fontsize=8,
            color=INK,
            zorder=5,
            parse_math=False,
            annotation_clip=True,
            bbox={"facecolor": WHITE, "alpha": 0.7, "edgecolor": "none", "pad": 0.8},
        )
        extent = name.get_window_extent()
        if any(extent.overlaps(other) for other in named):
            name.remove()  # two names over each other cannot be read
        else:
            named.append(extent)
    _scale(axes, site.settings.distance_m, (x0, y0 - foot, x1, y0))
    _legend(axes, steps, cell_m=cell_m)
    return figure


def _extent(frame: pd.DataFrame, corners: Sequence[tuple[float, float]], cell_m: float) -> Bounds:
    """Return the box around all cells and areas, with a cell to spare."""
    x, y = [p[0] for p in corners], [p[1] for p in corners]
    if len(frame):
        x += [float(frame["cx"].min()) * cell_m, float(frame["cx"].max() + 1) * cell_m]
        y += [float(frame["cy"].min()) * cell_m, float(frame["cy"].max() + 1) * cell_m]
    if not x:
        x, y = [0.0, 10.0], [0.0, 10.0]
    return min(x) - cell_m, min(y) - cell_m, max(x) + cell_m, max(y) + cell_m


def _inside(frame: pd.DataFrame, plan: Bounds | None, cell_m: float) -> pd.DataFrame:
    if plan is None:
        return frame
    x, y = frame["cx"] * cell_m, frame["cy"] * cell_m
    return frame[(x + cell_m > plan[0]) & (x < plan[2]) & (y + cell_m > plan[1]) & (y < plan[3])]


def _cells(axes: Axes, frame: pd.DataFrame, *, cell_m: float, steps: tuple[float, ...]) -> None:
    """Draw the classes; what is not in the frame stays clear."""
    import numpy as np
    from matplotlib.colors import BoundaryNorm, ListedColormap

    if not len(frame):
        return
    cx, cy = frame["cx"].to_numpy(dtype=np.int64), frame["cy"].to_numpy(dtype=np.int64)
    n_x, n_y = int(cx.max() - cx.min()) + 1, int(cy.max() - cy.min()) + 1
    if n_x * n_y > GRID_MAX:
        raise ReportError(
            f"a picture of {n_x:,} by {n_y:,} cells is too large",
            code="E500",
            fix="choose a greater --cell, or name a plan",
        )
    grid = np.full((n_y, n_x), np.nan)
    grid[cy - cy.min(), cx - cx.min()] = frame["records"].to_numpy(dtype=np.float64)
    colours = ListedColormap([NOBODY_CLOSE, *RAMP_LIGHT], name="steps")
    colours.set_bad(alpha=0)
    left, low = float(cx.min()) * cell_m, float(cy.min()) * cell_m
    axes.imshow(
        grid,
        cmap=colours,
        norm=BoundaryNorm([0.0, *steps, np.inf], colours.N),
        extent=(left, left + n_x * cell_m, low, low + n_y * cell_m),
        origin="lower",
        interpolation="nearest",
        zorder=1,
    )


def _ink(plan: Path) -> Any:
    """Return a plan as dark ink, clear where it is white: shape (height, width, 4), values 0 to 1."""
    import numpy as np
    from PIL import Image

    try:
        with Image.open(plan) as opened:
            picture = opened.convert("RGBA")
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise ReportError(
            f"the plan {plan.name} cannot be shown",
            code="E501",
            where=Where(str(plan)),
            why=str(error)[:200],
            fix="export it as PNG again and name that file in vsd.toml",
        ) from None
    picture.thumbnail((PLAN_MAX_PX, PLAN_MAX_PX))
    on_white = Image.alpha_composite(Image.new("RGBA", picture.size, WHITE), picture).convert("L")
    ink = np.zeros((*on_white.size[::-1], 4))
    ink[..., :3] = [int(INK[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    ink[..., 3] = 1.0 - np.asarray(on_white, dtype=np.float64) / 255.0
    return ink


def _scale(axes: Axes, distance_m: float, strip: Bounds) -> None:
    """Draw a bar of a round length at the right and a circle of the legal distance at the left, below the floor."""
    from matplotlib.patches import Circle

    x0, y0, x1, y1 = strip
    middle = (y0 + y1) / 2
    bar = nice_metres(x1 - x0)
    axes.plot([x1 - bar, x1], [middle, middle], color=INK, linewidth=3, solid_capstyle="butt")
    gap = (x1 - x0) / 100
    axes.text(x1 - bar - gap, middle, metres(bar), ha="right", va="center", fontsize=9, color=INK)
    radius = distance_m / 2
    axes.add_patch(Circle((x0 + radius + gap, middle), radius, fill=False, edgecolor=INK, linewidth=1.2))
    axes.text(x0 + 2 * radius + 2 * gap, middle, f"{metres(distance_m)} across", va="center", fontsize=9, color=INK)


def _legend(axes: Axes, steps: tuple[float, ...], *, cell_m: float) -> None:
    from matplotlib.patches import Patch

    ends = [*steps[1:], math.inf]
    labels = [f"{a:,.6g} or more" if b == math.inf else _between(a, b) for a, b in zip(steps, ends, strict=True)]
    none = "0" if steps[0] <= 1 else f"under {steps[0]:,.6g}"
    patches = [
        Patch(facecolor=colour, edgecolor=HATCH, linewidth=0.5, label=label)
        for colour, label in zip((*reversed(RAMP_LIGHT), NOBODY_CLOSE), (*reversed(labels), none), strict=True)
    ]
    patches.append(Patch(facecolor="none", edgecolor=HATCH, linewidth=0.5, linestyle=":", label="nobody seen"))
    legend = axes.legend(
        handles=patches,
        title=f"records per cell\nof {metres(cell_m)} by {metres(cell_m)}",
        loc="upper left",
        bbox_to_anchor=(1.01, 1.0),
        frameon=False,
        fontsize=9,
        title_fontsize=9,
        alignment="left",
    )
    legend.get_title().set_color(INK)


def _literal(text: str) -> str:
    """Return text on one line without control characters, which no SVG may hold."""
    return "".join(c if c.isprintable() else "\ufffd" for c in text)


def _between(low: float, high: float) -> str:
    """Return a class in words; whole numbers are counts, so the next class begins one above."""
    if low == int(low) and high == int(high):
        return f"{low:,.0f}" if high - low == 1 else f"{low:,.0f} to {high - 1:,.0f}"
    return f"{low:,.6g} to under {high:,.6g}"
