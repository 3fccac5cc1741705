"""`vsd capacity`: for how much of the time areas and floors are full, and by how many people they are overfull."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.estimates import rate_dict, rate_text, with_limits
from vsd_analytics.cli.options import floor_option, json_option, range_options
from vsd_analytics.cli.output import emit_json, plain, rounded, table
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.queue import missed_hours
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.figures.capacities import CapacityUse
    from vsd_analytics.figures.periods import Period
    from vsd_analytics.stats.estimates import RateEstimate

_MINUTES = 60


@click.command()
@range_options
@floor_option
@json_option
@pass_project
def capacity(project: Project, week: str | None, days: str | None, floor_id: str | None, as_json: bool) -> int:
    """Print for how much of the open time areas and floors with a capacity are full, and by how many people too full.

    Time counts where all cameras that see the place recorded: without one of them, people are too few. On a floor only
    people in view count.

    Exit code 1: no place with a capacity was recorded.

    \b
    Example:
      vsd capacity --week last
      vsd capacity --range 2026-11-02..2026-11-15 --json
    """
    from vsd_analytics.cli.ranges import noted, period_with_history, purged_hours_notes, warn
    from vsd_analytics.errors import UsageError
    from vsd_analytics.figures.capacities import capacities
    from vsd_analytics.site.places import known_floor

    floor = known_floor(project.site, floor_id)
    areas = [a for a in project.site.areas if a.floor_id == floor.floor_id]
    if floor.capacity is None and all(a.capacity is None for a in areas):
        raise UsageError(
            f"floor {floor.floor_id!r} and its areas state no capacity",
            why="the use of a capacity is computed only for places that have one",
            fix="add capacity = 40 (people at once) to an [[area]] or a [[floor]] of vsd.toml",
        )
    with period_with_history(project, floor, week=week, days=days) as period:
        found = capacities(period)
        notes = purged_hours_notes(period.data.warehouse)
    if as_json:
        places = [_as_dict(c) for c in found]
        emit_json(noted({"first": period.first, "last": period.last, "places": places}, notes))
    else:
        warn(notes)
        click.echo(plain(_text(found, period)))
    return 0 if any(c.full.value is not None for c in found) else 1


def _as_dict(of: CapacityUse) -> dict[str, Any]:
    from vsd_analytics.site.model import Area

    shares = {"time_from_60_percent": of.busy, "time_from_100_percent": of.full, "time_over": of.over}
    printed: dict[str, Any] = rounded(
        {
            "area_id": of.place.area_id if isinstance(of.place, Area) else None,
            "floor_id": of.place.floor_id,
            "capacity": of.capacity,
            "people": rate_dict(of.people),
            **{name: rate_dict(share) for name, share in shares.items()},
            "surplus_people": rate_dict(of.surplus),
            "area_m2": of.area_m2,
            "person_time_by_room": [
                {"level": r.level, "density_from": r.density_from, "density_to": r.density_to, **rate_dict(r.share)}
                for r in of.room
            ],
            "recorded_share": of.recorded_share,
            "silent_cameras": of.silent_cameras,
            "unrecorded_hours": of.unrecorded_hours,
        }
    )
    return printed


def _text(found: tuple[CapacityUse, ...], period: Period) -> str:
    head = ("place", "capacity", "people", "time from 60 %", "from 100 %", "over", "person-minutes too many an hour")
    rows = [(*head, "recorded")]
    for c in found:
        shares = (_share(c.busy), _share(c.full), _share(c.over))
        use = (*shares, _surplus(c.surplus), f"{c.recorded_share:.0%}")
        rows.append((c.place.name, f"{c.capacity:,}", rate_text(c.people, digits=2), *use))
    lines = [f"Capacity, {period.first} to {period.last}", "", *table(rows)]
    for c in found:
        notes = [f"{c.place.name}: {line}" for line in _notes(c)]
        lines += ["", *notes] if notes else []
    return "\n".join(lines)


def _share(of: RateEstimate) -> str:
    return with_limits(of.value, of.lo, of.hi, "{:.1%}".format)


def _surplus(of: RateEstimate) -> str:
    return with_limits(of.value, of.lo, of.hi, lambda rate: f"{rate * _MINUTES:.2g}")


def _notes(of: CapacityUse) -> list[str]:
    lines = []
    if of.silent_cameras:
        lines.append(f"nothing was recorded by {', '.join(of.silent_cameras)}: without them people are not known")
    lines += missed_hours(of.unrecorded_hours)
    if of.area_m2 is not None and of.people.value:
        levels = ", ".join(f"{r.level} {_share(r.share)}" for r in of.room if r.share.value)
        lines.append(f"{of.area_m2:.0f} m2; people's time by Fruin's levels of service of walkways: {levels}")
    if of.people.value is not None and of.people.reason is not None:
        lines.append(reason_text(of.people.reason))
    return lines
