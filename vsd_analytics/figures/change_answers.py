"""What a logged change did, as answers: the effect and what its range rests on, the places around, the floor, the plan.

The verdicts stay those of `figures.before_after`. Here a ratio of after over before is a relative change: -0.2 is 20 %
less.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import date
from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.figures.before_after import BeforeAfterFigure
from vsd_analytics.figures.experiments import ExperimentPlan, PlanScore, clear_by
from vsd_analytics.figures.values import known, lack, relative
from vsd_analytics.site.model import Site
from vsd_analytics.stats.before_after import BeforeAfter
from vsd_analytics.stats.estimates import ChangeEstimate
from vsd_analytics.stats.running_verdict import RunningVerdict

_NO_TREND: Final = Reason("logged_change.no_trend")
_FEW: Final = Reason("change.few")
_NO_FALL: Final = Reason("logged_change.no_fall")
NO_RECEIVER: Final = Reason("logged_change.no_receiver")
_RANGES: Final = ("day", "week", "placebo", "line", "without")
CHANGE: Final = (
    Column("entry", "key"),
    Column("at", "instant"),
    Column("text", "fact"),
    Column("area_id", "fact"),
    Column("name", "fact"),
    Column("design", "fact", "design"),
    Column("outcome", "fact", "outcome"),
    Column("is_credible", "fact"),
    *(Column(f"{when}_{end}", "fact") for when in ("before", "after", "left_out") for end in ("first", "last")),
    Column("n_weeks_each_side", "fact"),
    Column("comparison_area_ids", "fact"),
    Column("comparison_names", "fact"),
)
"""Columns of `logged_change`."""
EFFECTS: Final = (
    Column("effect", "key", "effect"),
    Column("effect_change", "rate", "change", "M27"),
    Column("shrunken_change", "rate", "change", "M27"),
    *(Column(f"by_{name}", "rate", "change", "M27") for name in _RANGES),
    Column("placebo_least", "rate", "change"),
    Column("placebo_most", "rate", "change"),
    Column("trend_per_week", "rate", "change"),
    Column("detectable_per_week", "rate", "share"),
    Column("n_trend_weeks", "fact"),
    Column("n_comparison_areas", "fact"),
)
"""Columns of `change_effects`: each of `by_day` to `by_without` is the effect with one of the ranges behind its own."""
SO_FAR: Final = (
    Column("effect", "key", "effect"),
    Column("so_far_change", "rate", "change", "M27"),
    Column("so_far_verdict", "fact", "verdict"),
    Column("e_value", "rate", "ratio"),
    Column("clear_since_week", "fact"),
    Column("beside_all_change", "rate", "change", "M27"),
    Column("without_least", "rate", "change"),
    Column("without_most", "rate", "change"),
    Column("n_weeks_after", "fact"),
    Column("n_reference_weeks", "fact"),
    Column("taken_up_share", "rate", "share"),
)
"""Columns of `change_so_far`: the one verdict on a change, that may be read every week."""
PLACES: Final = (
    Column("place", "key", "place"),
    Column("place_rate_change", "rate", "change", "M7"),
    Column("relative_change", "rate", "change", "M27"),
    Column("place_people_change", "rate", "change", "M5"),
)
"""Columns of `change_places`."""
RECEIVERS: Final = (
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("received_people_change", "rate", "change", "M27"),
)
"""Columns of `change_receivers`: areas that clearly have more people since."""
PARTS: Final = (
    Column("whole", "key", "whole"),
    Column("part", "key", "part"),
    Column("part_change", "rate", "change"),
)
"""Columns of `change_parts`: the change of a whole, and the parts that add up to it."""
FORESEEN: Final = (
    Column("planned_change", "key"),
    Column("power_asked", "share", "share"),
    Column("weeks_after", "number", "weeks"),
    Column("power_then", "share", "share"),
    Column("clear_by", "fact"),
)
"""Columns of `change_foreseen`: by which day a change that is not clear yet will be, as `vsd plan` has it."""
PLANNED: Final = (
    Column("made", "key"),
    Column("planned_change", "rate", "change"),
    Column("measured_change", "rate", "change"),
    Column("is_inside", "fact"),
    Column("is_clear", "fact"),
    Column("is_due", "fact"),
    Column("weeks_before", "fact"),
    Column("weeks_after", "fact"),
    Column("n_weeks_after", "fact"),
)
"""Columns of `plan_score`."""


def change_answers(
    figure: BeforeAfterFigure, scored: PlanScore | None, site: Site, *, inputs: str
) -> tuple[Answer, ...]:
    """Return what a logged change did as tables (M27), exact: for the operator.

    `logged_change`: the entry, what may be said of it, the days and areas compared; its notes say what speaks against
    the comparison, what the data could not rule out, and what must hold. `change_effects`: the effect on each rate
    relative to the comparison areas, the ranges its own is made of, and the trend before the change. `change_so_far`:
    the one verdict, which may be read every week, and how much of a fall two other places took up. `change_parts`: how
    the effect on the time too close is made up, and the change of the whole floor. `change_receivers`: areas that
    clearly have more people since. `change_foreseen`: when a change that is not clear yet will be, if it is as large as
    planned. `change_places`: the area, the comparison areas, and 2 to 5 m around it.
    `plan_score`: how a plan came out.

    Args:
        figure: The change.
        scored: Its plan; None without one.
        site: The site.
        inputs: Hash of the facts.
    """
    day = figure.at.astimezone(site.zone).date()
    windows = figure.windows
    first, last = (day, day) if windows is None else (min(day, windows.trend[0]), max(day, windows.watched[1]))
    floor_id = next((a.floor_id for a in site.areas if a.area_id == figure.area_id), None)
    holds = HoldsFor(site.site_id, floor_id, first, last, settings=site.settings.settings_id(), inputs=inputs)
    why = None if figure.state == "ok" else lack(figure.state, figure.reason)
    answers = [
        Answer("logged_change", CHANGE, (_entry(figure, site),), holds, notes=tuple((None, n) for n in _notes(figure))),
        _answer("change_effects", EFFECTS, _effects(figure), holds, why or _why_alone(figure)),
        _answer("change_so_far", SO_FAR, _so_far(figure), holds, why or _why_alone(figure)),
        _answer("change_parts", PARTS, _parts(figure), holds, why),
        _answer("change_receivers", RECEIVERS, _receivers(figure), holds, why or Value.missing(NO_RECEIVER)),
        _answer("change_places", PLACES, _places(figure), holds, why),
    ]
    if figure.foreseen is not None:
        answers.append(_foreseen(figure, figure.foreseen, site, holds))
    if scored is not None:
        answers.append(Answer("plan_score", PLANNED, (_score(scored),), holds))
    return tuple(answers)


def _answer(name: str, columns: Sequence[Column], rows: Iterable[Row], holds: HoldsFor, why: Value | None) -> Answer:
    all_rows = tuple(rows)
    if all_rows or why is None:
        return Answer(name, tuple(columns), all_rows, holds)
    return Answer(name, tuple(columns), (), holds, nothing=why.reason, state=why.state)


def _why_alone(figure: BeforeAfterFigure) -> Value | None:
    return Value.missing(Reason("logged_change.alone")) if figure.design == "alone" else None


def _entry(figure: BeforeAfterFigure, site: Site) -> Row:
    windows, names = figure.windows, {a.area_id: a.name for a in site.areas}
    spans: dict[str, tuple[date, date] | None] = {"before": None, "after": None, "left_out": None}
    if windows is not None:
        spans = {"before": windows.before, "after": windows.after, "left_out": windows.left_out}
    return {
        "entry": figure.number,
        "at": figure.at.astimezone(site.zone),
        "text": figure.text,
        "area_id": figure.area_id,
        "name": figure.area_name,
        "design": figure.design,
        "outcome": figure.outcome,
        "is_credible": figure.is_credible if figure.state == "ok" else None,
        **{f"{when}_first": None if days is None else days[0] for when, days in spans.items()},
        **{f"{when}_last": None if days is None else days[1] for when, days in spans.items()},
        "n_weeks_each_side": None if windows is None else windows.n_weeks,
        "comparison_area_ids": figure.comparison_areas,
        "comparison_names": tuple(names[area_id] for area_id in figure.comparison_areas),
    }


def _notes(figure: BeforeAfterFigure) -> list[Reason]:
    """Return what a reader must know: why there is no effect, doubts, cautions, areas left out, what must hold."""
    notes = [] if figure.state == "ok" or figure.reason is None else [figure.reason]
    notes += [] if figure.not_yet is None else [Reason("logged_change.not_yet", why=figure.not_yet)]
    notes += [Reason("logged_change.doubt", why=doubt) for doubt in figure.doubts]
    notes += [Reason("logged_change.caution", why=caution) for caution in figure.cautions]
    if figure.effect is not None:
        notes.append(Reason("logged_change.rises"))
    notes += [Reason("logged_change.left_out", area=area_id, why=why) for area_id, why in figure.areas_left_out]
    return [*notes, *figure.notes, *(Reason("logged_change.holds_if", what=what) for what in figure.assumptions)]


def _effects(figure: BeforeAfterFigure) -> Iterable[Row]:
    effects = (
        ("close_min_per_open_h", figure.burden),
        ("close_time_share", figure.close),
        ("violations_per_open_h", figure.violation_rate),
        ("violations_per_person_h", figure.effect),
    )
    for name, effect in effects:
        if effect is None:
            continue
        trend, change = effect.trend, relative(effect, reason=_FEW)
        placebo = [theta - 1 for theta in effect.placebo]
        few = Reason("logged_change.no_placebo")
        yield {
            "effect": name,
            "effect_change": change,
            "shrunken_change": relative(effect.shrunken, reason=Reason("logged_change.not_shrunken")),
            **{f"by_{part}": _range(change, effect, part) for part in _RANGES},
            "placebo_least": known(min(placebo, default=None), few),
            "placebo_most": known(max(placebo, default=None), few),
            "trend_per_week": Value.missing(_NO_TREND) if trend is None else Value.of(trend),
            "detectable_per_week": known(None if trend is None else trend.detectable_per_week, _NO_TREND),
            "n_trend_weeks": None if trend is None else trend.n_weeks,
            "n_comparison_areas": effect.n_areas,
        }


def _range(change: Value, effect: BeforeAfter, part: str) -> Value:
    """Return an effect with one of the ranges that its own is made of, or why there is none."""
    lo, hi = getattr(effect, f"{part}_lo"), getattr(effect, f"{part}_hi")
    if change.value is None or lo is None or hi is None:
        return Value.missing(change.reason or Reason(f"logged_change.no_{part}"))
    return Value(change.value, lo - 1, hi - 1)


def _so_far(figure: BeforeAfterFigure) -> Iterable[Row]:
    so_far: RunningVerdict | None = figure.running
    if so_far is None:
        return
    reason = so_far.reason or Reason("logged_change.any_effect")
    beside_all = Value.missing(so_far.reason or _FEW)
    if so_far.all_value is not None:
        all_lo, all_hi = (None if n is None else n - 1 for n in (so_far.all_lo, so_far.all_hi))
        no_range = Reason("logged_change.any_effect") if all_lo is None and all_hi is None else None
        beside_all = Value(so_far.all_value - 1, all_lo, all_hi, reason=no_range)
    without = [theta - 1 for theta in so_far.without if theta is not None]
    yield {
        "effect": "close_min_per_open_h",
        "so_far_change": relative(so_far, reason=reason),
        "so_far_verdict": so_far.verdict if so_far.value is not None else None,
        "e_value": known(so_far.e_value, so_far.reason or _FEW, so_far.state),
        "clear_since_week": so_far.clear_since,
        "beside_all_change": beside_all,
        "without_least": known(min(without, default=None), reason),
        "without_most": known(max(without, default=None), reason),
        "n_weeks_after": so_far.n_weeks,
        "n_reference_weeks": so_far.n_reference,
        "taken_up_share": known(None if figure.taken_up is None else figure.taken_up.share, so_far.reason or _NO_FALL),
    }


def _parts(figure: BeforeAfterFigure) -> Iterable[Row]:
    def row(whole: str, part: str, change: Value) -> Row:
        return {"whole": whole, "part": part, "part_change": change}

    if figure.routes is not None and figure.burden is not None and figure.burden.value is not None:
        yield row("area", "people", Value(figure.routes.people))
        yield row("area", "closeness", Value(figure.routes.closeness))
    if figure.floor is not None:
        net = figure.floor.net
        yield row("floor", "floor", relative(net, reason=_FEW))
        own = net.contributions[figure.floor.places.index(figure.area_id)] if net.value is not None else None
        yield row("floor", "area", known(own, net.reason or _FEW, net.state))
        rest = None if own is None or net.value is None else net.value - 1 - own
        yield row("floor", "rest", known(rest, net.reason or _FEW, net.state))


def _places(figure: BeforeAfterFigure) -> Iterable[Row]:
    near = figure.neighbours
    places: tuple[tuple[str, ChangeEstimate | None, ChangeEstimate | None], ...] = (
        ("area", figure.alone, figure.people),
        ("comparison", figure.comparison, None),
        ("around", None if near is None else near.encounter_rate, None if near is None else near.people),
    )
    itself = Reason("logged_change.itself")
    for place, rate, people in places:
        if rate is None:
            continue
        beside = figure.effect if place == "area" else near.effect if near and place == "around" else None
        why_none = itself if place == "comparison" else Reason("logged_change.alone")
        yield {
            "place": place,
            "place_rate_change": relative(rate, reason=_FEW),
            "relative_change": relative(beside, reason=why_none),
            "place_people_change": relative(people, reason=itself),
        }


def _receivers(figure: BeforeAfterFigure) -> Iterable[Row]:
    for area in figure.receivers:
        more = Value(area.more, area.lo, area.hi)
        yield {"area_id": area.area_id, "name": area.name, "received_people_change": more}


def _foreseen(figure: BeforeAfterFigure, plan: ExperimentPlan, site: Site, holds: HoldsFor) -> Answer:
    """Return by which day a change will be clear; its notes say why areas do not serve, where none does."""
    why = None if plan.state == "ok" else lack(plan.state, plan.reason)
    rows: list[Row] = [
        {
            "planned_change": plan.effect,
            "power_asked": Value(plan.power),
            "weeks_after": known(way.weeks_after, Reason("logged_change.more_weeks", most=plan.weeks_max)),
            "power_then": Value(way.power),
            "clear_by": clear_by(figure, site),
        }
        for way in plan.choices[:1]
    ]
    return _answer("change_foreseen", FORESEEN, rows, holds, why)


def _score(scored: PlanScore) -> Row:
    plan, ratio = scored.plan, scored.theta
    return {
        "made": plan.made,
        "planned_change": Value(plan.effect, plan.theta_lo - 1, plan.theta_hi - 1),
        "measured_change": known(None if ratio is None else ratio - 1, _FEW),
        "is_inside": scored.is_inside,
        "is_clear": scored.is_clear if ratio is not None else None,
        "is_due": scored.is_due,
        "weeks_before": plan.weeks_before,
        "weeks_after": plan.weeks_after,
        "n_weeks_after": scored.n_weeks,
    }
