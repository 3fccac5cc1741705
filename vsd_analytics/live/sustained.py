"""Situations that last: sightings of successive instants joined into one situation, and the alarm it becomes."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

from vsd_analytics.live.events import AlarmEvent, AlarmStep, RuleAtCamera
from vsd_analytics.live.situations import Ground, Sighting
from vsd_analytics.site.model import AlarmRule, Site

_SHARED_MIN = 2
"""A situation goes on in a sighting that shares this many people with it."""


@dataclass(slots=True)
class _Situation:
    """A situation while it lasts.

    Attributes:
        since_ms, number: When it began, and which of those that began then it is.
        seen_ms: When it was last seen.
        tracks: Who was in it and when last.
        sum_x_mm, sum_y_mm, n_placed: Its mean place so far.
        reported_ms: When the last event of its alarm was made; None before the alarm starts.
        now: Its last sighting.
    """

    since_ms: int
    number: int
    seen_ms: int
    now: Sighting
    tracks: dict[str, int] = field(default_factory=dict)
    sum_x_mm: float = 0.0
    sum_y_mm: float = 0.0
    n_placed: int = 0
    n_people_max: int = 0
    n_people_reported: int = 0
    nearest_mm: int = 2**31
    reported_ms: int | None = None

    def take(self, sighting: Sighting, ts_ms: int, gap_ms: int) -> None:
        """Add the next sighting, and forget people who have not been in it for longer than `gap_ms`."""
        self.now, self.seen_ms = sighting, ts_ms
        self.tracks.update(dict.fromkeys(sighting.tracks, ts_ms))
        if len(self.tracks) > len(sighting.tracks):
            self.tracks = {track: seen for track, seen in self.tracks.items() if ts_ms - seen <= gap_ms}
        if sighting.x_mm is not None and sighting.y_mm is not None:
            self.sum_x_mm += sighting.x_mm
            self.sum_y_mm += sighting.y_mm
            self.n_placed += 1
        self.n_people_max = max(self.n_people_max, sighting.n_people)
        self.nearest_mm = min(self.nearest_mm, sighting.nearest_mm)

    @property
    def mean_place(self) -> tuple[float | None, float | None]:
        """Return the mean of its places so far."""
        return (self.sum_x_mm / self.n_placed, self.sum_y_mm / self.n_placed) if self.n_placed else (None, None)


@dataclass(frozen=True, slots=True)
class _Quiet:
    """A place where an alarm ended, and until when the same rule starts no alarm there."""

    until_ms: int
    place: tuple[float | None, float | None]


class Situations(RuleAtCamera):
    """The situations of one rule at one camera.

    Args:
        site: The project.
        ground: Its floor.
        rule: A rule of the kind "gathering" or "contact".
        camera_id: The camera.
    """

    def __init__(self, site: Site, *, ground: Ground, rule: AlarmRule, camera_id: str) -> None:
        super().__init__(site, rule=rule, camera_id=camera_id)
        self._ground = ground
        self._same_place_mm = site.settings.same_place_m * 1000
        self._situations: list[_Situation] = []
        self._quiet: list[_Quiet] = []

    @property
    def n_in_memory(self) -> int:
        """Return how many situations and places are in memory."""
        return len(self._situations) + len(self._quiet)

    @property
    def open_alarms(self) -> list[str]:
        """Return the ids of alarms that have started and not ended."""
        return [self._id(s.since_ms, s.number) for s in self._situations if s.reported_ms is not None]

    def pass_time(self, ts_ms: int, gap_ms: int) -> list[AlarmEvent]:
        """End situations last seen more than `gap_ms` before `ts_ms`."""
        over = [s for s in self._situations if ts_ms - s.seen_ms > gap_ms]
        if not over:
            return []
        self._situations = [s for s in self._situations if ts_ms - s.seen_ms <= gap_ms]
        ended = [s for s in over if s.reported_ms is not None]
        if self._cooldown_ms:
            self._quiet += [_Quiet(s.seen_ms + self._cooldown_ms, (s.now.x_mm, s.now.y_mm)) for s in ended]
        return [self._event(s, "end", s.seen_ms) for s in ended]

    def see(self, sightings: Sequence[Sighting], ts_ms: int, gap_ms: int) -> list[AlarmEvent]:
        """Take the sightings of one instant and return the events they cause.

        Args:
            sightings: All sightings that match the rule at this instant.
            ts_ms: UTC milliseconds, later than every instant before.
            gap_ms: A situation not seen for up to this long goes on.
        """
        events = self.pass_time(ts_ms, gap_ms)
        if not sightings:
            return events
        self._quiet = [q for q in self._quiet if q.until_ms > ts_ms]
        for situation in self._join(sightings, ts_ms, gap_ms):
            step = self._step(situation, ts_ms)
            if step is not None:
                situation.reported_ms, situation.n_people_reported = ts_ms, situation.n_people_max
                events.append(self._event(situation, step, ts_ms))
        return events

    def _join(self, sightings: Sequence[Sighting], ts_ms: int, gap_ms: int) -> list[_Situation]:
        """Return the situations seen now: each sighting continues one that shares people with it, or starts a new one.

        Situations with an alarm choose first, then older ones; each takes the sighting it shares most people with. So
        an alarm follows its people when a crowd splits or merges, and no order of records changes the result.
        """
        having: dict[str, list[int]] = defaultdict(list)
        for i, sighting in enumerate(sightings):
            for track in sighting.tracks:
                having[track].append(i)
        free = set(range(len(sightings)))
        seen = []
        for situation in sorted(self._situations, key=lambda s: (s.reported_ms is None, s.since_ms, s.number)):
            recent = (t for t, last in situation.tracks.items() if ts_ms - last <= gap_ms)
            shared = Counter(i for t in recent for i in having.get(t, ()) if i in free)
            best = min(shared, key=lambda i: (-shared[i], i), default=None)
            if best is not None and shared[best] >= _SHARED_MIN:
                free.remove(best)
                situation.take(sightings[best], ts_ms, gap_ms)
                seen.append(situation)
        for number, i in enumerate(sorted(i for i in free if len(sightings[i].tracks) >= _SHARED_MIN)):
            situation = _Situation(ts_ms, number, ts_ms, sightings[i])
            situation.take(sightings[i], ts_ms, gap_ms)
            self._situations.append(situation)
            seen.append(situation)
        return seen

    def _step(self, s: _Situation, ts_ms: int) -> AlarmStep | None:
        if s.reported_ms is None:
            is_due = ts_ms - s.since_ms >= self._for_ms and not self._is_quiet(s)
            return "start" if is_due and self._ground.is_owned(self._camera.camera_id, ts_ms, *s.mean_place) else None
        return "update" if ts_ms - s.reported_ms >= self._update_ms or s.n_people_max > s.n_people_reported else None

    def _is_quiet(self, s: _Situation) -> bool:
        x, y = s.now.x_mm, s.now.y_mm
        for quiet in self._quiet:
            qx, qy = quiet.place
            if self.rule.area_id is not None or x is None or y is None or qx is None or qy is None:
                return True
            if (x - qx) ** 2 + (y - qy) ** 2 <= self._same_place_mm**2:
                return True
        return False

    def _event(self, s: _Situation, step: AlarmStep, at_ms: int) -> AlarmEvent:
        return self._step_event(
            step,
            at_ms,
            s.since_ms,
            number=s.number,
            x_mm=s.now.x_mm,
            y_mm=s.now.y_mm,
            n_people=s.now.n_people,
            n_people_max=s.n_people_max,
            nearest_mm=s.nearest_mm,
        )
