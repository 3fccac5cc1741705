r"""Why is it close: crowding, layout, behaviour (M23).

Time that pairs spend closer than the legal distance is V = P L B:

* P, **crowding**: pair-time of any two people present at the same instant, sum over frames of n (n - 1) / 2 dt.
* L, **layout**: the share of P that would be close if everybody stood anywhere, independently, as often as the map of
  occupancy p says: L = sum over cells of p_c p_c' K(c' - c), K the chance that two points, uniform in two cells, are
  closer than the distance. High where people gather in few places, whatever they do to each other.
* B = V / (P L), **behaviour**: above 1 people stay together or queue, below 1 they keep apart.

Each camera is a room of its own, as nobody measures distances between people of two cameras: V and P are sums over
cameras, L = sum_c P_c L_c / P. Doubling people makes P about four times as large and leaves L and B as they are. The
interval of B is that of a ratio, V over P L, from how days differ; L itself is taken as known. One map is used for all
hours of a period, so a crowd that has another place at noon than at night counts as behaviour.

A change of V is reported in parts that add up: with factors f_k, prod f_k = theta, part k is

    L(theta) ln f_k,   L(theta) = (theta - 1) / ln theta,   sum of parts = theta - 1

(logarithmic mean Divisia index, Ang, Energy Policy 32, 2004): points of V before, exact, in any order of the factors.
Shares of the whole are given only where all parts go its way, so that no share exceeds the whole.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason, State
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.changes import compare_exposure
from vsd_analytics.stats.estimates import ChangeEstimate
from vsd_analytics.stats.quantiles import t_quantile

Floats = npt.NDArray[np.float64]

NODES: Final = 24
"""Gauss-Legendre nodes on each half of a cell's side, for `closeness`."""
MAP_AXES: Final = 2
"""Maps are rows by columns, pair-hours cameras by days."""
MIN_MOVE: Final = 1.05
"""Shares of a change smaller than 5 % mean nothing."""
MAX_OPPOSED: Final = 0.05
"""A part that went the other way by more than 5 % of the change leaves no shares: another would exceed the whole."""


@dataclass(frozen=True, slots=True)
class Mixing:
    """Crowding, layout and behaviour of a period (M23).

    Attributes:
        close_h: V, pair-hours closer than the distance.
        copresent_h: P, pair-hours of any two people.
        layout: L; None when no two people were ever present.
        layout_uniform: L if all cells that anybody used were used alike.
        behaviour: B; None when unknown.
        lo, hi: Its interval.
        n_days: Days with two people present.
        state, reason: As for every figure; B is given without an interval where days are too few.
    """

    close_h: float
    copresent_h: float
    layout: float | None
    layout_uniform: float | None
    behaviour: float | None
    lo: float | None
    hi: float | None
    n_days: int
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class MixingChange:
    """What moved the time that pairs spend close, from period A to period B, over the same camera-hours.

    ln V_B / V_A = ln P_B / P_A + ln L_B / L_A + ln B_B / B_A, exactly.

    Attributes:
        a, b: The periods.
        close: V_B / V_A; None when one is 0 or unknown, as the following.
        crowding: P_B / P_A.
        layout: L_B / L_A.
        behaviour: B_B / B_A with its interval, same weekdays paired.
        crowding_share, layout_share, behaviour_share: Shares of the change, together 1. None where a part went the
            other way by more than 5 % of it, and unless V changed by 5 % or more: shares of nothing mean nothing.
        state, reason: As for every figure.
        crowding_part, layout_part, behaviour_part: Parts of V_B / V_A - 1, which they add up to: -0.3 took away 30 % of
            the time there was before.
    """

    a: Mixing
    b: Mixing
    close: float | None
    crowding: float | None
    layout: float | None
    behaviour: ChangeEstimate | None
    crowding_share: float | None
    layout_share: float | None
    behaviour_share: float | None
    state: State
    reason: Reason | None
    crowding_part: float | None = None
    layout_part: float | None = None
    behaviour_part: float | None = None


@lru_cache(maxsize=8)
def closeness(*, cell_m: float, distance_m: float) -> Floats:
    """Return the probability that two points in two square cells are closer than a distance, by the cells' offset.

    K(i, j) = integral of T(u) T(v) [ (i + u)^2 + (j + v)^2 < (distance / cell)^2 ] du dv, T(u) = 1 - |u| on [-1, 1] the
    density of the difference of two uniform numbers; the inner integral in closed form, the outer by Gauss-Legendre.

    Args:
        cell_m: Side of a cell.
        distance_m: Strictly closer than this.

    Returns:
        Array of shape (2 k + 1, 2 k + 1), offset (0, 0) in the middle, k cells beyond which it is 0; not to be written.
    """
    if cell_m <= 0 or distance_m <= 0:
        raise ValueError("cell and distance must be positive")
    radius = distance_m / cell_m
    k = math.ceil(radius) + 1
    offsets = np.arange(-k, k + 1, dtype=np.float64)
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    u = np.concatenate([(nodes - 1) / 2, (nodes + 1) / 2])
    w = np.concatenate([weights, weights]) / 2 * (1 - np.abs(u))
    reach = np.sqrt(np.maximum(radius**2 - (offsets[:, None] + u) ** 2, 0.0))
    inside = _below(reach[None] - offsets[:, None, None]) - _below(-reach[None] - offsets[:, None, None])
    probability = (inside * w).sum(axis=2).clip(0.0, 1.0)
    kernel = np.asarray((probability + probability.T) / 2, dtype=np.float64)
    kernel.flags.writeable = False
    return kernel


