"""What `vsd compare` prints of a change: numbers, tables, and what a change of the log did."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vsd_analytics.cli.estimates import why_none, with_limits
from vsd_analytics.cli.output import plain, table
from vsd_analytics.wording.reasons import reason_text, verdict_text

if TYPE_CHECKING:
    from vsd_analytics.figures.before_after import BeforeAfterFigure
    from vsd_analytics.figures.experiments import PlanScore
    from vsd_analytics.stats.before_after import BeforeAfter
    from vsd_analytics.stats.estimates import ChangeEstimate, RateEstimate
    from vsd_analytics.stats.running_verdict import RunningVerdict


ENCOUNTERS = "encounters per person-hour"


def figure(value: float | None) -> str:
    """Return a number to three digits, or a dash."""
    return "–" if value is None else f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def percent(share: float | None) -> str:
    """Return a relative change, such as -14%, or a dash."""
    return "–" if share is None else f"{share:+.0%}"


def ratio(theta: float | None, lo: float | None = None, hi: float | None = None) -> str:
    """Return a ratio as a relative change with its interval: -14% (-20% to -8%)."""
    text = percent(None if theta is None else theta - 1)
    if lo is None and hi is None:
        return text
    return f"{text} ({percent((lo or 0.0) - 1)} to {'any' if hi is None else percent(hi - 1)})"


def level(rate: RateEstimate) -> str:
    """Return a rate with its interval, or why there is none."""
    return with_limits(rate.value, rate.lo, rate.hi, figure, missing=reason_text(rate.reason) or "–")


def change(estimate: ChangeEstimate) -> tuple[str, str]:
    """Return a change with its interval, and its verdict with the reason."""
    why = f": {reason_text(estimate.reason)}" if estimate.reason else ""
    return ratio(estimate.value, estimate.lo, estimate.hi), f"{verdict_text(estimate.verdict)}{why}"


def change_text(found: BeforeAfterFigure) -> str:
    """Return what a change of the log did, for a person."""
    lines = [f"change {found.number} of the log, {found.at:%Y-%m-%d %H:%M}: {_quoted(found.text)}"]
    if (w := found.windows) is not None:
        weeks = "1 week" if w.n_weeks == 1 else f"{w.n_weeks} weeks"
        out = "" if w.left_out is None else f"; left out: {w.left_out[0]} to {w.left_out[1]}"
        lines.append(
            f"{found.area_name}, {weeks} before ({w.before[0]} to {w.before[1]}) "
            f"and after ({w.after[0]} to {w.after[1]}){out}"
        )
    if found.state != "ok":
        return "\n".join([*lines, "", why_none(found.state, found.reason), *_left_out(found)])
    lines += [
        "",
        *(f"{'not credible' if k == 0 else 'also'}: {reason_text(doubt)}" for k, doubt in enumerate(found.doubts)),
    ]
    if found.doubts:
        lines.append("")
    lines += _effect(found)
    lines += _running(found)
    lines += _floor(found)
    # encounters per person-hour rise when people stand about less, so they get no verdict of their own
    rows = [("encounters per person-hour", "after against before", "")]
    for name, estimate in (("the area alone", found.alone), ("the comparison areas", found.comparison)):
        if estimate is not None:
            rows.append((name, change(estimate)[0], ""))
    if (near := found.neighbours) is not None:
        rows.append(("2 to 5 m around the area", change(near.encounter_rate)[0], ""))
        if near.effect is not None and near.effect.value is not None:
            relative = ratio(near.effect.value, near.effect.lo, near.effect.hi)
            rows.append(("  relative to the comparison areas", relative, ""))
    rows += [("", "", ""), ("people per open hour", "after against before", "verdict")]
    people = (("in the area", found.people), ("2 to 5 m around it", None if near is None else near.people))
    rows += [(name, *change(e)) for name, e in people if e is not None]
    lines += table(rows)
    if found.comparison_areas:
        lines += ["", f"compared with: {', '.join(found.comparison_areas)}"]
    lines += [*_left_out(found), "", "this holds if:", *(f"  {reason_text(a)}" for a in found.assumptions)]
    return "\n".join([*lines, *(f"note: {reason_text(note)}" for note in found.notes)])


def score_text(scored: PlanScore) -> str:
    """Return how a plan came out."""
    plan = scored.plan
    weeks = "no number of weeks" if plan.weeks_after is None else f"{plan.weeks_after} weeks after"
    lines = [
        f"planned on {plan.made}: {percent(plan.effect)} in {plan.weeks_before} weeks before and {weeks}, "
        f"then measured as {percent(plan.theta_lo - 1)} to {percent(plan.theta_hi - 1)}"
    ]
    if scored.theta is not None:
        place = "inside" if scored.is_inside else "outside"
        clear = "clear" if scored.is_clear else "not clear"
        due = "" if scored.is_due else "; the weeks planned are not over yet"
        lines.append(f"measured after {scored.n_weeks} weeks: {ratio(scored.theta)}, {place} of that, {clear}{due}")
    return "\n".join(lines)


def _effect(found: BeforeAfterFigure) -> list[str]:
    if found.effect is None or found.violation_rate is None:
        return []
    word = "effect" if found.is_credible else "for what it is worth, effect"
    n = found.effect.n_areas
    lines = [f"{word}, relative to {n} comparison area{'' if n == 1 else 's'}:"]
    measured = (
        ("time too close per open hour", found.burden),
        ("share of their time that people are too close", found.close),
        ("violations per open hour", found.violation_rate),
        (ENCOUNTERS, found.effect),
    )
    for name, effect in measured:
        if effect is None:
            continue
        if effect.value is None:
            lines.append(f"  {name}: too little data: {reason_text(effect.reason)}")
            continue
        verdict = f": {verdict_text(effect.verdict)}" if found.is_credible and name != ENCOUNTERS else ""
        lines.append(f"  {name}: {ratio(effect.value, effect.lo, effect.hi)}{verdict}")
        lines += [f"    {text}" for text in _robustness(effect)]
    lines.append(
        "    they rise by themselves where people stand about less: time too close says what became of the risk"
    )
    if found.routes is not None and found.burden is not None and found.burden.value is not None:
        people, closeness = percent(found.routes.people), percent(found.routes.closeness)
        lines.append(
            f"  of the change in time too close ({percent(found.burden.value - 1)}), people who went elsewhere or came "
            f"make {people}, people who keep another distance {closeness}"
        )
    if (trend := (found.burden or found.effect).trend or found.violation_rate.trend) is not None:
        per_week = ratio(1 + trend.value, 1 + trend.lo, 1 + trend.hi)
        lines.append(f"  before the change, against the comparison areas: {per_week} a week over {trend.n_weeks} weeks")
        if trend.detectable_per_week is not None:
            lines.append(f"    slower than {trend.detectable_per_week:.0%} a week would probably not have shown")
    lines += [f"  but: {reason_text(caution)}" for caution in found.cautions]
    return [*lines, ""]


def _running(found: BeforeAfterFigure) -> list[str]:
    """Return the verdict that may be read every week."""
    if (so_far := found.running) is None:
        return []
    name = "verdict that may be read every week"
    if so_far.value is None or so_far.e_value is None:
        return [f"{name}: too little data: {reason_text(so_far.reason)}", ""]
    weeks = f"{so_far.n_weeks} week{'' if so_far.n_weeks == 1 else 's'} beside {so_far.n_reference} before"
    bounds = "any effect is possible" if so_far.hi is None else ratio(so_far.value, so_far.lo, so_far.hi)
    since = "" if so_far.clear_since is None else f", clear for the first time after week {so_far.clear_since}"
    verdict = f": {verdict_text(so_far.verdict)}" if found.is_credible else ""
    return [
        f"{name}, time too close per open hour, {weeks}:",
        f"  {bounds}{verdict} (evidence {so_far.e_value:.3g}, clear from 20 on{since})",
        *_without(so_far),
        "",
    ]


def _without(so_far: RunningVerdict) -> list[str]:
    """Return how the effect moves with one comparison area left out, and beside all of them."""
    thetas = [theta for theta in so_far.without if theta is not None]
    if not thetas or so_far.all_value is None:
        return []
    beside = "any effect is possible"
    if so_far.all_hi is not None:
        beside = ratio(so_far.all_value, so_far.all_lo, so_far.all_hi)
    if len(so_far.without) == 1:
        return [f"  beside its comparison area {beside}, the area by itself {percent(thetas[0] - 1)}"]
    out = f"with one left out {percent(min(thetas) - 1)} to {percent(max(thetas) - 1)}"
    return [f"  beside all comparison areas {beside}; {out}"]


def _floor(found: BeforeAfterFigure) -> list[str]:
    """Return what became of the whole floor."""
    if found.floor is None:
        return []
    net = found.floor.net
    name = "the whole floor, time too close per open hour, by itself"
    if net.value is None:
        return [f"{name}: too little data: {reason_text(net.reason)}", ""]
    own = net.contributions[found.floor.places.index(found.area_id)]
    return [
        f"{name}: {ratio(net.value, net.lo, net.hi)}: {verdict_text(net.verdict)}",
        f"  of which {found.area_name} makes {percent(own)}, the rest of the floor {percent(net.value - 1 - own)}",
        "",
    ]


def _robustness(effect: BeforeAfter) -> list[str]:
    lines = []
    if effect.placebo:
        lowest, highest = (percent(theta - 1) for theta in (min(effect.placebo), max(effect.placebo)))
        lines.append(f"each comparison area, as if changed: {lowest} to {highest}")
    if effect.placebo_lo is not None:
        lines[-1] += f"; interval by that spread: {ratio(effect.value, effect.placebo_lo, effect.placebo_hi)}"
    parts = (
        ("leaving out any one comparison area", effect.without_lo, effect.without_hi),
        ("how days differ", effect.day_lo, effect.day_hi),
        ("how areas' own weeks differ", effect.week_lo, effect.week_hi),
        ("the area's own trend, continued", effect.line_lo, effect.line_hi),
    )
    lines += [f"interval by {name}: {percent(lo - 1)} to {percent(hi - 1)}" for name, lo, hi in parts if lo and hi]
    if (pulled := effect.shrunken) is not None:
        text = f"{ratio(pulled.value, pulled.lo, pulled.hi)}, as part of what is bad by chance passes by itself"
        lines.append(f"if the area was chosen because it was bad: {text}")
    return lines


def _left_out(found: BeforeAfterFigure) -> list[str]:
    return [f"not compared with {area_id}: {reason_text(why)}" for area_id, why in found.areas_left_out]


def _quoted(text: str) -> str:
    return f'"{" ".join(plain(text).split())}"'
