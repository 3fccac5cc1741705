"""Who with whom: groups (M9), how long and close (M10, M11), contacts (M12, M31, M34), clusters (M21, M22), M23."""

from __future__ import annotations

from typing import Final

from vsd_analytics.answer import Answer, Column, Reason, Row, State, Value
from vsd_analytics.figures.catalogue.form import FigureInputs, answers
from vsd_analytics.figures.gatherings import N_TOP, FloorGatherings
from vsd_analytics.figures.group_answers import BETWEEN_GROUPS, READINGS, between_groups, reading_rows
from vsd_analytics.figures.neighbours import OthersMet, others_met
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.values import known, lack, measured
from vsd_analytics.stats.decomposition import MixingChange

CLOSE_SHARE: Final = Column("close_time_share", "share", "share", "M6")
"""What `readings` of a week has beside its rates."""
DURATIONS: Final = (
    Column("duration_median_s", "seconds", "s", "M10", per="n_measured"),
    Column("duration_p90_s", "seconds", "s", "M10", per="n_measured"),
    Column("sustained_share", "share", "share", "M10", tells=("n_sustained", "n_shorter"), per="n_measured"),
    Column("sustained_s", "fact", "s"),
    Column("n_measured", "count", "violations"),
    Column("n_sustained", "count", "violations", audience="operator"),
    Column("n_shorter", "count", "violations", audience="operator"),
)
"""Columns of `durations`."""
DISTANCES: Final = (
    Column("from_m", "key", "m"),
    Column("to_m", "fact", "m"),
    Column("person_time_share", "share", "share", "M11", per="close_h"),
    Column("close_h", "fact", "h"),
)
"""Columns of `distances`."""
_OF_CONTACTS: Final = ("n_long_contact", "n_no_long_contact", "n_contacts")
CONTACTS: Final = (
    Column("n_contacts", "count", "pairs", "M12", per="n_pairs"),
    Column("n_pairs", "count", "pairs"),
    Column("met_median", "people", "people", "M31", tells=("n_followed",), per="n_followed"),
    Column("met_p90", "people", "people", "M31", tells=("n_followed",), per="n_followed"),
    Column("long_contact_share", "share", "share", "M34", tells=_OF_CONTACTS, per="n_tracks"),
    Column("n_followed", "count", "tracks"),
    Column("n_tracks", "count", "tracks", tells=_OF_CONTACTS),
    Column("n_long_contact", "count", "tracks", audience="operator"),
    Column("n_no_long_contact", "count", "tracks", audience="operator"),
)
"""Columns of `contacts`."""
CLUSTERS: Final = (
    Column("least", "key", "people"),
    Column("most", "fact", "people"),
    Column("person_time_share", "share", "share", "M21", per="person_h"),
    Column("person_h", "fact", "h"),
)
"""Columns of `clusters`."""
GATHERING_RATE: Final = (
    Column("gatherings_per_100_h", "rate", "per_100_h", "M22", tells=("n_gatherings",), per="recorded_h"),
    Column("n_gatherings", "count", "gatherings"),
    Column("recorded_h", "fact", "h"),
)
"""Columns of `gathering_rate`."""
GATHERINGS: Final = (
    Column("rank", "key"),
    Column("start", "instant"),
    Column("end", "instant"),
    Column("duration_s", "fact", "s"),
    Column("n_people", "fact", "people"),
    Column("person_s", "seconds", "s", "M22"),
    Column("x_m", "place", "m"),
    Column("y_m", "place", "m"),
    Column("diameter_m", "fact", "m"),
)
"""Columns of `gatherings`."""
_FACTORS: Final = ("crowding", "layout", "behaviour")
MIXING: Final = (
    Column("copresent_h", "rate", "h", "M23"),
    Column("layout_chance", "rate", "chance", "M23"),
    Column("layout_over_uniform", "rate", "ratio", "M23"),
    Column("behaviour_ratio", "rate", "ratio", "M23", per="copresent_pair_h"),
    *(Column(f"{factor}_change", "rate", "change", "M23") for factor in _FACTORS),
    *(Column(f"{factor}_change_share", "share", "share", "M23") for factor in _FACTORS),
    Column("copresent_pair_h", "fact", "h"),
)
"""Columns of `mixing`."""


