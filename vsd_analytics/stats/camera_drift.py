"""Does a camera lose or gain people beside its neighbours: a CUSUM of its weekly share (Page, Biometrika 41, 1954).

y_cw is the log of what camera c counted in week w over what it usually counts in the same hours of the week, less the
same of a neighbour over the hours that both recorded; of all neighbours the mean of the middle third, so that one that
drifts itself moves little. With m and s the mean and spread of y_c in the reference weeks, z = (y - m) / s,

    up_w = max(0, up_(w-1) + z_w - K),   down_w = max(0, down_(w-1) - z_w - K),   an alarm where either exceeds H.

K is half of the shift that should be found soon, in units of s: a recall that falls from .95 to .85 takes a tenth of
the people, two to three s of an office. H is the lowest limit with at most about two false alarms a camera in ten years
of offices, shops and museums (docs/statistics.md). s pools the cameras, as twelve weeks tell little of one, and grows
with the lag-1 correlation of the reference weeks (pooled, corrected for the means that were estimated). A shift under
`LEAST` is no alarm, however clear.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.stats.hour_of_week import Bools
from vsd_analytics.stats.period_days import Floats

K: Final = 1.0
"""Reference value, in weekly standard deviations."""
H: Final = 2.75
"""Threshold, in weekly standard deviations."""
LEAST: Final = 0.05
"""Relative change of people below which a drift is not named: the mean of the last four weeks."""
MIN_REFERENCE: Final = 8
"""Weeks of the reference in which a camera must be known."""
POOLED_DF: Final = 22.0
"""Degrees of freedom that the spread of all cameras counts for beside a camera's own: two thirds at twelve weeks."""
MOST_CORRELATION: Final = 0.8
HALF: Final = 0.5
"""Share of its usual people that the matched hours of a week must hold."""
LEAST_COUNT: Final = 0.01
"""A camera that counts nobody is taken to count this share of what is usual, as there is no log of none."""
LAST: Final = 4


@dataclass(frozen=True, slots=True)
class Drift:
    """What became of a camera's share of people.

    Attributes:
        change: Relative change of its people beside its neighbours, mean of four weeks up to the alarm: -0.1 = a tenth
            fewer.
        since: Week from which the sum rises that gave the alarm, 0 = the first watched.
    """

    change: float
    since: int


def shares(people: Floats, is_counted: Bools, *, n_reference: int) -> Floats:
    """Return the log share of each camera beside its neighbours by week, 0 at its usual one.

    Args:
        people: Person-time by camera, week and hour of the week, shape (n_cameras, n_weeks, n_hours).
        is_counted: Which of these were recorded, same shape.
        n_reference: First weeks, that say what is usual.

    Returns:
        Shape (n_cameras, n_weeks); NaN where a camera or all of its neighbours are not known, or there is no neighbour.
    """
    counted = np.where(is_counted, people, 0.0)
    n_known = is_counted[:, :n_reference].sum(axis=1)
    usual = counted[:, :n_reference].sum(axis=1) / np.maximum(n_known, 1)
    is_known = is_counted & (n_known > 0)[:, None, :]
    log_shares = np.full(people.shape[:2], np.nan)
    for c in range(len(people)):
        others = np.delete(np.arange(len(people)), c)
        both = is_known[c] & is_known[others]
        beside = _log_index(counted[others], usual[others], both) - _log_index(counted[[c]], usual[[c]], both)
        log_shares[c] = -_middle_third(beside)
    return log_shares


def drifts(share: Floats, *, n_reference: int) -> list[Drift | None]:
    """Return for each camera whether and since when its share drifts in the weeks after the reference.

    Args:
        share: What `shares` returned.
        n_reference: First weeks, that say what is usual.

    Returns:
        None for a camera without an alarm, or not watched (`is_watched`).
    """
    reference, watched = share[:, :n_reference], share[:, n_reference:]
    is_known = is_watched(share, n_reference=n_reference)
    alarms: list[Drift | None] = [None] * len(share)
    if not is_known.any():
        return alarms
    mean, sd = _usual(reference, is_known)
    for c in np.flatnonzero(is_known):
        apart = watched[c] - mean[c]
        alarms[c] = _alarm(apart[~np.isnan(apart)], np.flatnonzero(~np.isnan(apart)), float(sd[c]))
    return alarms


def is_watched(share: Floats, *, n_reference: int) -> Bools:
    """Return which cameras have enough reference weeks, and a week after them."""
    is_known = ~np.isnan(share)
    enough = is_known[:, :n_reference].sum(axis=1) >= MIN_REFERENCE
    return np.asarray(enough & is_known[:, n_reference:].any(axis=1))


def _log_index(counted: Floats, usual: Floats, used: Bools) -> Floats:
    """Return the log of what was counted in some hours over what is usual in them, by camera and week."""
    now, then = (counted * used).sum(axis=-1), (usual[:, None, :] * used).sum(axis=-1)
    enough = (then > 0) & (then >= HALF * usual.sum(axis=-1)[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(enough, np.log(np.maximum(now, LEAST_COUNT * then) / then), np.nan))


def _middle_third(values: Floats) -> Floats:
    """Return the mean of the middle third of each column; NaN counts for nothing."""
    ordered = np.sort(values, axis=0)  # NaN last
    n = (~np.isnan(values)).sum(axis=0)
    place = np.arange(len(values))[:, None]
    chosen = (place >= n // 3) & (place < n - n // 3)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(chosen, ordered, 0.0).sum(axis=0) / np.where(n > 0, chosen.sum(axis=0), np.nan))


def _usual(reference: Floats, is_known: Bools) -> tuple[Floats, Floats]:
    """Return mean and spread of each camera's share in the reference weeks, shape (n_cameras,)."""
    n = (~np.isnan(reference)).sum(axis=1)
    mean = np.nansum(reference, axis=1) / np.maximum(n, 1)
    apart = np.where(is_known[:, None], reference - mean[:, None], np.nan)
    squares, df = np.nansum(apart**2, axis=1), np.maximum(n - 1, 1)
    pooled = squares.sum() / max(1, df[is_known].sum())
    in_a_row = np.nansum(apart[:, 1:] * apart[:, :-1]) / max(squares.sum(), np.finfo(float).tiny)
    correlation = np.clip(in_a_row + 1 / reference.shape[1], 0.0, MOST_CORRELATION)
    variance = (squares + POOLED_DF * pooled) / (df + POOLED_DF)
    return mean, np.asarray(np.sqrt(variance * (1 + correlation) / (1 - correlation)))


def _alarm(apart: Floats, weeks: np.ndarray, sd: float) -> Drift | None:
    """Return the first alarm of a CUSUM, of shifts in weeks of the watch."""
    sums, since = {1: 0.0, -1: 0.0}, {1: 0, -1: 0}
    for k, shift in enumerate(apart.tolist()):
        change = float(np.expm1(apart[max(0, k + 1 - LAST) : k + 1].mean()))
        for way in (1, -1):
            if sums[way] == 0.0:
                since[way] = k
            sums[way] = max(0.0, sums[way] + way * shift / max(sd, 1e-9) - K)
            if sums[way] > H and way * change > LEAST:
                return Drift(change, int(weeks[since[way]]))
    return None
