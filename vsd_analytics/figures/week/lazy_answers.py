"""Every question the week's report asks of the analysis room, each asked once, and only when somebody wants it."""

from __future__ import annotations

from datetime import date, timedelta
from functools import cached_property

from vsd_analytics.config.change_log import read_log
from vsd_analytics.figures import (
    before_after,
    borders,
    episodes,
    forecast,
    gatherings,
    groups,
    hotspots,
    maps,
    mixing,
    person_time,
    self_check,
    sensitivity,
    trend,
)
from vsd_analytics.figures import hour_of_week as week_hours
from vsd_analytics.figures import unusual as unusual_hours
from vsd_analytics.figures.camera_watch import CameraWatch, floor_watch
from vsd_analytics.figures.change_weeks import days_needed
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.figures.share.hours import shared_slots
from vsd_analytics.figures.share.weeks import revealing_spots
from vsd_analytics.figures.slots import Slots
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.site.model import Site
from vsd_analytics.stats.decomposition import Mixing, MixingChange


def first_day(site: Site, monday: date) -> date:
    """Return the first day the longest question looks at: that of `shown_from`, or the weeks before a logged change.

    The weeks that a change is compared with are those before its entry, however long ago it was: a reference that
    shrank with time would be another verdict than that of `vsd compare --change`.
    """
    since, until = shown_from(site, monday), monday + WEEK - timedelta(days=1)
    numbers = [n for n, e in enumerate(read_log(site), 1) if since <= e.at.astimezone(site.zone).date() <= until]
    return min([since, *(days_needed(site, n)[0] for n in numbers)])


def shown_from(site: Site, monday: date) -> date:
    """Return the first day of what is shown: twelve weeks of trend and log, or the hotspots' earlier windows."""
    return min(trend.first_day(monday), forecast.first_day(monday), hotspots.days_needed(site, monday + WEEK)[0])