@answers("M6", "M9")
def groups(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return the share of violations between groups (M9), and rates and time too close in both readings (M6, M9)."""
    site_groups, data = inputs.results.groups, inputs.data
    here = {c.camera_id: c.lives for c in site_groups.cameras if c.camera_id in data.ids}
    own = next((r for r in site_groups.readings if r.floor_id == inputs.floor_id), None)
    why = inputs.why_no_violations
    if why is None and (site_groups.state != "ok" or own is None):
        lives = next((lives for lives in here.values() if lives.state != "ok"), None)
        why = lack(site_groups.state, site_groups.reason) if lives is None else lack(lives.state, lives.reason)
    share, note = between_groups(site_groups, own, why=why)
    times = inputs.results.person_time
    close = {"all": times.close, "between_groups": times.close_between}
    why_no_time = inputs.why_no_person_time
    rows: list[Row] = [
        {**row, "close_time_share": why_no_time or measured(close[str(row["reading"])])}
        for row in reading_rows(own, why=why)
    ]
    return (
        inputs.floor_answer("between_groups", BETWEEN_GROUPS, share, note),
        inputs.list_answer("readings", (*READINGS, CLOSE_SHARE), rows),
    )


@answers("M10", "M11")
def how_long_and_close(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return how long violations last (M10), and person-time in violation by distance to the nearest person (M11).

    Columns of `durations`: median, 90 % quantile, and the share of those of `sustained_s` and longer.
    """
    durations, distances = inputs.results.episodes.durations, inputs.results.episodes.distances
    why = inputs.why_no_violations
    if why is None and durations.median.value is None:
        why = lack(durations.state, durations.reason)
    share = durations.long_share
    cells: Row = {
        "duration_median_s": why or measured(durations.median, reason=durations.reason),
        "duration_p90_s": why or measured(durations.p90, reason=durations.reason),
        "sustained_share": why or measured(share),
        "sustained_s": inputs.data.site.settings.sustained_s,
        "n_measured": why or Value(durations.n),
        "n_sustained": Value(share.n),
        "n_shorter": Value(share.of - share.n),
    }
    notes = []
    if why is None and durations.is_at_least and durations.cut_share is not None:
        notes.append(Reason("note.at_least", share=durations.cut_share))
    rows: list[Row] = [
        {
            "from_m": s.from_m,
            "to_m": s.to_m,
            "person_time_share": known(s.share, distances.reason),
            "close_h": distances.person_s / 3600,
        }
        for s in distances.shares
    ]
    nothing = lack(distances.state, distances.reason) if distances.state != "ok" else None
    if inputs.why_no_time_too_close is not None:
        rows, nothing = [], inputs.why_no_time_too_close
    return (
        inputs.floor_answer("durations", DURATIONS, cells, *notes),
        inputs.list_answer("distances", DISTANCES, rows, nothing=nothing),
    )


@answers("M12", "M31", "M34")
def contacts(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return with how many others people are too close, and for how long.

    Columns: pairs of people too close for 15 minutes within 24 hours (M12); how many different others a person comes
    too close to in a day, median and 90 % quantile (M31); the share of people with 15 minutes or more too close to one
    other (M34).
    """
    pairs, met = inputs.results.episodes.contacts, _met(inputs)
    why_pairs = inputs.why_no_time_too_close
    if why_pairs is None and (pairs.n is None or pairs.state != "ok"):
        why_pairs = lack(pairs.state, pairs.reason)
    cells: dict[str, Value] = {
        "n_contacts": why_pairs or Value(pairs.n),
        "n_pairs": why_pairs or Value(pairs.n_pairs),
    }
    of_people = ("met_median", "met_p90", "long_contact_share", "n_followed", "n_tracks")
    if isinstance(met, OthersMet):
        (median, p90), share, reason = met.met.quantiles, met.long_share, met.met.reason
        why_none = None if median.value is not None else lack(met.met.state, reason)
        cells |= {
            "met_median": why_none or measured(median, reason=reason),
            "met_p90": why_none or measured(p90, reason=reason),
            "long_contact_share": why_pairs or measured(share),
            "n_followed": Value(met.met.n),
            "n_tracks": Value(share.of),
            "n_long_contact": Value(share.n),
            "n_no_long_contact": Value(share.of - share.n),
        }
    else:
        cells |= dict.fromkeys((*of_people, "n_long_contact", "n_no_long_contact"), met)
        cells["long_contact_share"] = why_pairs or met
    notes = (Reason("note.met"), Reason("note.contacts"))
    return (inputs.floor_answer("contacts", CONTACTS, cells, *notes),)


def _met(inputs: FigureInputs) -> OthersMet | Value:
    """Return whom people met, of this floor's cameras whose track ids last; else why there are none."""
    if inputs.data.hidden.why_floor is not None:
        return inputs.why_few_people or Value.missing(GIVES_AWAY)
    here = [c for c in inputs.results.groups.cameras if c.camera_id in inputs.data.ids]
    able = [c.camera_id for c in here if c.lives.state == "ok"]
    if not able:
        worst = max(here, key=lambda c: (c.lives.state == "not_measurable", c.exposure_h), default=None)
        return lack("not_enough_data", None) if worst is None else lack(worst.lives.state, worst.lives.reason)
    return others_met(inputs.data.warehouse, able, first=inputs.data.monday, last=inputs.data.sunday)


@answers("M21", "M22")
def together(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return clusters and gatherings.

    `clusters`: how the time people spent in clusters is shared out by the size of the cluster (M21). `gathering_rate`:
    gatherings per 100 recorded open hours; `gatherings`: those with most person-time (M22).
    """
    floor_gatherings = next((f for f in inputs.results.gatherings.floors if f.floor_id == inputs.floor_id), None)
    if floor_gatherings is None or inputs.why_no_time_too_close is not None:
        none = inputs.why_no_time_too_close or lack("not_enough_data", None)
        cells: Row = {"gatherings_per_100_h": none, "n_gatherings": none, "recorded_h": inputs.recorded_h}
        return (
            inputs.list_answer("clusters", CLUSTERS, (), nothing=none),
            inputs.floor_answer("gathering_rate", GATHERING_RATE, cells),
            inputs.list_answer("gatherings", GATHERINGS, (), nothing=none),
        )
    rate = measured(floor_gatherings.per_100_h)
    cells = {
        "gatherings_per_100_h": rate,
        "n_gatherings": known(floor_gatherings.n, floor_gatherings.per_100_h.reason, floor_gatherings.per_100_h.state),
        "recorded_h": inputs.recorded_h,
    }
    return (
        _clusters(inputs, floor_gatherings),
        inputs.floor_answer("gathering_rate", GATHERING_RATE, cells),
        _longest(inputs, floor_gatherings, rate),
    )


def _clusters(inputs: FigureInputs, floor_gatherings: FloorGatherings) -> Answer:
    sizes = floor_gatherings.sizes
    if sizes.state != "ok":
        return inputs.list_answer("clusters", CLUSTERS, (), nothing=lack(sizes.state, sizes.reason))
    rows: list[Row] = [
        {
            "least": size.least,
            "most": size.most,
            "person_time_share": known(size.share, NOTHING_OPEN),
            "person_h": sizes.person_s / 3600,
        }
        for size in sizes.sizes
    ]
    return inputs.list_answer("clusters", CLUSTERS, rows)


def _longest(inputs: FigureInputs, floor_gatherings: FloorGatherings, rate: Value) -> Answer:
    mask = inputs.data.mask
    nothing = None
    if floor_gatherings.n is None or rate.value is None:
        nothing = rate
    elif mask.hides(floor_gatherings.n):
        nothing = Value.missing(Reason("hidden.gatherings", least=mask.below))
    elif not inputs.is_ranked:
        nothing = Value.missing(inputs.why_not_ranked)
    # ranked after the small ones are left out: a gap in the ranks would tell of them
    shown = [g for g in floor_gatherings.ranked if nothing is None and not mask.hides(g.n_people)][:N_TOP]
    rows: list[Row] = [
        {
            "rank": rank,
            "start": g.start,
            "end": g.end,
            "duration_s": g.duration_s,
            "n_people": g.n_people,
            "person_s": Value(g.person_s),
            "x_m": g.x_m,
            "y_m": g.y_m,
            "diameter_m": g.diameter_m,
        }
        for rank, g in enumerate(shown, 1)
    ]
    if nothing is None and floor_gatherings.top and not rows:
        nothing = Value.missing(Reason("hidden.few_people", least=mask.below))
    notes = (
        ((None, Reason("note.gatherings", n=floor_gatherings.n)),) if rows and floor_gatherings.n is not None else ()
    )
    return inputs.list_answer("gatherings", GATHERINGS, rows, *notes, nothing=nothing)


@answers("M23")
def mixing(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return what the time that pairs spend too close comes from, and how each moved since the week before (M23).

    Columns: pair-hours of any two people in view at once (crowding); the chance that two independent people are too
    close, and that over the chance if they used the floor evenly (layout); time too close over what both explain
    (behaviour); by factor its relative change, and its share of the change of the time too close.
    """
    mixing_now = inputs.results.mixing_now
    change = inputs.results.mixing if inputs.level.violation_rate.verdict is not None else None
    if inputs.why_no_time_too_close is not None or mixing_now.layout is None or mixing_now.behaviour is None:
        names = [c.name for c in MIXING if c.name != "copresent_pair_h"]
        why = inputs.why_no_time_too_close or lack(mixing_now.state, mixing_now.reason)
        cells: Row = {**dict.fromkeys(names, why), "copresent_pair_h": None}
        return (inputs.floor_answer("mixing", MIXING, cells),)
    reason = mixing_now.reason if mixing_now.lo is None else None
    if change is not None and change.state != "ok":
        reason = change.reason
    uniform = mixing_now.layout_uniform
    cells = {
        "copresent_h": Value(mixing_now.copresent_h),
        "layout_chance": Value(mixing_now.layout),
        "layout_over_uniform": known(mixing_now.layout / uniform if uniform else None, mixing_now.reason),
        "behaviour_ratio": Value(mixing_now.behaviour, mixing_now.lo, mixing_now.hi, reason=reason),
        "copresent_pair_h": mixing_now.copresent_h,
        **_moved(change),
    }
    return (inputs.floor_answer("mixing", MIXING, cells, Reason("note.behaviour")),)


def _moved(change: MixingChange | None) -> Row:
    """Return how each factor moved since the week before."""
    if change is None or change.state != "ok":
        state: State = "not_enough_data" if change is None else change.state
        why = lack(state, Reason("change.not_compared") if change is None else change.reason)
        return dict.fromkeys([c.name for c in MIXING if "_change" in c.name], why)
    behaviour = change.behaviour
    moved = lack("not_enough_data", change.reason)
    if behaviour is not None and behaviour.value is not None:
        moved = Value(behaviour.value - 1, behaviour.change_lo, behaviour.change_hi)
    ratios = {"crowding": change.crowding, "layout": change.layout}
    why_no_shares = Reason("change.no_shares")
    return {
        **{f"{name}_change": known(None if r is None else r - 1, change.reason) for name, r in ratios.items()},
        "behaviour_change": moved,
        **{f"{name}_change_share": known(getattr(change, f"{name}_share"), why_no_shares) for name in _FACTORS},
    }
