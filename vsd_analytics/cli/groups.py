"""`vsd groups`: who moves together, and what is left of the violations between groups."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.estimates import share_text, why_none, with_limits
from vsd_analytics.cli.options import json_option, range_options
from vsd_analytics.cli.output import emit_json, plain, rounded
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import purged_hours_notes, warehouse_of, warn
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.figures.groups import CameraLives, GroupReadings, Groups
    from vsd_analytics.stats.estimates import RateEstimate

_SIZES_SHOWN = 5
_RATES = (
    ("M0", "violations per open hour", "violation_rate"),
    ("M7", "violations per person-hour", "encounter_rate"),
)


@click.command()
@range_options
@click.option("--camera", "camera_id", metavar="CAMERA", help="Only this camera.")
@json_option
@pass_project
def groups(project: Project, week: str | None, days: str | None, camera_id: str | None, as_json: bool) -> int:
    """Print who moves together, and every count in two readings: all violations, and those between groups.

    Two people move together when they stay within reach of each other, for most of the time either is seen, while
    walking. The first reading still includes violations within groups. Where the engine's track ids are too
    short to know, the command says so and exits with 1. The JSON names the tracks of each group.

    \b
    Example:
      vsd groups --week last
      vsd groups --range 2026-11-09..2026-11-15 --camera cam-1 --json
    """
    from vsd_analytics.figures import groups as analysis

    with warehouse_of(project, week=week, days=days) as warehouse:
        warehouse.materialise("violations", "camera_hours")
        found = analysis.groups(warehouse, camera_id=camera_id)
        rules = purged_hours_notes(warehouse)
    if as_json:
        emit_json({**_as_dict(found), "notes": [*_notes(found), *rules]})
    else:
        warn(rules)
        click.echo(plain(_text(found)))
    return 0 if found.state == "ok" else 1


def _as_dict(found: Groups) -> dict[str, Any]:
    """Return the answer as JSON holds it: the groups first, then figures with unit, denominator, state and reason."""
    between = asdict(found.between)
    printed: dict[str, Any] = rounded(
        {
            "state": found.state,
            "reason": found.reason,
            "groups_by_size": {str(size): n for size, n in found.n_by_size.items()},
            "people_share": found.people_share,
            "violation_time_share": found.time_share,
            "between": {**between, "unit": "share", "denominator": "violations in opening hours"},
            "n_unknown": found.n_unknown,
            "readings": [_readings(r) for r in found.readings],
            "cameras": [asdict(c) for c in found.cameras],
            "accuracy": asdict(found.accuracy),
        }
    )
    rows = [
        {
            "date": g.day.isoformat(),
            "camera_id": g.camera_id,
            "tracks": list(g.tracks),
            "start": g.start.isoformat(timespec="milliseconds"),
            "end": g.end.isoformat(timespec="milliseconds"),
        }
        for g in found.groups
    ]
    return {"first": found.first.isoformat(), "last": found.last.isoformat(), "groups": rows, **printed}


def _readings(of: GroupReadings) -> dict[str, Any]:
    printed: dict[str, Any] = {"floor_id": of.floor_id}
    for name, unit, kind in _RATES:
        printed[name] = {"all": _rate(getattr(of, kind), unit), "between": _rate(getattr(of, f"{kind}_between"), unit)}
    return printed


def _rate(rate: RateEstimate, unit: str) -> dict[str, Any]:
    shown = {"value": rate.value, "lo": rate.lo, "hi": rate.hi, "n": rate.n_events, "denominator": rate.exposure_h}
    return {**shown, "unit": unit, "state": rate.state, "reason": rate.reason}


def _text(found: Groups) -> str:
    lines = [f"People together, {found.first} to {found.last}", ""]
    if found.state == "ok":
        lines += [*_group_lines(found), "", *_reading_lines(found), ""]
    else:
        lines += [why_none(found.state, found.reason), ""]
    lines += [*_camera_lines(found.cameras), "", _accuracy(found)]
    return "\n".join([*lines, *(f"note: {note}" for note in _notes(found))])


def _group_lines(found: Groups) -> list[str]:
    sizes = [f"{n:,} of {size}" for size, n in found.n_by_size.items() if size <= _SIZES_SHOWN]
    if larger := sum(n for size, n in found.n_by_size.items() if size > _SIZES_SHOWN):
        sizes.append(f"{larger:,} of more")
    n = sum(found.n_by_size.values())
    lines = [f"groups           {n:,}{': ' + ', '.join(sizes) if sizes else ''}"]
    if found.people_share is not None:
        lines.append(f"people in them   {found.people_share:.0%} of person-time")
    if found.time_share is not None:
        lines.append(f"within groups    {found.time_share:.0%} of the time pairs were in violation")
    return lines


def _reading_lines(found: Groups) -> list[str]:
    share = found.between
    if share.value is None:
        return [f"between groups   {reason_text(share.reason)}"]
    lines = [
        f"between groups   {share.n:,} of {share.of:,} violations in opening hours: {share_text(share)}"
        + (f"; {reason_text(share.reason)}" if share.reason else "")
    ]
    for r in found.readings:
        lines += ["", f"{f'floor {r.floor_id}' if len(found.readings) > 1 else '':<28}  {'all':<22}  between groups"]
        for _, unit, kind in _RATES:
            both = getattr(r, kind), getattr(r, f"{kind}_between")
            printed = (
                f"{_number(both[0]):<22}  {_number(both[1])}"
                if both[0].rate is not None
                else f"– ({reason_text(both[0].reason)})"
            )
            lines.append(f"{unit:<28}  {printed}")
    return lines


def _number(rate: RateEstimate) -> str:
    return with_limits(rate.value, rate.lo, rate.hi, "{:.3g}".format)


def _camera_lines(cameras: tuple[CameraLives, ...]) -> list[str]:
    width = max([len("camera"), *(len(c.camera_id) for c in cameras)])
    lines = [f"{'camera':<{width}}  {'tracks':>8}  {'median life':>11}  {'20 s or more':>12}  {'ids cut':>7}"]
    for c in cameras:
        k = c.lives
        life = "–" if k.median_life_s is None else f"{k.median_life_s:.1f} s"
        shares = ["–" if v is None else f"{v:.0%}" for v in (k.long_share, k.cut_share)]
        why = "" if k.state == "ok" else f"  left out: {reason_text(k.reason)}"
        lines.append(f"{c.camera_id:<{width}}  {k.n_tracks:>8,}  {life:>11}  {shares[0]:>12}  {shares[1]:>7}{why}")
    return lines


def _accuracy(found: Groups) -> str:
    a = found.accuracy
    return (
        f"known accuracy: on {reason_text(a.scenes)}, F1 of pairs {a.f1[0]:.2f} to {a.f1[1]:.2f}; of the "
        f"violation time called within groups {a.time_precision[0]:.0%} to {a.time_precision[1]:.0%} is, and "
        f"{a.time_recall[0]:.0%} to {a.time_recall[1]:.0%} of what is, is found; {reason_text(a.weakness)} "
        "(docs/statistics.md)"
    )


def _notes(found: Groups) -> list[str]:
    notes = []
    if found.n_unknown:
        notes.append(f"of {found.n_unknown:,} violations it cannot be known whether they are within a group")
    short = [c.camera_id for c in found.cameras if c.lives.state == "ok" and (c.lives.long_share or 0) < 0.5]
    if short:
        notes.append(f"track ids live short at {', '.join(short)}, but are not cut: taken as short visits")
    return notes
