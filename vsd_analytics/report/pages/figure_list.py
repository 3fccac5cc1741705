"""Further figures of the catalogue as rows of a table; `reports/wording/figures.toml` says which, and how."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from vsd_analytics.figures.week.results import Figure
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.figures_by_id import figures_by_id
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import has, say
from vsd_analytics.wording.reasons import reason_text

SHARE: Final = "share"


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureRow:
    """One figure: texts; `reason` replaces the value where there is none."""

    name: str
    value: str
    likely: str
    unit: str
    reason: str = ""


def further_figures(report: WeekReport) -> tuple[FigureRow, ...]:
    """Return figures of the catalogue that are nowhere else on the page, in its order; absent ones are left out."""
    named = [(key, figure) for key, figure in figures_by_id(report).items() if has(f"more.{key}.name")]
    return tuple(row for key, figure in named for row in _lines(report, key, figure))


def _lines(report: WeekReport, key: str, figure: Figure) -> Iterator[FigureRow]:
    unit = report.rules.distance_unit
    name = say(f"more.{key}.name", distance=fmt.distance(report.rules.distance_m, unit))
    if figure.state != "ok":
        reason = terms.sentence(reason_text(figure.reason) or say("words.too_little_data"))
        yield FigureRow(name=name, value="", likely="", unit="", reason=reason)
    elif not has(f"more.{key}.row"):
        yield from _line(key, name, {"value": figure.value, "lo": figure.lo, "hi": figure.hi})
    else:
        for row in figure.rows or ():
            yield from _line(key, say(f"more.{key}.row", plural=None, **_texts(row, unit)), row)
            if row.get("calibration_lo") is not None:
                yield _calibrated(row, unit)


def _calibrated(row: Mapping[str, Any], unit: str) -> FigureRow:
    """Return the ends of M26 at the legal distance if all distances are off by what the calibrations state."""
    name = say("more.M26.calibrated", distance_m=fmt.distance(row["distance_m"], unit))
    lo, hi = fmt.percent(row["calibration_lo"]), row["calibration_hi"]
    value = say("more.M26.from", low=lo) if hi is None else say("format.and", first=lo, last=fmt.percent(hi))
    return FigureRow(name=name, value=value, likely=fmt.MISSING, unit="")


def _line(key: str, name: str, row: Mapping[str, Any]) -> Iterator[FigureRow]:
    if (value := row.get("value", row.get(SHARE))) is None:
        return
    is_share = row.get("unit") == SHARE or not has(f"more.{key}.unit")
    write, lo, hi = fmt.percent if is_share else fmt.number, row.get("lo"), row.get("hi")
    likely = fmt.MISSING if lo is None or hi is None else say("format.and", first=write(lo), last=write(hi))
    yield FigureRow(name=name, value=write(value), likely=likely, unit="" if is_share else say(f"more.{key}.unit"))


def _text(name: str, value: Any, unit: str) -> str:
    if name.endswith("_m") and value is not None:
        return fmt.distance(value, unit)
    return fmt.number(value) if isinstance(value, float) else str(value)


def _texts(row: Mapping[str, Any], unit: str) -> dict[str, str]:
    """Return the columns of a row as texts: lengths in the page's unit, and `people` for the size of a cluster."""
    texts = {k: _text(k, v, unit) for k, v in row.items()}
    if "least" in row:
        least, most = row["least"], row["most"]
        texts["people"] = f"{least}+" if most is None else f"{least}" if most == least else f"{least}\u2013{most}"
    return texts
