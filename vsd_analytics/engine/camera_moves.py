"""Whether a camera was moved: the people it sees stop fitting the horizon that its calibration has.

Under the right camera a body has one height wherever it is. When the camera tilts, bodies come out too tall or too
short by an amount that depends on how far away they are. Who is there changes from hour to hour; how one person's
height changes along a walk does not. So each hour gives a tilt and a roll against the calibration, and a move is a
lasting step in them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.calibration_fit import BODY_SD, MARK_PX, POSTURE_SD, heights_m
from vsd_analytics.engine.camera_model import CameraModel
from vsd_analytics.engine.people import Array, People
from vsd_analytics.engine.sightings import Sightings, sightings
from vsd_analytics.geometry.homography import to_floor

HOUR_MS: Final = 3_600_000
SLOT_PEOPLE: Final = 20
"""A slot is an hour, or as many hours as it takes to see so many people (parts of walks without track ids)."""
MIN_SLOTS: Final = 3
"""A move lasts so many slots: an hour of people who crouch is none."""
MIN_DAYS: Final = 4
"""An hour of the day can differ from others when it was seen on so many days."""
LEAST_DEG: Final = 0.5
"""Smaller steps are not reported: they change distances by less than the calibration's own error."""
LEAST_SINCE_DEG: Final = 1.5
"""The same against the people of the calibration, who were others."""
CHI_SQUARE: Final = 25.0
"""Least statistic of a step. The largest of quiet weeks is in docs/engine.md."""
SLOT_SD_DEG: Final = 0.15
"""What the tilt of a slot varies by for other reasons than chance, as where children and sitting people are."""
CROWD_SD: Final = 0.06
"""Mean height of the people of a slot, relative."""
TUKEY: Final = 4.0
"""Residuals of so many sd do not count."""
CHI_SQUARE_MEDIAN: Final = 0.455
"""Of one degree of freedom."""
_TURN: Final = 1e-4
"""Radians: step of the derivative."""
_ROUNDS: Final = 12


@dataclass(frozen=True, slots=True)
class Turn:
    """How a camera is turned against its calibration.

    Attributes:
        tilt_rad: Further down.
        roll_rad: Further clockwise.
        tilt_sd_rad: Standard deviation of the tilt.
        roll_sd_rad: And of the roll.
    """

    tilt_rad: float
    roll_rad: float
    tilt_sd_rad: float
    roll_sd_rad: float


@dataclass(frozen=True, slots=True)
class CameraMove:
    """A lasting turn of a camera.

    Attributes:
        after_ms: The last instant before it with enough people, UTC milliseconds; None = before the recording, since
            the calibration.
        before_ms: The first instant after it with enough people.
        tilt_deg: How much further down the camera looks.
        roll_deg: How much further it is turned clockwise.
        distance_change: Median relative change of distances between people while the old calibration stays.
        chi_square: The step against its error, two degrees of freedom.
    """

    after_ms: int | None
    before_ms: int
    tilt_deg: float
    roll_deg: float
    distance_change: float
    chi_square: float


@dataclass(frozen=True, slots=True)
class CameraCheck:
    """What a check for moves found.

    Attributes:
        moves: In order of time.
        n_people: Whole people in all frames.
        n_slots: Slots of time they were divided into.
        least_deg: Tilt in the middle of the recording that would be found; None with too few slots.
    """

    moves: tuple[CameraMove, ...]
    n_people: int
    n_slots: int
    least_deg: float | None


@dataclass(frozen=True, slots=True)
class _Slots:
    """Turns against the calibration by slot: tilt and roll in radians, their variances, first and last time."""

    turn: Array
    variance: Array
    start_ms: NDArray[np.int64]
    end_ms: NDArray[np.int64]


