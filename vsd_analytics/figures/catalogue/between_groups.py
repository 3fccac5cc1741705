"""Person-minutes too close between groups: of the week, and of a stay (M30)."""

from __future__ import annotations

from vsd_analytics.answer import Reason
from vsd_analytics.figures.catalogue.form import FigureInputs, Row, figure
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.week.results import Figure


@figure("M30")
def close_minutes(inputs: FigureInputs) -> Figure:
    """Return person-minutes too close between groups, with the interval of their share (M6)."""
    data = inputs.data
    if (why := inputs.why_no_person_time) is not None:
        return inputs.missing(*why)
    found = inputs.found.person_time.close_between
    share = inputs.rate(found)
    if share.value is None:
        return inputs.missing(share.state, share.reason or NOTHING_OPEN)
    lives = [c for c in inputs.found.groups.cameras if c.camera_id in data.ids and c.lives.state == "ok"]
    n_tracks = sum(c.lives.n_tracks for c in lives)
    stay_min = 60 * sum(c.exposure_h for c in lives) / n_tracks if n_tracks and not inputs.small(n_tracks) else None
    rows: list[Row] = []
    for what, per_share in (("in_all", 60 * found.exposure_h), ("per_stay", stay_min)):
        scaled = [None if v is None or per_share is None else v * per_share for v in (share.value, share.lo, share.hi)]
        rows.append({"what": Reason(f"row.{what}"), "value": scaled[0], "lo": scaled[1], "hi": scaled[2]})
    total = rows[0]
    return Figure(
        unit=inputs.unit,
        value=60 * found.exposure_h * share.value,
        lo=total["lo"],  # type: ignore[arg-type]
        hi=total["hi"],  # type: ignore[arg-type]
        denominator=found.exposure_h,
        rows=tuple(rows),
        reason=share.reason,
        note=Reason("note.stay"),
    )
