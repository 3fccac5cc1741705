"""Several places for one fixture: in whose way it would be at each, and whether one place is shown to be the best.

Places are compared by the people whose recorded path they block, day by day. How the time too close would change is no
part of it, since no direction of it is known.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row
from vsd_analytics.figures.values import known
from vsd_analytics.site.layout import FixtureEdit
from vsd_analytics.site.model import Site
from vsd_analytics.whatif.fixture_edits import FixtureEffect
from vsd_analytics.whatif.prediction import LayoutEffects

Standing = Literal["best", "lowest", "no_difference", "more", "narrow", "only"]
MIN_DAYS: Final = 5
"""Days that a comparison needs."""
FALSE_BEST: Final = 0.05
"""Chance of calling a place the best that is not, over all places."""


WALKED_SHARE: Final = 0.01
"""A gap beside a fixture is a way where more than this share of the people near walk: one along a wall is none."""
CHOICES: Final = (
    Column("number", "key"),
    Column("edit_name", "fact"),
    Column("touched_per_day", "rate", "people", audience="operator"),
    Column("touched_lo", "rate", "people", audience="operator"),
    Column("touched_hi", "rate", "people", audience="operator"),
    Column("more_per_day", "rate", "people", audience="operator"),
    Column("narrowest_m", "fact", "m", digits=2),
    Column("standing", "fact", "standing", audience="operator"),
)
"""Columns of `whatif_choices`."""


@dataclass(frozen=True, slots=True)
class ComparedPlace:
    """A place beside the one with fewest people in the way.

    Attributes:
        per_day: People in the way a day, mean.
        lo, hi: Range of that mean; NaN with fewer than `MIN_DAYS` days. The ranges of all places hold together in 95 of
            100 searches.
        more: People more a day than at the place with fewest.
        more_lo: Lower end of `more`; above 0 = more people are shown; NaN as above, and at that place itself.
        standing: "best": fewer than at every other place; "lowest": fewest, but not shown for all others;
            "no_difference": not shown to have more than it; "more": shown; "narrow": left out, because it leaves too
            narrow a way; "only": all others are left out.
    """

    per_day: float
    lo: float
    hi: float
    more: float
    more_lo: float
    standing: Standing


def compared_places(n_touched: NDArray[np.int64], is_narrow: Sequence[bool]) -> tuple[ComparedPlace, ...]:
    """Return places compared by the people in the way, day by day.

    A place has more people than the one with fewest where the paired difference over the days, less its one-sided t
    range at 0.05 / k, lies above 0. k is the number of places compared (Bonferroni), because the best one was chosen by
    the same days. A place is the best where this holds for all others. So where no place is better than all others,
    one is called the best in at most 5 of 100 searches: each of k places would have to beat another one that is as
    good, which happens in 0.05 / k.

    Args:
        n_touched: People in the way, shape (k, n_days).
        is_narrow: Places that are left out of the comparison.
    """
    from vsd_analytics.stats.quantiles import t_quantile  # takes a tenth of a second to import

    n_days = n_touched.shape[1]
    mean = n_touched.mean(axis=1) if n_days else np.zeros(len(is_narrow))
    open_ways = [k for k, narrow in enumerate(is_narrow) if not narrow]
    first = min(open_ways, key=lambda k: (mean[k], k), default=0)
    each = FALSE_BEST / max(len(open_ways), 1)
    is_enough = n_days >= MIN_DAYS
    two_sided, one_sided = (
        t_quantile(n_days - 1, confidence=1 - share) if is_enough else np.nan for share in (each, 2 * each)
    )
    places: list[ComparedPlace] = []
    for k, narrow in enumerate(is_narrow):
        own, apart = (two_sided, n_touched[k]), (one_sided, n_touched[k] - n_touched[first])
        half, less = (t * float(v.std(ddof=1)) / n_days**0.5 if is_enough else np.nan for t, v in (own, apart))
        more = float(mean[k] - mean[first])
        more_lo = np.nan if k == first else more - less
        standing: Standing = (
            "narrow" if narrow else "lowest" if k == first else "more" if more_lo > 0 else "no_difference"
        )
        places.append(
            ComparedPlace(float(mean[k]), float(mean[k]) - half, float(mean[k]) + half, more, more_lo, standing)
        )
    others = [places[k].standing for k in open_ways if k != first]
    if open_ways and not others:
        places[first] = replace(places[first], standing="only")
    if others and all(standing == "more" for standing in others):
        places[first] = replace(places[first], standing="best")
    return tuple(places)


def choices(predicted: LayoutEffects, site: Site, holds: HoldsFor) -> Answer | None:
    """Return the places of each fixture that was tried at several, with what is shown as a note; None without any.

    Places that leave a way narrower than the least of `free_way_m`, or none at all, are listed and not compared. A gap
    is a way where more than 1 % of the people near walk.

    Args:
        predicted: The prediction.
        site: The site.
        holds: What the answer holds for.
    """
    rows: list[Row] = []
    notes: list[tuple[int | None, Reason]] = []
    for tried in _tried(predicted):
        days = sorted(set(predicted.days_alike) & {d for _, _, effect in tried for d in effect.touched_by_day})
        n_touched = np.array([[effect.touched_by_day.get(d, 0) for d in days] for _, _, effect in tried], np.int64)
        narrow = [_is_narrow(effect, min(site.settings.free_way_m)) for _, _, effect in tried]
        compared = compared_places(n_touched.reshape(len(tried), len(days)), narrow)
        notes.append((len(rows), _said([edit.name for _, edit, _ in tried], compared, len(days))))
        rows += [_row(*one, place, len(days)) for one, place in zip(tried, compared, strict=True)]
    return Answer("whatif_choices", CHOICES, tuple(rows), holds, notes=tuple(notes)) if rows else None


def _tried(predicted: LayoutEffects) -> Iterator[list[tuple[int, FixtureEdit, FixtureEffect]]]:
    by_id: dict[str, list[tuple[int, FixtureEdit, FixtureEffect]]] = {}
    for number, (edit, effect) in enumerate(zip(predicted.edits.edits, predicted.effects, strict=True), start=1):
        if isinstance(edit, FixtureEdit) and isinstance(effect, FixtureEffect) and edit.is_choice:
            by_id.setdefault(edit.fixture_id, []).append((number, edit, effect))
    yield from by_id.values()


def _is_narrow(effect: FixtureEffect, least_m: float) -> bool:
    has_no_way = effect.refusal is not None and effect.refusal.code == "whatif.no_way"
    ways = [way for way in effect.ways if way.n_people > WALKED_SHARE * effect.n_near]
    return has_no_way or any(way.free_m < least_m for way in ways)


def _row(number: int, edit: FixtureEdit, effect: FixtureEffect, place: ComparedPlace, n_days: int) -> Row:
    few = Reason("whatif.few_days", least=MIN_DAYS, has=n_days)
    lo, hi = (known(None if n_days < MIN_DAYS else limit, few) for limit in (max(place.lo, 0.0), place.hi))
    return {
        "number": number,
        "edit_name": edit.name,
        "touched_per_day": known(place.per_day if n_days else None, few),
        "touched_lo": lo,
        "touched_hi": hi,
        "more_per_day": known(place.more if n_days else None, few),
        "narrowest_m": min((way.free_m for way in effect.ways), default=None),
        "standing": place.standing,
    }


def _said(names: Sequence[str], places: Sequence[ComparedPlace], n_days: int) -> Reason:
    if n_days < MIN_DAYS:
        return Reason("whatif.search_refused", why=Reason("whatif.few_days", least=MIN_DAYS, has=n_days))
    first = next((k for k, p in enumerate(places) if p.standing in ("best", "lowest")), None)
    n_compared = sum(p.standing != "narrow" for p in places)
    if first is None or n_compared == 1:
        return Reason("whatif.search_refused", why=Reason("whatif.all_narrow"))
    alike = tuple(
        Reason("whatif.place", name=name)
        for name, place in zip(names, places, strict=True)
        if place.standing == "no_difference"
    )
    return Reason(
        "whatif.search_alike" if alike else "whatif.search_best", name=names[first], per_day=places[first].per_day,
        n=n_compared, days=n_days, others=alike,
    )  # fmt: skip