def check_camera(
    people: People, camera: CameraModel, *, depth_m: float, size_px: tuple[int, int], usual: Turn | None = None
) -> CameraCheck:
    """Return the moves of a camera while it saw some people.

    A turn about the vertical axis leaves all heights as they were: it is not seen.

    Args:
        people: Boxes or joints over days, in frames with times (`ts_ms`).
        camera: As calibrated.
        depth_m: Depth of a body; see `sightings.Body`.
        size_px: Width and height of the picture.
        usual: Turn of the people of the calibration; with it, a move before the recording is found as well.
    """
    if people.ts_ms is None:
        raise ValueError("a move needs times")
    seen = sightings(people, size_px=size_px)
    when = people.ts_ms[np.searchsorted(people.frames, seen.frame)]
    slots = _slots(seen, when, camera, depth_m)
    n = len(slots.turn)
    if n < 2 * MIN_SLOTS:
        return CameraCheck((), len(seen.low), n, None)
    covariances = _covariances(slots)
    steps = sorted(_steps(slots.turn, covariances, 0, n), key=lambda step: step.at)
    if usual is not None:
        steps[:0] = _step_since(usual, slots, covariances, steps[0].at if steps else n)
    moves = _moves(steps, slots, seen, when, camera, depth_m, size_px, usual)
    half = np.repeat([0.0, 1.0], [n // 2, n - n // 2])
    tilt_sd = float(_estimate(half[None], slots.turn[:, 0], covariances[0])[1][0] ** -0.5)
    return CameraCheck(moves, len(seen.low), n, max(LEAST_DEG, float(np.degrees(np.sqrt(CHI_SQUARE) * tilt_sd))))


def usual_turn(seen: Sightings, camera: CameraModel, *, depth_m: float) -> Turn:
    """Return the turn that makes the heights of all sightings equal: not quite none, as no body is a straight line."""
    log_height, slope, sd = _linear(seen, camera, depth_m)
    usable = np.isfinite(log_height) & np.isfinite(slope).all(axis=1)
    (tilt, roll), (tilt_var, roll_var) = _turn(log_height[usable], slope[usable], sd[usable], seen.who[usable])
    return Turn(float(tilt), float(roll), float(np.sqrt(tilt_var)), float(np.sqrt(roll_var)))


# --- the turn of each slot --------------------------------------------------------------------------------------


def _slots(seen: Sightings, when: NDArray[np.int64], camera: CameraModel, depth_m: float) -> _Slots:
    """Return tilt and roll against the calibration in slots of whole hours."""
    log_height, slope, sd = _linear(seen, camera, depth_m)
    usable = np.isfinite(log_height) & np.isfinite(slope).all(axis=1)
    order = np.flatnonzero(usable)[np.argsort(when[usable], kind="stable")]
    hour = when[order] // HOUR_MS
    turns, variances, start, end = [], [], [], []
    for rows in _full(order, hour, seen.who):
        turn, variance = _turn(log_height[rows], slope[rows], sd[rows], seen.who[rows])
        turns.append(turn)
        variances.append(variance)
        start.append(int(when[rows[0]]))
        end.append(int(when[rows[-1]]))
    return _Slots(
        np.array(turns).reshape(-1, 2),
        np.array(variances).reshape(-1, 2),
        np.array(start, dtype=np.int64),
        np.array(end, dtype=np.int64),
    )


def _full(order: NDArray[np.intp], hour: NDArray[np.int64], who: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Return the rows of each slot: hours in order, put together until there are `SLOT_PEOPLE`."""
    edges = [0, *(np.flatnonzero(np.diff(hour)) + 1).tolist(), len(order)]
    slots, first = [], 0
    for begin, end in pairwise(edges):
        if first < begin and hour[begin] - hour[begin - 1] > 1:  # a slot must not reach over a closed night
            first = begin
        if len(np.unique(who[order[first:end]])) >= SLOT_PEOPLE:
            slots.append(order[first:end])
            first = end
    return slots


def _linear(seen: Sightings, camera: CameraModel, depth_m: float) -> tuple[Array, Array, Array]:
    """Return log(height / usual height) of each sighting, its derivative by tilt and roll, and its sd on a walk."""

    def log_height(view: CameraModel) -> Array:
        heights = heights_m(view, seen, depth_m)[0]
        return np.asarray(np.log(np.where(heights > 0.1, heights, np.nan) / seen.body.high_m))

    at = log_height(camera)
    turned = (replace(camera, tilt_rad=camera.tilt_rad + _TURN), replace(camera, roll_rad=camera.roll_rad + _TURN))
    slope = np.column_stack([(log_height(view) - at) / _TURN for view in turned])
    return at, slope, np.hypot(POSTURE_SD, np.sqrt(2) * MARK_PX / seen.length_px)


def _turn(log_height: Array, slope: Array, sd: Array, who: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the turn (tilt, roll) that makes heights equal, radians, and its variances over persons.

    A person's mean height is compared with that of others, and each sighting with the person's mean. Weights are those
    of Tukey's biweight after Cauchy's: children and sitting people do not count, their walks do.
    """
    person, person_of_row, size = np.unique(who, return_inverse=True, return_counts=True)
    design = np.column_stack([np.ones(len(sd)), -slope])

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(person_of_row, values) / size)

    middle = np.column_stack([mean(column) for column in design.T])
    mean_height = mean(log_height)
    x = np.concatenate([middle, design - middle[person_of_row]])
    y = np.concatenate([mean_height, log_height - mean_height[person_of_row]])
    of_all = np.concatenate([np.arange(len(person)), person_of_row])
    own = np.concatenate([np.sqrt(BODY_SD**2 + mean(sd**2) / size), sd])
    prior = np.diag([1 / CROWD_SD**2, 0.0, 1 / np.radians(5.0) ** 2])
    weight = 1 / own**2
    for round_ in range(2 * _ROUNDS):
        normal = x.T @ (x * weight[:, None]) + prior
        fitted = np.linalg.solve(normal, x.T @ (weight * y))
        off = (y - x @ fitted) / own
        robust = 1 / (1 + off**2) if round_ < _ROUNDS else np.maximum(0, 1 - (off / TUKEY) ** 2) ** 2
        weight = robust / own**2
    inverse = np.linalg.inv(x.T @ (x * weight[:, None]) + prior)
    pull = x * (weight * (y - x @ fitted))[:, None]
    each = np.column_stack([np.bincount(of_all, column, minlength=len(person)) for column in pull.T])
    covariance = inverse @ (each.T @ each + prior) @ inverse
    return fitted[1:], np.diag(covariance)[1:] + np.radians(SLOT_SD_DEG) ** 2


# --- steps ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Step:
    at: int  # first slot after it
    turn: Array
    chi_square: float


def _covariances(slots: _Slots) -> tuple[Array, Array]:
    """Return the covariances of the slots' tilts and of their rolls, each shape (n, n).

    Slots of the same hour of the day share something: the same children come out of school every day. Neighbouring
    slots, and the same hour on neighbouring days, show by how much the slots' own errors are too small. Medians of
    differences do not see a step, which is in one of them.
    """
    hours = [np.flatnonzero(slots.start_ms // HOUR_MS % 24 == hour) for hour in range(24)]
    covariances = []
    for turn, variance in zip(slots.turn.T, slots.variance.T, strict=True):
        own = variance * max(1.0, _excess(turn, variance))
        for rows in hours:
            if len(rows) >= MIN_DAYS:
                own[rows] = np.maximum(own[rows], variance[rows] * _excess(turn[rows], variance[rows]))
        covariance = np.diag(own)
        known = [rows for rows in hours if len(rows) >= MIN_DAYS]
        if len(known) > 1:
            means = np.array([np.mean(turn[rows]) for rows in known])
            chance = np.mean([np.mean(own[rows]) / len(rows) for rows in known])
            for rows in known:
                covariance[np.ix_(rows, rows)] += max(0.0, float(np.var(means) - chance))
        covariances.append(covariance)
    return covariances[0], covariances[1]


def _excess(turn: Array, variance: Array) -> float:
    """Return by how much successive values differ more than their variances say."""
    return float(np.median(np.diff(turn) ** 2 / (variance[1:] + variance[:-1])) / CHI_SQUARE_MEDIAN)


def _estimate(is_after: Array, turn: Array, covariance: Array) -> tuple[Array, Array]:
    """Return a step on top of a constant for each row of `is_after` and its information (generalised least squares)."""
    weight = np.linalg.inv(covariance)
    after, total = is_after @ weight, weight.sum(axis=0)
    shared = after.sum(axis=1) / total.sum()
    information = np.sum(after * is_after, axis=1) - shared * after.sum(axis=1)
    return (after - shared[:, None] * total) @ turn / information, information


def _steps(turn: Array, covariances: tuple[Array, Array], first: int, end: int) -> list[_Step]:
    """Return the steps within [first, end): the clearest one, then those on either side of it."""
    if end - first < 2 * MIN_SLOTS:
        return []
    at = np.arange(first + MIN_SLOTS, end - MIN_SLOTS + 1)
    is_after = (np.arange(first, end) >= at[:, None]).astype(np.float64)
    parts = [
        _estimate(is_after, turn[first:end, axis], covariance[first:end, first:end])
        for axis, covariance in enumerate(covariances)
    ]
    step = np.column_stack([estimate for estimate, _ in parts])
    chi_square = np.sum([estimate**2 * information for estimate, information in parts], axis=0)
    best = int(np.argmax(chi_square))
    if chi_square[best] < CHI_SQUARE or np.degrees(np.linalg.norm(step[best])) < LEAST_DEG:
        return []
    k = int(at[best])
    clearest = _Step(k, step[best], float(chi_square[best]))
    return [clearest, *_steps(turn, covariances, first, k), *_steps(turn, covariances, k, end)]


def _step_since(usual: Turn, slots: _Slots, covariances: tuple[Array, Array], end: int) -> list[_Step]:
    """Return the step from the people of the calibration to the first slots, up to the first step inside."""
    weights = [np.linalg.inv(covariance[:end, :end]).sum(axis=0) for covariance in covariances]
    mean = np.array([weight @ slots.turn[:end, axis] / weight.sum() for axis, weight in enumerate(weights)])
    step = mean - (usual.tilt_rad, usual.roll_rad)
    variance = np.array([1 / weight.sum() for weight in weights]) + np.square([usual.tilt_sd_rad, usual.roll_sd_rad])
    chi_square = float(np.sum(step**2 / variance))
    is_one = chi_square >= CHI_SQUARE and np.degrees(np.linalg.norm(step)) >= LEAST_SINCE_DEG
    return [_Step(0, step, chi_square)] if is_one else []


def _moves(
    steps: list[_Step],
    slots: _Slots,
    seen: Sightings,
    when: NDArray[np.int64],
    camera: CameraModel,
    depth_m: float,
    size_px: tuple[int, int],
    usual: Turn | None,
) -> tuple[CameraMove, ...]:
    """Return the moves at some steps, each by the turns of everybody seen before it and after it."""
    starts = [int(slots.start_ms[step.at]) for step in steps]
    inner = [ms for step, ms in zip(steps, starts, strict=True) if step.at]
    spans = np.searchsorted(inner, when, side="right")
    levels = [_level(seen.rows(np.flatnonzero(spans == i)), camera, depth_m) for i in range(len(inner) + 1)]
    if usual is not None and len(inner) < len(steps):
        levels.insert(0, np.array([usual.tilt_rad, usual.roll_rad]))
    moves = []
    for step, start, (was, now) in zip(steps, starts, pairwise(levels), strict=True):
        tilt, roll = now - was
        turned = replace(camera, tilt_rad=camera.tilt_rad + tilt, roll_rad=camera.roll_rad + roll)
        moves.append(
            CameraMove(
                after_ms=int(slots.end_ms[step.at - 1]) if step.at else None,
                before_ms=start,
                tilt_deg=float(np.degrees(tilt)),
                roll_deg=float(np.degrees(roll)),
                distance_change=_distance_change(camera, turned, seen.low, size_px),
                chi_square=step.chi_square,
            )
        )
    return tuple(moves)


def _level(seen: Sightings, camera: CameraModel, depth_m: float) -> Array:
    """Return tilt and roll against the calibration, radians: a few steps, as a large turn is not linear."""
    level = np.zeros(2)
    for _ in range(3):
        view = replace(camera, tilt_rad=camera.tilt_rad + level[0], roll_rad=camera.roll_rad + level[1])
        more = usual_turn(seen, view, depth_m=depth_m)
        level += (more.tilt_rad, more.roll_rad)
    return level


def _distance_change(camera: CameraModel, turned: CameraModel, low: Array, size_px: tuple[int, int]) -> float:
    """Return how much longer distances of foot points that are near in the picture are by the old camera, relative."""
    some = low[:: max(1, len(low) // 500)]
    a, b = np.triu_indices(len(some), 1)
    was, now = (to_floor(view.homography(), some, picture_px=size_px) for view in (camera, turned))
    old, new = (np.linalg.norm(xy[a] - xy[b], axis=1) for xy in (was, now))
    near = (new > 0.5) & (new < 4) & np.isfinite(old)
    return float(np.median(old[near] / new[near]) - 1) if near.any() else float("nan")
