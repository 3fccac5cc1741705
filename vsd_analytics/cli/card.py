"""The card of a source: what `vsd check` and the first `vsd ingest` of a new kind of file say they understood."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.output import count, plain, rounded

if TYPE_CHECKING:
    from vsd_analytics.cli.project import Project
    from vsd_analytics.ingest.checks.sample import Extent
    from vsd_analytics.ingest.checks.understanding import SourceProfile

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_WIDTH = 10
_PICTURE = "vsd check --picture where.svg shows whether it is so"


def print_card(project: Project, card: SourceProfile) -> None:
    """Print what was understood of a source: columns, units, extent, ids, times, and its first rows."""
    for label, text in _lines(project, card):
        click.echo(plain(f"    {label:<{_WIDTH}}{text}".rstrip()))


def card_as_dict(project: Project, card: SourceProfile) -> dict[str, Any]:
    """Return the key `card` of `--json`: instants as ISO 8601 in the site's zone, unknown is null."""
    fields = rounded(asdict(card))
    for key in ("first", "last"):
        ms = fields.pop(f"{key}_ms")
        fields[key] = None if ms is None else local_time(project, ms).replace(" ", "T")
    for row in fields["rows"]:
        row["ours"]["ts"] = local_time(project, int(row["ours"].pop("ts_ms"))).replace(" ", "T")
    return dict(fields)


def local_time(project: Project, ms: int) -> str:
    """Return an instant in the site's zone to the second; beyond the years of the calendar, its milliseconds."""
    try:
        local = (_EPOCH + timedelta(milliseconds=ms)).astimezone(project.site.zone)
    except OverflowError:
        return f"{ms:,} ms"
    return local.isoformat(sep=" ", timespec="seconds")


def _lines(project: Project, card: SourceProfile) -> list[tuple[str, str]]:
    lines = []
    if card.profile is not None:
        lines.append(("profile", f"{card.profile} ([[source]] in vsd.toml)"))
    if card.columns:
        uses = [f"{c.ours} <- {c.theirs[:40]}{_unit(c.unit)}" for c in card.columns]
        lines.append(("columns", ", ".join(uses)))
        lines.append(("ignored", ", ".join(name[:40] for name in card.ignored[:30]) or "none"))
    if card.missing:
        lines.append(("missing", ", ".join(card.missing)))
    if card.confidence is not None and card.confidence_limit is not None:
        from vsd_analytics.ingest.checks.check_case import quoted

        name = card.confidence[:40]
        lines.append(("", f'{name} can be a limit: --where "{quoted(name)} >= {card.confidence_limit:g}"'))
    if card.floor_m is not None:
        floor = _extent(card.floor_m, "x", "y", digits=1, unit=" m") + _trimmed(card)
        lines.append(("floor", floor + _beside(card.floor_bounds_m)))
        lines += _unseen(card)
    if card.pixels is not None:
        size = "" if card.picture_px is None else f"; picture {card.picture_px[0]} x {card.picture_px[1]} px"
        digits = 0 if max(map(abs, card.pixels)) > 10 else 2
        lines.append(("picture", _extent(card.pixels, "u", "v", digits=digits, unit=" px") + _trimmed(card) + size))
        box = ", boxes by their upper left corner" if any(c.ours == "left" for c in card.columns) else ""
        lines.append(("", f"taken for granted: u grows to the right, v downwards, to people's feet{box}; {_PICTURE}"))
    if card.cameras:
        scope = "" if card.is_whole else f", in the first {count(card.n_records, 'record')}"
        lines.append(("cameras", ", ".join(f"{name[:40]} ({n:,})" for name, n in card.cameras.items()) + scope))
    if card.n_ids:
        lasting = "" if card.life_s is None else f"; half of them last {card.life_s:,.1f} s or longer"
        lines.append(("ids", f"{card.n_ids:,}{lasting}"))
    if card.interval_s is not None:
        lines.append(("frames", f"every {card.interval_s:,.3g} s"))
    if card.first_ms is not None and card.last_ms is not None:
        lines.append(("times", f"{local_time(project, card.first_ms)} to {local_time(project, card.last_ms)}"))
        lines.append(("zone", _zone(card)))
    if card.time_format is not None:
        lines.append(("", f"written as {card.time_format}"))
    lines.append(("rows", _counts(card)))
    lines += [(f"line {row['line']}", _row(project, row)) for row in card.rows]
    return lines


def _unit(unit: str | None) -> str:
    return "" if unit is None else f" ({unit})" if unit == "m" else f" ({unit}, converted to m)"


def _extent(extent: Extent, across: str, up: str, *, digits: int, unit: str) -> str:
    least, most, low, high = (f"{value:,.{digits}f}" for value in extent)
    return f"{across} {least} to {most}{unit}, {up} {low} to {high}{unit}"


def _unseen(card: SourceProfile) -> list[tuple[str, str]]:
    """Return what is assumed of positions and no number tells, with what shows it."""
    lines = [
        ("", "taken for granted: x grows to the right, y upwards; vsd check --picture where.svg shows whether it is so")
    ]
    if card.speed_m_s is not None:
        walk = f"half of the steps of a second or longer are slower than {card.speed_m_s:.2f} m/s"
        lines.append(("speed", f"{walk}; yards and metres (9 %) cannot be distinguished by it"))
    return lines


def _trimmed(card: SourceProfile) -> str:
    """Return what an extent leaves out, so that a row outside it does not look like a mistake."""
    return " (without 1 % at each end, at least one row)" if card.n_records > 1 else ""


def _beside(bounds: Extent | None) -> str:
    if bounds is None:
        return " (no plan or view to compare with)"
    return f"; plan or view {_extent(bounds, 'x', 'y', digits=1, unit=' m')}"


def _zone(card: SourceProfile) -> str:
    if card.zone is None:
        return "every time has an offset"
    says = {
        "--zone": "as --zone says",
        "profile": "as its profile says",
        "clock": "as clock in vsd.toml says",
        "assumed": "assumed",
    }
    return f"times without an offset are {card.zone}, {says[card.zone_from or 'assumed']}"


def _counts(card: SourceProfile) -> str:
    parts = [f"{count(card.n_records, 'record')}{'' if card.is_whole else ' at the beginning'}"]
    parts += [f"{count(card.n_second, 'second sighting')}"] if card.n_second else []
    parts += [f"left out: {n:,} {reason}" for reason, n in sorted(card.n_dropped.items())]
    parts += [f"{card.n_rejected:,} bad"] if card.n_rejected else []
    return ", ".join(parts)


def _row(project: Project, row: Any) -> str:
    ours = row["ours"]
    parts = [str(ours["camera"]), local_time(project, int(ours["ts_ms"]))]
    parts += [f"id {ours['track']}"] if ours["track"] is not None else []
    parts += [f"x {ours['x']:,.2f} m, y {ours['y']:,.2f} m"] if None not in (ours["x"], ours["y"]) else []
    parts += [f"u {ours['u']:,.0f}, v {ours['v']:,.0f}"] if None not in (ours["u"], ours["v"]) else []
    parts += [f"distance {ours['distance_m']:,.2f} m"] if ours["distance_m"] is not None else []
    theirs = " ".join(str(cell)[:30] for cell in row["theirs"].values())
    return (f"{theirs} -> " if theirs else "") + ", ".join(part[:60] for part in parts)
