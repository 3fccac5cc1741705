"""Draws the four charts of docs/statistics.md from the tables of docs/methods/: `python docs/charts.py`.

A chart has no number of its own: each is read from the row named here, so that a table and its picture cannot differ.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import matplotlib as mpl
from matplotlib.figure import Figure

DOCS = Path(__file__).resolve().parent
METHODS = DOCS / "methods"
BEFORE, AFTER, INK, BAR = "#b9bdc4", "#1f5fa8", "#22262b", "#8a2f2f"
ON_WHITE: Final = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
_NUMBER: Final = re.compile(r"-?\d+(?:\.\d+)?")
STYLE: Final = {"svg.hashsalt": "charts", "svg.fonttype": "path", "font.size": 10.5, "font.family": "DejaVu Sans"}


def tables() -> str:
    """Return the text of all pages of methods, by name."""
    return "\n".join(path.read_text(encoding="utf-8") for path in sorted(METHODS.glob("*.md")))


def rows_of(text: str) -> list[list[str]]:
    """Return the cells of every table row of a page."""
    lines = (line for line in text.splitlines() if line.startswith("| "))
    return [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in lines]


def row(rows: Sequence[Sequence[str]], *starts: str) -> Sequence[str]:
    """Return the one row whose first cells are these; ValueError where none or several are."""
    found = [r for r in rows if tuple(r[: len(starts)]) == starts]
    if len(found) != 1:
        raise ValueError(f"{len(found)} rows of {METHODS.name} begin with {starts}")
    return found[0]


def number(cell: str) -> float | None:
    """Return the first number of a cell, None where it has none."""
    found = _NUMBER.search(cell)
    return float(found[0]) if found else None


def pairs_of_bars(
    labels: Sequence[str],
    before: Sequence[float | None],
    after: Sequence[float | None],
    *,
    title: str,
    bar: float | None = None,
    unit: str = "%",
) -> Figure:
    """Draw two horizontal bars for each label, before and after, and the promised limit as a line."""
    figure = Figure(figsize=(6.8, 0.62 * len(labels) + 1.3), layout="constrained")
    ax = figure.add_subplot()
    for i, (was, now) in enumerate(zip(before, after, strict=True)):
        for value, offset, colour in ((was, -0.19, BEFORE), (now, 0.19, AFTER)):
            if value is None:
                ax.text(0, i + offset, " not measured", va="center", color=INK, fontsize=9, bbox=ON_WHITE, zorder=3)
                continue
            ax.barh(i + offset, value, height=0.36, color=colour)
            ax.annotate(
                f"{value:g}{unit}", (value, i + offset), (5, 0), textcoords="offset points", va="center", color=INK,
                fontsize=9, bbox=ON_WHITE, zorder=3,
            )  # fmt: skip
    if bar is not None:
        ax.axvline(bar, color=BAR, linewidth=1.2, linestyle=(0, (4, 3)))
        ax.text(bar, -0.72, f" our limit: {bar:g} of 100", color=BAR, fontsize=9, va="center")
    ax.set_yticks(range(len(labels)), labels)
    ax.invert_yaxis()
    ax.set_ylim(len(labels) - 0.45, -1.0)
    high = max(v for v in (*before, *after, bar) if v is not None)
    ax.set_xlim(0, high * 1.14)
    ax.xaxis.set_visible(False)
    ax.spines[["top", "right", "bottom"]].set_visible(False)
    ax.tick_params(left=False)
    _titled(figure, title)
    handles = [mpl.patches.Patch(color=BEFORE, label="earlier method"), mpl.patches.Patch(color=AFTER, label="today")]
    ax.legend(handles=handles, loc="lower right", frameon=False, fontsize=9)
    return figure


def _titled(figure: Figure, title: str) -> None:
    figure.suptitle(title, x=0.01, ha="left", fontsize=11.5, fontweight="bold", color=INK)


def false_verdicts(rows: Sequence[Sequence[str]]) -> Figure:
    """Draw how often the floor gets a clear verdict in a week in which nothing changed."""
    worlds = {
        "independent days": "days differ by chance",
        "days correlated .4": "busy days come in a row",
        "week sd .05": "weeks differ by 5 %",
        "days correlated .3, week sd .10": "busy days in a row,\nweeks differ by 10 %",
        "office": "office",
        "museum": "museum",
    }
    found = [row(rows, f"M0, clear verdict, nothing changes: {name}") for name in worlds]
    return pairs_of_bars(
        list(worlds.values()),
        [number(r[3]) for r in found],
        [number(r[4]) for r in found],
        title="Of 100 weeks without a change: how many get a clear verdict (one figure)",
        bar=6,
        unit="",
    )


def a_year(rows: Sequence[Sequence[str]]) -> Figure:
    """Draw how many false verdicts a year a reader meets."""
    found = [
        row(rows, f"false verdicts a year, 9 places x 2 figures (M0, M6): {name}") for name in ("office", "museum")
    ]
    return pairs_of_bars(
        ["office", "museum"],
        [number(r[3]) for r in found],
        [number(r[4]) for r in found],
        title="False verdicts that one site reads in a year (of 936)",
        unit="",
    )


def weeks_to_tell(rows: Sequence[Sequence[str]]) -> Figure:
    """Draw how many weeks after a change most sites need to see it."""
    figure = Figure(figsize=(6.8, 2.9), layout="constrained")
    ax = figure.add_subplot()
    sites, effects = ("office", "shop", "museum"), ("-15%", "-30%", "-50%")
    for i, site in enumerate(sites):
        for k, effect in enumerate(effects):
            cell = row(rows, site, effect)[3]
            weeks, is_over = number(cell) or 0.0, cell.startswith("over")
            at, colour = i + (k - 1) * 0.27, ("#7fa8d6", "#3f7cc0", "#14427c")[k]
            ax.barh(at, weeks, height=0.24, color=colour, hatch="//" if is_over else None, edgecolor="white")
            ax.text(weeks, at, f" {_weeks(effect, cell)}", va="center", fontsize=9, color=INK)
    ax.set_yticks(range(len(sites)), sites)
    ax.invert_yaxis()
    ax.set_xlim(0, 38)
    ax.xaxis.set_visible(False)
    ax.spines[["top", "right", "bottom"]].set_visible(False)
    ax.tick_params(left=False)
    _titled(figure, "Weeks after a change until a true fall is clear")
    return figure


def _weeks(effect: str, cell: str) -> str:
    """Return an effect and its weeks in words: 30 % less: 2 weeks."""
    weeks = cell.split(" (", maxsplit=1)[0].replace("over", "more than")
    return f"{effect[1:-1]} % less: {weeks} week{'' if weeks == '1' else 's'}"


def hotspots(rows: Sequence[Sequence[str]]) -> Figure:
    """Draw how often a floor without a special place has a hotspot, and how often a planted one is found."""
    false = {
        "risk grows with density, nobody differs": "false: only crowded",
        "couples cross a corridor": "false: only couples",
        "patches, days correlated .8": "false: closeness comes\nand goes over days",
        "planted 2.5, days correlated .8": "false: the same,\nbeside a real hotspot",
    }
    gone = {"planted 2.5, fixed a week ago": "false: the hotspot was\nremoved a week ago"}
    real = {
        "planted 2.5": "real: found",
        "planted 2.5, days correlated .8": "real, closeness comes\nand goes over days: found",
    }
    bars = [(label, name, 2, BAR) for name, label in false.items()]
    bars += [(label, name, 3, BAR) for name, label in gone.items()]
    bars += [(label, name, 3, AFTER) for name, label in real.items()]
    values = [number(row(rows, name)[column]) or 0.0 for _, name, column, _ in bars]
    figure = Figure(figsize=(6.8, 4.1), layout="constrained")
    ax = figure.add_subplot()
    ax.barh(range(len(bars)), values, height=0.6, color=[colour for *_, colour in bars])
    for i, value in enumerate(values):
        ax.text(value, i, f" {value:g} of 100", va="center", fontsize=9, color=INK)
    ax.set_yticks(range(len(bars)), [label for label, *_ in bars])
    ax.invert_yaxis()
    ax.set_xlim(0, 118)
    ax.xaxis.set_visible(False)
    ax.spines[["top", "right", "bottom"]].set_visible(False)
    ax.tick_params(left=False)
    _titled(figure, "Of 100 floors: a false hotspot shown, a real one found")
    return figure


CHARTS: Final = {
    "false-verdicts": false_verdicts,
    "false-verdicts-a-year": a_year,
    "weeks-to-tell": weeks_to_tell,
    "hotspots": hotspots,
}


def drawn(name: str) -> bytes:
    """Return a chart as SVG; the same table gives the same bytes."""
    from io import BytesIO

    with mpl.rc_context(STYLE):
        out = BytesIO()
        CHARTS[name](rows_of(tables())).savefig(out, format="svg", metadata={"Date": None})
    return out.getvalue()


def main() -> int:
    """Write all charts into docs/images/."""
    for name in CHARTS:
        (DOCS / "images" / f"{name}.svg").write_bytes(drawn(name))
    return 0


if __name__ == "__main__":
    sys.exit(main())