def nearby(maps: npt.ArrayLike, kernel: Floats) -> Floats:
    """Return f(c) = sum over c' of K(c - c') x(c') for each map x: the surroundings of each cell, by fast transforms.

    Args:
        maps: Shape (n_maps, n_rows, n_columns); nothing beyond the edges.
        kernel: K, odd sides, offset (0, 0) in the middle (`closeness`).

    Returns:
        Same shape as `maps`, none below 0.
    """
    x = np.asarray(maps, dtype=np.float64)
    shape = [n + k - 1 for n, k in zip(x.shape[1:], kernel.shape, strict=True)]
    both = np.fft.irfft2(np.fft.rfft2(x, shape) * np.fft.rfft2(kernel, shape), shape)
    row, column = (k // 2 for k in kernel.shape)
    return np.asarray(both[:, row : row + x.shape[1], column : column + x.shape[2]].clip(0.0), dtype=np.float64)


def concentration(exposure: npt.ArrayLike, *, cell_m: float, distance_m: float) -> float:
    """Return L of one map: the chance that two people, placed independently by it, are closer than a distance.

    Args:
        exposure: Person-time per cell, shape (n_rows, n_columns); at least some.
        cell_m: Side of a cell.
        distance_m: Strictly closer than this.

    Raises:
        ValueError: Nobody was anywhere, or a number is negative or not finite.
    """
    p = np.asarray(exposure, dtype=np.float64)
    if p.ndim != MAP_AXES or not np.isfinite(p).all() or (p < 0).any() or p.sum() <= 0:
        raise ValueError("exposure must be a map of finite numbers, none negative, some positive")
    p = p / p.sum()
    kernel = closeness(cell_m=cell_m, distance_m=distance_m)
    return float(np.clip((p * nearby(p[None], kernel)[0]).sum(), 0.0, 1.0))


def mixing(
    close_h: npt.ArrayLike,
    copresent_h: npt.ArrayLike,
    exposure: Sequence[npt.ArrayLike],
    *,
    cell_m: float,
    distance_m: float,
    confidence: float = 0.95,
    min_days: int = DEFAULTS.min_days,
    min_person_h: float = DEFAULTS.min_exposure_h,
) -> Mixing:
    """Return crowding, layout and behaviour of a period (formulas: this module).

    Args:
        close_h: Pair-hours closer than the distance, shape (n_cameras, n_days).
        copresent_h: Pair-hours of any two people, same shape.
        exposure: A map of person-hours for each camera, of any shape; without anybody for a camera not used.
        cell_m: Side of the maps' cells.
        distance_m: The legal distance.
        confidence: Confidence level.
        min_days: Days an interval of B needs.
        min_person_h: Person-hours all maps together need.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or not finite.
    """
    limits = _Limits(cell_m, distance_m, confidence, min_days, min_person_h)
    return _mixing(_PairHours.checked(close_h, copresent_h, exposure), limits)[0]


def compare_mixing(
    close_h: tuple[npt.ArrayLike, npt.ArrayLike],
    copresent_h: tuple[npt.ArrayLike, npt.ArrayLike],
    exposure: tuple[Sequence[npt.ArrayLike], Sequence[npt.ArrayLike]],
    *,
    cell_m: float,
    distance_m: float,
    confidence: float = 0.95,
    min_days: int = DEFAULTS.min_days,
    min_person_h: float = DEFAULTS.min_exposure_h,
) -> MixingChange:
    """Return what moved the time that pairs spend close from period A to period B.

    Arguments are those of `mixing`, one for each period; column j of both periods is the same weekday, and both hold
    the same camera-hours.
    """
    limits = _Limits(cell_m, distance_m, confidence, min_days, min_person_h)
    days = [_PairHours.checked(v, p, maps) for v, p, maps in zip(close_h, copresent_h, exposure, strict=True)]
    (a, expected_a), (b, expected_b) = (_mixing(d, limits) for d in days)
    if not (a.layout and a.behaviour and b.layout and b.behaviour):
        reason = next((m.reason for m in (a, b) if m.reason is not None), None)
        return MixingChange(a, b, None, None, None, None, None, None, None, "not_enough_data", reason)
    close_a, close_b = (d.close.sum(axis=0)[None] for d in days)
    behaviour = compare_exposure(
        close_a, expected_a[None], close_b, expected_b[None], confidence=confidence, min_days=min_days
    )
    close, crowding, layout = b.close_h / a.close_h, b.copresent_h / a.copresent_h, b.layout / a.layout
    parts = additive_parts((crowding, layout, b.behaviour / a.behaviour))
    shares: list[float | None] = [None, None, None]
    if abs(math.log(close)) >= math.log(MIN_MOVE):
        part_shares = [part / (close - 1) for part in parts]
        shares = [*part_shares] if min(part_shares) >= -MAX_OPPOSED else shares
    return MixingChange(
        a, b, close, crowding, layout, behaviour,
        crowding_share=shares[0], layout_share=shares[1], behaviour_share=shares[2], state="ok", reason=None,
        crowding_part=parts[0], layout_part=parts[1], behaviour_part=parts[2],
    )  # fmt: skip


def additive_parts(factors: Sequence[float]) -> tuple[float, ...]:
    """Return the part of each factor in the relative change they make together; the parts sum to prod f - 1.

    Args:
        factors: Ratios after / before, all above 0.

    Raises:
        ValueError: A factor is 0 or below.

    Example:
        >>> [round(part, 3) for part in additive_parts([0.5, 1.2])]
        [-0.543, 0.143]
    """
    if not all(f > 0 for f in factors):
        raise ValueError("a factor must be above 0")
    logs = [math.log(f) for f in factors]
    whole = math.fsum(logs)
    mean = math.expm1(whole) / whole if whole else 1.0
    return tuple(mean * log for log in logs)


@dataclass(frozen=True, slots=True)
class _Limits:
    cell_m: float
    distance_m: float
    confidence: float
    min_days: int
    min_person_h: float


@dataclass(frozen=True, slots=True, eq=False)
class _PairHours:
    """Pair-hours by camera and day, and each camera's map."""

    close: Floats
    together: Floats
    maps: Sequence[Floats]

    @staticmethod
    def checked(close_h: npt.ArrayLike, copresent_h: npt.ArrayLike, exposure: Sequence[npt.ArrayLike]) -> _PairHours:
        close, together = (np.asarray(v, dtype=np.float64) for v in (close_h, copresent_h))
        if close.ndim != MAP_AXES or close.shape != together.shape or len(exposure) != len(close):
            raise ValueError("pair-hours need one shape (cameras, days), and a map for each camera")
        if not np.isfinite([close, together]).all() or (close < 0).any() or (together < 0).any():
            raise ValueError("pair-hours must be finite and not negative")
        return _PairHours(close, together, [np.asarray(m, dtype=np.float64) for m in exposure])


def _mixing(days: _PairHours, limits: _Limits) -> tuple[Mixing, Floats]:
    """Return the decomposition, and P L by day: the pair-hours that would be close by chance."""
    v, p, person_h = float(days.close.sum()), float(days.together.sum()), sum(float(m.sum()) for m in days.maps)
    if person_h < limits.min_person_h or p == 0:
        need = Reason("level.person_hours", least=limits.min_person_h, has=person_h)
        why = need if person_h < limits.min_person_h else Reason("mixing.alone")
        return Mixing(v, p, None, None, None, None, None, 0, "not_enough_data", why), days.together.sum(axis=0)
    layouts, uniform = (
        np.array([_layout(m, limits) for m in maps]) for maps in (days.maps, [(m > 0).astype(float) for m in days.maps])
    )
    expected = np.asarray(layouts @ days.together, dtype=np.float64)
    total, n_days = float(expected.sum()), int((expected > 0).sum())
    decomposition = (v, p, total / p, float((uniform @ days.together).sum()) / p, v / total if total else None)
    if v == 0 or total == 0 or n_days < limits.min_days:
        too_few = Reason("mixing.days", least=limits.min_days, has=n_days)
        why = Reason("mixing.never_close") if v == 0 else too_few
        return Mixing(*decomposition, None, None, n_days, "not_enough_data", why), expected
    ratio = v / total
    apart = (days.close.sum(axis=0) - ratio * expected) / v
    half = t_quantile(n_days - 1, confidence=limits.confidence) * math.sqrt(
        n_days / (n_days - 1) * float(apart @ apart)
    )
    return Mixing(*decomposition, ratio * math.exp(-half), ratio * math.exp(half), n_days, "ok", None), expected


def _layout(exposure: Floats, limits: _Limits) -> float:
    return concentration(exposure, cell_m=limits.cell_m, distance_m=limits.distance_m) if exposure.sum() > 0 else 0.0


def _below(x: Floats) -> Floats:
    """Return the chance that the difference of two uniform numbers is below x."""
    y = np.clip(x, -1.0, 1.0)
    return np.asarray(np.where(y < 0, (1 + y) ** 2 / 2, 1 - (1 - y) ** 2 / 2), dtype=np.float64)
