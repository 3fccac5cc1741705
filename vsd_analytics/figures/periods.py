"""Two periods of a floor side by side: what each of them knows, and which hours of both are compared.

A camera-hour enters a comparison when it enters rates in both periods, and the camera measured alike in both. Report
and `vsd compare` share this.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from datetime import date, timedelta
from functools import cached_property
from typing import Literal

import numpy as np

from vsd_analytics.answer import HoldsFor, Reason
from vsd_analytics.figures.comparable import DAY_MS, Recalibration, has_other_owners, pair_days, recalibrations
from vsd_analytics.figures.floor_days import NO_FLOOR, NO_IDS
from vsd_analytics.figures.operator_counts import begun_until_ms
from vsd_analytics.figures.panels import MIN_CAMERA_SHARE, WEEK, Array, Flags, FloorHours, Ints, Panel, Place
from vsd_analytics.figures.share.people import people_by_day, why_few_on_floor
from vsd_analytics.figures.slots import NO_POSITIONS
from vsd_analytics.stats.cut_share import CutShares, changed_cut_share
from vsd_analytics.stats.rates import HISTORY_WEEKS


class Period:
    """Days of a floor in a row, and what can be counted in them.

    Args:
        data: The floor.
        first, last: First and last local day.
    """

    def __init__(self, data: FloorHours, first: date, last: date) -> None:
        self.data, self.first, self.last = data, first, last
        self.days = data.warehouse.days(first, last)
        self.span_ms = data.span_ms(first, last)
        self.is_inside = data.inside(first, last)

    @cached_property
    def holds_for(self) -> HoldsFor:
        """Return what answers about this period are about."""
        site, floor = self.data.site, self.data.floor
        settings, inputs = site.settings.settings_id(), self.data.warehouse.inputs_digest
        return HoldsFor(site.site_id, floor.floor_id, self.first, self.last, settings=settings, inputs=inputs)

    @cached_property
    def not_over_ms(self) -> int | None:
        """Return the UTC start of the first hour that is not over, while opening hours of these days are still to come.

        None where the opening hours are all over, or none of them is: such days have nothing to be part of.
        """
        data = self.data
        until_ms = None if data.clock is None else begun_until_ms(data.warehouse, now=data.clock)
        if until_ms is None:
            return None
        is_open, is_over = self.is_inside & (data.hours.open_s > 0), data.hours.start_ms < until_ms
        return until_ms if (is_open & is_over).any() and (is_open & ~is_over).any() else None

    @cached_property
    def scheduled_h(self) -> float:
        """Return the opening hours of its cameras."""
        return float(self.data.hours.scheduled_s[:, self.is_inside].sum()) / 3600

    @cached_property
    def recorded_h(self) -> float:
        """Return the recorded opening hours of its cameras."""
        return float(self.data.hours.recorded_s[:, self.is_inside].sum()) / 3600

    @cached_property
    def history_days(self) -> list[date]:
        """Return the days of the five weeks before with counted hours, but for weekdays on which it is closed.

        For readers, without the weeks of which they know no violations.
        """
        withheld = self.data.warehouse.withheld_days.get(self.data.floor.floor_id, ())
        hours = self.data.hours
        past = self.data.inside(self.first - HISTORY_WEEKS * WEEK, self.first - timedelta(days=1))
        open_days = set(hours.weekday[self.is_inside & (hours.open_s > 0)].tolist())
        days = np.unique(hours.day[past & hours.is_counted.any(axis=0)])
        history = [date.fromordinal(d) for d in days.tolist() if (d - 1) % 7 in open_days]
        return [day for day in history if day not in withheld]

    @cached_property
    def whole(self) -> Place:
        """Return the whole floor, as far as its cameras' violations can be counted."""
        everyone = self.data.everyone
        able = np.array([c not in self.not_counted for c in self.data.ids], dtype=np.bool_)
        return Place(everyone.n * able[:, None], everyone.exposure_h, able)

    def knows(self, place: Place) -> bool:
        """Tell whether the period says anything of a place: some camera recorded that counts a noticeable part of it.

        Where those that did count less than `MIN_CAMERA_SHARE` of it together, that nothing was counted is no zero.
        """
        weights = self.data.camera_weights(place)
        is_inside = self.is_inside if place.is_there is None else self.is_inside & place.is_there
        if not is_inside.any():
            return False
        recorded = np.asarray(self.data.hours.is_counted[:, is_inside].any(axis=1))
        return not weights.any() or float(weights[recorded].sum()) >= MIN_CAMERA_SHARE

    def area(self, area_id: str | None) -> Place:
        """Return what was counted in an area; None is the rest of the floor."""
        n, exposure_h = self.data.counted_in(area_id)
        cameras = np.asarray((n + exposure_h).any(axis=1)) & self.whole.cameras
        return Place(n, exposure_h, cameras, self.data.is_there(area_id))

    @cached_property
    def not_counted(self) -> Mapping[str, Reason]:
        """Return the cameras whose violations cannot be counted, and why."""
        reasons: dict[str, Reason] = {}
        for camera_id, sums in zip(self.data.ids, self.data.records_in(self.first, self.last).tolist(), strict=True):
            n_persons, n_unlocated, n_records, n_joined = sums
            if n_joined * 2 < n_records:
                reasons[camera_id] = NO_IDS
            elif n_unlocated * 2 > n_persons > 0 and not self._sends_pairs(camera_id):
                reasons[camera_id] = NO_FLOOR
        return reasons

    @cached_property
    def knows_distances(self) -> Flags:
        """Return the cameras whose distances are known in every hour of the period that they recorded."""
        first, end = self.span_ms
        rows = self.data.warehouse.rows(
            "select camera_id, bool_and(violation_s is not null) as knows from camera_hours "
            "where recorded_open_s > 0 and hour_start_ms >= $first and hour_start_ms < $end group by camera_id",
            {"first": first, "end": end},
        )
        unknown = {r["camera_id"] for r in rows if not r["knows"]}
        return np.array([c not in unknown for c in self.data.ids], dtype=np.bool_)

    @cached_property
    def why_no_violations(self) -> Reason | None:
        """Return why violations cannot be counted on this floor, or None if they can."""
        recorded = np.asarray(self.data.hours.recorded_s[:, self.is_inside].any(axis=1))
        able = [c for i, c in enumerate(self.data.ids) if recorded[i] and c not in self.not_counted]
        return None if able or not self.not_counted else next(iter(self.not_counted.values()))

    @cached_property
    def why_no_exposure(self) -> Reason | None:
        """Return why person-time is unknown on this floor, or None if it is known."""
        hours = self.data.hours
        is_unknown = hours.is_counted[:, self.is_inside] & ~hours.knows_people[:, self.is_inside]
        return NO_POSITIONS if is_unknown.any() else None

    @cached_property
    def people_by_day(self) -> Mapping[str | None, Ints]:
        """Return how many people were in each area on each day, at least; None is the rest of the floor."""
        return people_by_day(self)

    @cached_property
    def why_few_people(self) -> Reason | None:
        """Return why nothing is given of the few people of this floor; None where there were enough."""
        return why_few_on_floor(self)

    @cached_property
    def why_no_places(self) -> Reason | None:
        """Return why violations cannot be placed on the floor, or None if they can."""
        first, end = self.span_ms
        row = self.data.warehouse.rows(
            "select count(*) as n, count(*) filter (where x_m is null) as n_unplaced from violations "
            "where list_contains($ids::varchar[], camera_id) and started_ms >= $first and started_ms < $end",
            {"ids": self.data.ids, "first": first, "end": end},
        )[0]
        return NO_POSITIONS if row["n_unplaced"] * 2 > row["n"] else None

    def _sends_pairs(self, camera_id: str) -> bool:
        first, end = self.span_ms
        query = "select 1 from camera_days where camera_id = $id and sends_pairs and utc_day between $first and $last"
        days = {"first": first // DAY_MS, "last": (end - 1) // DAY_MS}
        return bool(self.data.warehouse.rows(query, {"id": camera_id, **days}))


class TwoPeriods:
    """A period and the one it is compared with, over the camera-hours that both can answer for.

    Days are paired by weekday in order, hours by local hour and fold, so that a change of the clocks does no harm.

    Args:
        before: Period A.
        now: Period B, of the same floor.
    """

    def __init__(self, before: Period, now: Period) -> None:
        self.before, self.now, self.data = before, now, now.data
        self.pairs = pair_days(before.days, now.days)
        firsts, ends = zip(before.span_ms, now.span_ms, strict=True)
        self.span_ms = min(firsts), max(ends)

    @cached_property
    def recalibrated(self) -> Sequence[Recalibration]:
        """Return the cameras whose facts from one period to the other were computed under several calibrations."""
        first, end = self.span_ms
        return recalibrations(self.data.warehouse, cameras=self.data.cameras, first_ms=first, end_ms=end)

    @cached_property
    def is_comparable(self) -> Flags:
        """Return which cameras may be compared, shape (n_cameras,), one at least as of `hours`.

        A new calibration that gives cells of the floor to other cameras changes the counts of all. A camera whose
        violations could not be counted before has nothing to be compared with.
        """
        first, end = self.span_ms
        out = {r.camera_id for r in self.recalibrated}
        if out and has_other_owners(self.data.warehouse, self.data.floor, first_ms=first, end_ms=end):
            out = set(self.data.ids)
        out |= self.before.not_counted.keys()
        return np.array([c not in out for c in self.data.ids or [""]], dtype=np.bool_)

    @cached_property
    def cut_shares(self) -> CutShares | None:
        """Return the shares of track ids that go on under another one, where they differ by more than their noise."""
        return changed_cut_share(*(cut_ids(self.data, (p.first, p.last)) for p in (self.before, self.now)))

    def compared(self, place: Place, *, since: int | None = None) -> tuple[Panel, Panel]:
        """Return the panels of A and B over the comparable camera-hours that count in both, a column per pair of days.

        Args:
            place: What to compare.
            since: Only hours of B from this instant on (UTC milliseconds), and the same of A.
        """
        then, now = self._matched
        late = self.data.hours.start_ms[now] >= (since if since is not None else -np.inf)
        then, now = then[late], now[late]
        counted = self.data.hours.is_counted
        both = counted[:, now] & counted[:, then] & self.is_comparable[:, None]
        before_days, now_days = ([pair[k] for pair in self.pairs] for k in (0, 1))
        return self.data.sums(place, then, both, before_days), self.data.sums(place, now, both, now_days)

    def used(self, which: Literal[0, 1]) -> Flags:
        """Return the camera-hours of period A (0) or B (1) that are compared, shape (n_cameras, n_hours)."""
        then, now = self._matched
        counted = self.data.hours.is_counted
        chosen = np.zeros_like(counted)
        chosen[:, (then, now)[which]] = counted[:, now] & counted[:, then] & self.is_comparable[:, None]
        return chosen

    @cached_property
    def _matched(self) -> tuple[Ints, Ints]:
        """Return hours of A and the same hours of B, those that both have."""
        hours = self.data.hours
        numbers = ({pair[k].toordinal(): i for i, pair in enumerate(self.pairs)} for k in (0, 1))

        def keyed(number: Mapping[int, int]) -> dict[tuple[int, int, int], int]:
            inside = np.flatnonzero(np.isin(hours.day, list(number)))
            return {(number[int(hours.day[i])], int(hours.hour[i]), int(hours.fold[i])): int(i) for i in inside}

        then, now = (keyed(number) for number in numbers)
        both = [(then[key], i) for key, i in now.items() if key in then]
        hour_pairs = np.array(both, dtype=np.int64).reshape(-1, 2)
        return hour_pairs[:, 0], hour_pairs[:, 1]


def cut_ids(data: FloorHours, days: tuple[date, date], cameras: Collection[str] | None = None) -> tuple[Array, Array]:
    """Return by site day the track ids that go on under another one, less those by chance, and those that end.

    Args:
        data: The floor.
        days: First and last of them.
        cameras: Ids of cameras; None = the floor's.
    """
    rows = data.warehouse.table(
        "select (sum(n_goes_on) - sum(n_came_before))::double as goes_on, sum(n_ends)::double as ends from track_days "
        "where list_contains($cameras::varchar[], camera_id) and site_day between $first and $last "
        "group by site_day order by site_day",
        {"cameras": sorted(data.ids if cameras is None else cameras), "first": days[0], "last": days[1]},
    )
    return rows["goes_on"].to_numpy(), rows["ends"].to_numpy()
