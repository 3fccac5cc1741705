"""`vsd compare`: did it change, by how much, and were the reasons people, layout or behaviour."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import date, timedelta
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.answer import Reason
from vsd_analytics.cli.compare_text import ENCOUNTERS, change, figure, level, percent, ratio
from vsd_analytics.cli.estimates import why_none, with_limits
from vsd_analytics.cli.options import floor_option, json_option
from vsd_analytics.cli.output import emit_json, plain, rounded, table
from vsd_analytics.cli.project import Project, pass_project, warn_of_broken_log_lines
from vsd_analytics.cli.ranges import last_monday, purged_hours_notes, warehouse_of, warn
from vsd_analytics.errors import UsageError
from vsd_analytics.site.instants import parse_range, parse_week
from vsd_analytics.wording.reasons import reason_text, text_or_none, verdict_text

if TYPE_CHECKING:
    from vsd_analytics.figures.before_after import BeforeAfterFigure
    from vsd_analytics.figures.compare import Comparison, PlaceChange
    from vsd_analytics.stats.estimates import RateEstimate


@click.command()
@click.argument("periods", nargs=-1, metavar="[A B]")
@click.option("--change", "number", type=click.IntRange(min=1), metavar="N", help="Entry of the log: see vsd log list.")
@click.option("--area", "area_ids", metavar="ID", multiple=True, help="Only this area; may be given several times.")
@floor_option
@click.option(
    "--weeks", type=click.IntRange(1, 26), default=4, show_default=True, help="With --change: weeks on either side."
)
@json_option
@pass_project
def compare(
    project: Project,
    periods: tuple[str, ...],
    number: int | None,
    area_ids: tuple[str, ...],
    floor_id: str | None,
    weeks: int,
    as_json: bool,
) -> int:
    """Compare two periods over the same hours, or the weeks before and after a change of the log.

    A and B are ISO weeks, `last`, `last-2`, or ranges of days. Days are paired by weekday, and only camera-hours that
    were recorded in both count. Prints violations per open hour, time too close, people, encounters per person-hour,
    and which of them made the change.

    With --change N, compares the area of entry N of the log before and after, relative to areas that were left
    alone (difference in differences), so that a change of the whole site does not look like an effect. Beside it: a
    verdict that may be read every week, what became of the whole floor, and how a plan (vsd plan) came out.

    Exit code 1: the periods cannot be compared; the message says why.

    \b
    Example:
      vsd compare last-1 last
      vsd compare 2026-11-02..2026-11-08 2026-11-09..2026-11-15 --area entrance --json
      vsd compare --change 1
    """
    if number is not None:
        if periods or floor_id is not None or len(area_ids) > 1:
            raise UsageError("--change takes its weeks from the log, and one area", fix="vsd compare --change 1")
        return _change_of_log(project, number, area_ids[0] if area_ids else None, weeks, as_json=as_json)
    if len(periods) != 2:
        raise UsageError("compare needs two periods, A and B, or --change N", fix="vsd compare 2026-W45 2026-W46")
    return _two_periods(project, periods, area_ids, floor_id, as_json=as_json)


def _two_periods(
    project: Project, periods: tuple[str, ...], area_ids: tuple[str, ...], floor_id: str | None, *, as_json: bool
) -> int:
    from vsd_analytics.figures import compare as analysis

    a, b = (_days(project, text) for text in periods)
    first, last = analysis.days_needed(project.site, a, b)
    with warehouse_of(project, week=None, days=f"{first}..{last}") as warehouse:
        warehouse.materialise("violations", "camera_hours", "area_hours")
        found = analysis.compare(warehouse, a, b, floor_id=floor_id, area_ids=area_ids)
        rules = purged_hours_notes(warehouse)
    _print(found, _text(found), rules, as_json=as_json)
    return 0 if found.state == "ok" else 1


def _change_of_log(project: Project, number: int, area_id: str | None, weeks: int, *, as_json: bool) -> int:
    from vsd_analytics.cli.compare_text import change_text, score_text
    from vsd_analytics.config.plans import read_plans
    from vsd_analytics.figures.before_after import before_after
    from vsd_analytics.figures.change_weeks import days_needed
    from vsd_analytics.figures.experiments import score

    warn_of_broken_log_lines(project)
    first, last = days_needed(project.site, number, weeks=weeks)
    with warehouse_of(project, week=None, days=f"{first}..{last}") as warehouse:
        warehouse.materialise("violations", "camera_hours", "area_hours")
        found = before_after(warehouse, number, area_id=area_id, weeks=weeks)
        rules = purged_hours_notes(warehouse)
    scored = score(found, read_plans(project.site), zone_day=found.at.astimezone(project.site.zone).date())
    text = change_text(found) if scored is None else f"{change_text(found)}\n\n{score_text(scored)}"
    if as_json:
        made = {**_spelled(asdict(found)), "plan": None if scored is None else asdict(scored)}
        emit_json(rounded({**made, "notes": [*found.notes, *rules]}))
    else:
        _print(found, text, rules, as_json=False)
    return 0 if found.state == "ok" else 1


def _print(found: Comparison | BeforeAfterFigure, text: str, rules: Sequence[str], *, as_json: bool) -> None:
    if as_json:
        emit_json(rounded({**_spelled(asdict(found)), "notes": [*found.notes, *rules]}))
        return
    warn(rules)
    click.echo(plain(text))


def _spelled(value: Any) -> Any:
    """Return nested dictionaries with codes as the command has always written them: "clear fall"."""
    spelled: dict[str, Callable[[Any], Any]] = {
        "verdict": verdict_text,
        "design": lambda design: Reason(f"design.{design}"),
    }
    if isinstance(value, dict):
        return {k: spelled.get(k, _spelled)(v) for k, v in value.items()}
    return [_spelled(v) for v in value] if isinstance(value, list | tuple) else value


def _days(project: Project, text: str) -> tuple[date, date]:
    if text.startswith("last"):
        monday = parse_week(text, last=last_monday(project))
        return monday, monday + timedelta(days=6)
    return parse_range(text)


def _text(found: Comparison) -> str:
    shares = ["closed" if p.coverage is None else f"{p.coverage:.0%}" for p in (found.a, found.b)]
    lines = [
        f"{found.floor_name}: {found.a.first} to {found.a.last} (A) and {found.b.first} to {found.b.last} (B)",
        f"recorded of the open hours: A {shares[0]}, B {shares[1]}",
    ]
    if found.state != "ok":
        return "\n".join([*lines, "", why_none(found.state, found.reason), *_notes(found)])
    lines.append(f"compared: {found.n_pairs} pairs of days, {found.hours_compared:,.1f} camera-hours recorded in both")
    floor = found.places[0]
    if any(
        round(rate.exposure_h - found.hours_compared, 1) > 0
        for rate in (floor.violation_rate_a, floor.violation_rate_b)
    ):
        lines.append("columns A and B hold all recorded hours of each period, B against A those recorded in both")
    lines += ["", *_place(found.places[0]), "", *_mixing(found)]
    if found.places[1:]:
        lines += ["", *_areas(found.places[1:])]
    return "\n".join([*lines, *_notes(found)])


def _place(place: PlaceChange) -> list[str]:
    split = place.split
    rows = [
        ("", "A", "B", "B against A", "verdict"),
        ("violations per open hour", level(place.violation_rate_a), level(place.violation_rate_b),
         *change(split.violation_rate)),
        ("share of time too close", _share_level(place.close_time_share_a), _share_level(place.close_time_share_b),
         *change(place.close_time_share)),
        ("person-minutes too close per open hour", level(place.burden_a), level(place.burden_b), *change(place.burden)),
        ("people in view", figure(split.people.rate_a), figure(split.people.rate_b), *change(split.people)),
        (ENCOUNTERS, level(place.encounter_rate_a), level(place.encounter_rate_b), *change(split.encounter_rate)),
    ]  # fmt: skip
    lines = table(rows)
    if split.people_share is not None and split.people.change is not None and split.encounter_rate.change is not None:
        lines += [
            "",
            f"Of the change {percent(split.violation_rate.change)}: people {percent(split.people.change)}, "
            f"encounters per person-hour {percent(split.encounter_rate.change)}. {_share(split.people_share)}",
        ]
    return lines


def _mixing(found: Comparison) -> list[str]:
    made = found.mixing
    if made is None or made.state != "ok" or made.behaviour is None:
        reason = "" if made is None else str(text_or_none(made.reason))
        return [f"crowding, layout, behaviour: {reason}"]
    close, crowding, layout = ratio(made.close), ratio(made.crowding), ratio(made.layout)
    change_text, verdict = change(made.behaviour)
    rows = [
        ("time that pairs spend close", close, "", ""),
        ("  crowding: two people present at once", crowding, _part(made.crowding_share), ""),
        ("  layout: they would meet by where they stand", layout, _part(made.layout_share), ""),
        ("  behaviour: they stay together or keep apart", change_text, _part(made.behaviour_share), verdict),
    ]
    return table(rows)


def _part(share: float | None) -> str:
    return "" if share is None else f"{share:.0%} of it"


def _share(people: float) -> str:
    if people < 0:
        return "People moved the other way."
    if people > 1:
        return "Encounters per person-hour moved the other way."
    return f"People explain {people:.0%} of it."


def _share_level(rate: RateEstimate) -> str:
    """Return a share with its interval in percent, or why there is none."""
    missing = reason_text(rate.reason) or "–"
    return with_limits(rate.value, rate.lo, rate.hi, lambda share: f"{100 * share:.3g}%", missing=missing)


def _areas(places: Sequence[PlaceChange]) -> list[str]:
    rates = ("violations per open hour: A", "B", "B against A", "verdict")
    rows: list[tuple[str, ...]] = [("area", *rates, "share of time too close", "verdict", "people")]
    reasons = []
    for place in places:
        name = place.name if isinstance(place.name, str) else reason_text(place.name)
        violation_rate, close = place.split.violation_rate, place.close_time_share
        levels = (figure(place.violation_rate_a.value), figure(place.violation_rate_b.value))
        changed = (
            change(violation_rate)[0],
            verdict_text(violation_rate.verdict),
            change(close)[0],
            verdict_text(close.verdict),
        )
        rows.append((name, *levels, *changed, percent(place.split.people.change)))
        unknown = [
            (word, e.reason) for word, e in (("violations", violation_rate), ("time too close", close)) if e.reason
        ]
        reasons += [f"{name}, {word}: {reason_text(why)}" for word, why in unknown]
    return [*table(rows), *reasons]


def _notes(found: Comparison) -> list[str]:
    notes = [reason_text(note) for note in found.notes]
    if found.days_left_out:
        notes.append(f"without a partner of its weekday: {', '.join(map(str, found.days_left_out))}")
    notes += [f"camera {c} is not compared: {reason_text(why)}" for c, why in found.cameras_left_out.items()]
    return ["", *(f"note: {note}" for note in notes)] if notes else []
