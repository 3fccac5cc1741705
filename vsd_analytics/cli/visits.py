"""`vsd visits`: how many people visit an area, and how long they stay."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.answer import Reason
from vsd_analytics.cli.estimates import rate_text, share_text
from vsd_analytics.cli.options import floor_option, json_option, range_options
from vsd_analytics.cli.output import emit_json, plain, rounded, table
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.answer import Reason
    from vsd_analytics.figures.periods import Period
    from vsd_analytics.figures.visits import AreaVisits
    from vsd_analytics.stats.durations import QuantileEstimate
    from vsd_analytics.stats.dwell import LittleCheck

_MINUTE_S = 60
_SHOWN_BELOW_S = 90


@click.command()
@range_options
@floor_option
@json_option
@pass_project
def visits(project: Project, week: str | None, days: str | None, floor_id: str | None, as_json: bool) -> int:
    """Print how many people visit an area and how long they stay (dwell time), of areas with visits = true.

    A visit counts where its entry was seen. A track that is lost inside shows that the person stayed at least that
    long (Kaplan-Meier); one that begins inside tells nothing. Little's law gives the mean stay without track ids:
    where the two disagree, the command says so.

    Exit code 1: no area asks for visits, or none has enough of them.

    \b
    Example:
      vsd visits --week last
      vsd visits --range 2026-11-02..2026-11-15 --json
    """
    from vsd_analytics.cli.ranges import noted, period_with_history, purged_hours_notes, warn
    from vsd_analytics.errors import UsageError
    from vsd_analytics.figures import visits as figures
    from vsd_analytics.site.places import known_floor

    floor = known_floor(project.site, floor_id)
    if not any(a.has_visits for a in project.site.areas if a.floor_id == floor.floor_id):
        raise UsageError(
            f"no area of floor {floor.floor_id!r} asks for visits",
            why="visits are computed only for areas that ask for them",
            fix="add visits = true to an [[area]] of vsd.toml; door = true where people come and go",
        )
    with period_with_history(project, floor, week=week, days=days) as period:
        found = figures.visits(period)
        notes = purged_hours_notes(period.data.warehouse)
    if as_json:
        below = int(project.site.settings.mask_below)
        areas = [_as_dict(v, below) for v in found]
        emit_json(noted({"first": period.first, "last": period.last, "areas": areas}, notes))
    else:
        warn(notes)
        click.echo(plain(_text(found, period)))
    return 0 if any(v.dwell.state == "ok" for v in found) else 1


def _as_dict(of: AreaVisits, below: int) -> dict[str, Any]:
    """Return visits as the JSON output has them: counts of 1 to `below` - 1, and what gives them away, are null."""
    often, dwell = of.often, of.dwell

    def shown(n: int) -> int | None:
        return n if n == 0 or n >= below else None

    is_small = shown(dwell.n_visits) is None
    hidden = Reason("hidden.visits", least=below) if is_small else None
    n_whole = dwell.n_visits - dwell.n_cut
    n_cut = None if shown(n_whole) is None or is_small else shown(dwell.n_cut)
    rate = (None, None, None, None) if is_small else (often.value, often.lo, often.hi, often.n_events)
    per_open_h = dict(zip(("value", "lo", "hi", "n"), rate, strict=True))
    long_n = None if dwell.long_share.value is None else round(dwell.long_share.value * dwell.n_visits)
    is_long_small = long_n is not None and None in (shown(long_n), shown(dwell.n_visits - long_n))
    long = (None, None, None) if is_long_small else (dwell.long_share.value, dwell.long_share.lo, dwell.long_share.hi)
    long_share = dict(zip(("value", "lo", "hi"), long, strict=True))
    printed: dict[str, Any] = rounded(
        {
            "area_id": of.area.area_id,
            "visits_per_open_h": {**per_open_h, "state": often.state,
                                  "reason": hidden or often.reason},
            "dwell_median_s": asdict(dwell.median),
            "dwell_p90_s": asdict(dwell.p90),
            "long_share": {"longer_than_s": of.long_visit_s, **long_share,
                           "reason": hidden or dwell.long_share.reason},
            "little": None if is_small else asdict(dwell.little),
            "n_visits": shown(dwell.n_visits),
            "n_cut": n_cut,
            "n_began_inside": shown(of.n_began_inside),
            "n_days": dwell.n_days,
            "recorded_share": of.recorded_share,
            "silent_cameras": of.silent_cameras,
            "state": dwell.state,
            "reason": hidden or dwell.reason,
        }
    )  # fmt: skip
    return printed


def _text(found: tuple[AreaVisits, ...], period: Period) -> str:
    rows = [("area", "visits per open hour", "median stay", "90 % leave within", "stay longer than", "recorded")]
    rows += [
        (
            v.area.name,
            rate_text(v.often),
            time_text(v.dwell.median),
            time_text(v.dwell.p90),
            _long(v),
            f"{v.recorded_share:.0%}",
        )
        for v in found
    ]
    lines = [f"Visits, {period.first} to {period.last}", "", *table(rows)]
    for v in found:
        lines += ["", *(f"{v.area.name}: {line}" for line in _notes(v))]
    return "\n".join(lines)


def time_text(of: QuantileEstimate) -> str:
    """Return a quantile of times with its limits, or a dash."""
    if of.value is None:
        return "–"
    if of.lo is None:
        return seconds(of.value)
    limits = f"{seconds(of.lo)} to {seconds(of.hi)}" if of.hi is not None else f"at least {seconds(of.lo)}"
    return f"{seconds(of.value)} ({limits})"


def seconds(value_s: float) -> str:
    """Return a time in seconds, from a minute and a half on in minutes."""
    return f"{value_s:.0f} s" if value_s < _SHOWN_BELOW_S else f"{value_s / _MINUTE_S:.1f} min"


def _long(of: AreaVisits) -> str:
    return f"{seconds(of.long_visit_s)}: {share_text(of.dwell.long_share)}"


def _notes(of: AreaVisits) -> list[str]:
    dwell = of.dwell
    lines = [
        f"{dwell.n_visits:,} entries seen on {dwell.n_days} days; {dwell.n_cut:,} of these visits end with a lost "
        f"track, {of.n_began_inside:,} tracks begin inside"
    ]
    if dwell.reason is not None:
        lines.append(reason_text(dwell.reason))
    if of.silent_cameras:
        lines.append(f"nothing was recorded by {', '.join(of.silent_cameras)}: visits there are not known")
    return [*lines, *mean_stay(dwell.little, known=dwell.reason)]


def mean_stay(little: LittleCheck, *, known: Reason | None) -> list[str]:
    """Return a line on the mean stay by tracks beside the one by Little's law; none where `known` says why not."""
    if little.value is None or little.by_tracks.value is None or little.by_little.value is None:
        if little.by_tracks.reason is not None and little.by_tracks.reason != known:
            return [f"mean stay not known: {reason_text(little.by_tracks.reason)}"]
        return []
    tracks, by_little = (seconds(m.value) for m in (little.by_tracks, little.by_little) if m.value is not None)
    said = f"mean stay by tracks {tracks}, by Little's law (person-time / entries) {by_little}"
    if little.agrees is False:
        way = (
            "not all entries were seen, or people who stay are lost"
            if little.value > 1
            else "one person enters several times, as when ids change at the border"
        )
        said += f": they disagree, so neither is certain. Likely {way}"
    return [said]