class LazyAnswers:
    """The answers of the analysis room for one floor and week.

    Args:
        data: The week; its warehouse reaches back to `first_day` or to the first stored week.
    """

    def __init__(self, data: WeekData) -> None:
        self._data, self._long = data, data.warehouse
        self._floor_id = data.floor.floor_id
        self._days = (data.monday, data.sunday)

    def _known_hours(self, slots: Slots) -> Slots:
        """Return the hours of some weeks as the readers of this week's report know them."""
        return shared_slots(slots, self._data)

    @cached_property
    def shown_from(self) -> date:
        """The first day from which logged changes are shown."""
        return max(self._long.first, shown_from(self._data.site, self._data.monday))

    @cached_property
    def trend(self) -> trend.FloorTrend:
        """How the last twelve weeks went (M28)."""
        return trend.trend(self._long, self._data.monday, floor_id=self._floor_id)

    @cached_property
    def hotspots(self) -> hotspots.FloorHotspots:
        """Where people spend more time too close than the crowd explains (M20)."""
        return hotspots.hotspots(self._long, floor_id=self._floor_id, until=self._days[1])

    @cached_property
    def revealing_spots(self) -> frozenset[str]:
        """Ids of hotspots whose figures would tell a small count."""
        return revealing_spots(self._data, self.hotspots)

    @cached_property
    def groups(self) -> groups.Groups:
        """Who came together, and violations in two readings (M9)."""
        return groups.groups(self._long, first=self._days[0], last=self._days[1])

    @cached_property
    def self_check(self) -> self_check.FloorSelfCheck:
        """How often the verdicts on the floor are false alarms, from the weeks stored up to this one."""
        return self_check.self_check(self._data, until=self._days[1])

    @cached_property
    def unusual(self) -> unusual_hours.UnusualWeek:
        """Hours far from usual (M24)."""
        return unusual_hours.unusual(self._long, self._data.monday, floor_id=self._floor_id, as_known=self._known_hours)

    @cached_property
    def outlook(self) -> forecast.FloorForecast:
        """The next week, and how good the last forecast was (M25)."""
        asked = self._long, self._data.monday
        outlook = forecast.forecast(*asked, floor_id=self._floor_id, as_known=self._known_hours)
        if outlook.people.state != "ok" or self.gatherings.state != "ok":
            return outlook
        counted = gatherings.gathering_hours(*asked, floor_id=self._floor_id)
        return forecast.forecast(*asked, floor_id=self._floor_id, gatherings=counted, as_known=self._known_hours)

    @cached_property
    def profile(self) -> week_hours.WeekProfile:
        """Hours of the week over four weeks, and the highest (M13, M14)."""
        return week_hours.week_profile(
            self._long, self._data.monday, floor_id=self._floor_id, as_known=self._known_hours
        )

    @cached_property
    def episodes(self) -> episodes.EpisodeFigures:
        """How long and close violations were, close contacts, tracks (M10 to M12, M4, M29)."""
        return episodes.episode_figures(self._long, floor_id=self._floor_id, first=self._days[0], last=self._days[1])

    @cached_property
    def sensitivity(self) -> sensitivity.ThresholdSensitivity:
        """What another distance, and the engine's stated error, would change (M26)."""
        return sensitivity.threshold_sensitivity(
            self._long, floor_id=self._floor_id, first=self._days[0], last=self._days[1]
        )

    @cached_property
    def gatherings(self) -> gatherings.Gatherings:
        """Clusters and gatherings (M21, M22)."""
        return gatherings.gatherings(self._long, floor_id=self._floor_id, first=self._days[0], last=self._days[1])

    @cached_property
    def mixing(self) -> MixingChange:
        """Whether crowding, layout or behaviour moved since the week before (M23)."""
        why = self._data.hidden.why_untimed or self._data.hidden_before.why_untimed
        return mixing.mixing_change(self._data.pair) if why is None else mixing.no_change(why)

    @cached_property
    def mixing_now(self) -> Mixing:
        """Crowding, layout and behaviour of the week itself (M23)."""
        return mixing.mixing_of(self._data.this)

    @cached_property
    def maps(self) -> maps.CellMaps:
        """The four maps of the week, by square metre (M16 to M19)."""
        return maps.cell_maps(self._long, floor=self._data.floor, cell_m=1.0, first=self._days[0], last=self._days[1])

    @cached_property
    def camera_watch(self) -> tuple[CameraWatch, ...]:
        """Which cameras lose or gain people beside their neighbours, up to the last week that is over (M29)."""
        monday = self._data.monday - timedelta(days=self._data.monday.weekday())
        is_whole = self._data.is_week and self._data.not_over_ms is None
        until = monday + WEEK if is_whole else monday
        return floor_watch(self._data.site, self._data.floor, until - timedelta(days=1))

    @cached_property
    def person_time(self) -> person_time.PersonTime:
        """How many people are in view, and how much of their time is too close (M3, M5, M6)."""
        able = {c.camera_id for c in self.groups.cameras if c.lives.state == "ok"}
        return person_time.person_time(self._data.this, able=able)

    @cached_property
    def borders(self) -> tuple[borders.AreaBorder, ...]:
        """Areas at the border of what the cameras see, at the end of the week (M15)."""
        return borders.area_borders(self._data.site, at_ms=self._data.this.span_ms[1] - 1)

    @cached_property
    def change_effects(self) -> tuple[before_after.BeforeAfterFigure, ...]:
        """Each change of the log that names an area of this floor, from the first week stored to this one (M27)."""
        area_ids = {a.area_id for a in self._data.areas}
        zone, first, last = self._data.site.zone, self.shown_from, self._days[1]
        return tuple(
            before_after.before_after(self._long, number)
            for number, entry in enumerate(read_log(self._data.site), 1)
            if entry.area_id in area_ids and first <= entry.at.astimezone(zone).date() <= last
        )
