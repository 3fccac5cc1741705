"""The alarm engine: stored records in, alarm events out; the same for a live stream and for a stored day.

All rules use event time, camera by camera, so a camera with a wrong clock or a slow network disturbs no other. Records
wait until they are `lateness_s` behind the newest of their camera, and are then handled in order; the same record twice
counts once. So order, batches and duplicates of the delivery change nothing. The exception are records that come later
than `lateness_s` behind the newest of all cameras: they are counted in `n_late`.

A camera's time also passes while it sends nothing, by as much as the other cameras' time, or the clock given to `tick`,
has moved since its last record.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from datetime import datetime

import pyarrow as pa

from vsd_analytics.live.companions import Companions
from vsd_analytics.live.events import AlarmEvent
from vsd_analytics.live.silence import Opening, Silence
from vsd_analytics.live.situations import Ground, Instant, Name, Sighting, contacts, gatherings, people_graph
from vsd_analytics.live.sustained import Situations
from vsd_analytics.schema import TableName
from vsd_analytics.site.model import AlarmRule, Camera, Site

_INTERVAL_MAX_MS = 1_200_000  # of the fact camera_days
_INTERVALS = 31
_NAN = float("nan")


class AlarmEngine:
    """Turns records into alarms.

    Args:
        site: The project; its cameras, areas, opening hours and settings are used.
        rules: Rules to apply; None = those of the site.
        start: Instant from which a camera without any record counts as silent; None = a camera must send first.

    Attributes:
        n_late: Records that came too late to count.
        n_untracked: Person records without a track id. They count in a gathering, but cannot make it last.
        n_instants: Instants handled, of all cameras.
    """

    def __init__(self, site: Site, *, rules: Sequence[AlarmRule] | None = None, start: datetime | None = None) -> None:
        s = site.settings
        self.rules = tuple(site.alarms if rules is None else rules)
        self.n_late = self.n_untracked = self.n_instants = 0
        self._lateness_ms = round(s.lateness_s * 1000)
        self._ground = Ground(site)
        self._clock_ms: int | None = None
        self._streams = {c.camera_id: _Stream(site, c, self.rules, self._ground) for c in site.cameras}
        if start is not None:
            self.watch(start)

    @property
    def open_alarms(self) -> list[str]:
        """Return the ids of alarms that have started and not ended."""
        return [alarm for stream in self._streams.values() for alarm in stream.open_alarms]

    @property
    def n_in_memory(self) -> int:
        """Return how many records, people, pairs and situations are in memory."""
        return sum(stream.n_in_memory for stream in self._streams.values())

    def watch(self, start: datetime, *, cameras: Collection[str] | None = None) -> None:
        """Count cameras without any record as silent from `start` on.

        Args:
            start: Instant of the first record to expect.
            cameras: Only these; None = all.
        """
        self._clock_ms = max(epoch_ms(start), self._clock_ms or 0)
        for camera_id, stream in self._streams.items():
            if stream.newest_ms is None and (cameras is None or camera_id in cameras):
                stream.watch(epoch_ms(start), self._clock_ms)

    def feed(self, tables: Mapping[TableName, pa.Table], *, now: datetime | None = None) -> list[AlarmEvent]:
        """Take records and return the events they cause.

        Args:
            tables: Rows in `SCHEMAS`, in any order; cameras the site does not have are skipped.
            now: The clock, when listening: a camera whose clock is ahead of it does not make the others silent.

        Returns:
            The events that are due now, in order of time.
        """
        heard: dict[str, int] = {}
        for camera_id, ts_ms, instant in self._instants(tables):
            if instant is None:
                self.n_late += 1
            elif ts_ms > heard.get(camera_id, -1):
                heard[camera_id] = ts_ms
        if not heard:
            return []
        newest = max(heard.values())
        self._clock_ms = max(newest if now is None else min(newest, epoch_ms(now)), self._clock_ms or 0)
        for camera_id, newest_ms in heard.items():
            self._streams[camera_id].hear(newest_ms, self._clock_ms)
        return self._advance()

    def tick(self, now: datetime) -> list[AlarmEvent]:
        """Take the time when no record has come, and return the events of cameras that have fallen silent."""
        self._clock_ms = max(epoch_ms(now), self._clock_ms or 0)
        return self._advance()

    def resume(self, now: datetime) -> None:
        """Start to listen at `now`: before, nobody listened, so the cameras were not silent.

        Cameras without any record count as silent from `now` on.
        """
        self.watch(now)
        for stream in self._streams.values():
            stream.heard_ms = self._clock_ms or 0

    def close(self, until: datetime | None = None) -> list[AlarmEvent]:
        """Handle all waiting records: none of an instant before `until` will come. Feeding may go on after it.

        Args:
            until: End of the records fed; None = their newest instant. Situations that go on there stay open.
        """
        if until is not None:
            self._clock_ms = max(epoch_ms(until), self._clock_ms or 0)
        if self._clock_ms is None:
            return []
        events = [e for stream in self._streams.values() for e in stream.pass_time(self._clock_ms, is_all=True)]
        return sorted(events, key=lambda e: e.order)

    def _advance(self) -> list[AlarmEvent]:
        events: list[AlarmEvent] = []
        clock_ms = self._clock_ms
        if clock_ms is not None:
            for stream in self._streams.values():
                if stream.newest_ms is not None:
                    since_heard = max(0, clock_ms - stream.heard_ms)
                    events += stream.pass_time(stream.newest_ms + since_heard - self._lateness_ms)
            self.n_instants = sum(stream.n_instants for stream in self._streams.values())
        return sorted(events, key=lambda e: e.order)

    def _instants(self, tables: Mapping[TableName, pa.Table]) -> Iterator[tuple[str, int, Instant | None]]:
        """Add every record to its instant and yield the instant; None when it has been handled already."""
        for camera_id, ts_ms, n_pairs in _rows(tables, "frames", "n_pairs"):
            if (stream := self._streams.get(camera_id)) is not None:
                instant = stream.instant(ts_ms)
                if instant is not None and n_pairs is not None:
                    instant.has_engine_pairs = True
                yield camera_id, ts_ms, instant
        observations = tables.get("observations")
        if observations is not None and observations.num_rows:
            x_mm, y_mm = (axis.tolist() for axis in self._ground.place(observations))
            rows = _rows(tables, "observations", "track_id", "u_px", "v_px")
            for (camera_id, ts_ms, track, u, v), x, y in zip(rows, x_mm, y_mm, strict=True):
                if (stream := self._streams.get(camera_id)) is not None:
                    instant = stream.instant(ts_ms)
                    if instant is not None:
                        self.n_untracked += track is None
                        known = not math.isnan(x)
                        name: Name = (track,) if track is not None else (None, x if known else u, y if known else v)
                        instant.add_person(name, track, x, y)
                    yield camera_id, ts_ms, instant
        sides = ("person_a", "person_b", "track_a", "track_b", "x_a_mm", "y_a_mm", "x_b_mm", "y_b_mm")
        for camera_id, ts_ms, n_a, n_b, a, b, *at, distance in _rows(tables, "pairs", *sides, "distance_mm"):
            if (stream := self._streams.get(camera_id)) is not None:
                instant = stream.instant(ts_ms)
                if instant is not None:
                    names = [
                        (track,) if track is not None else (None, number, x, y)
                        for track, number, x, y in ((a, n_a, *at[:2]), (b, n_b, *at[2:]))
                    ]
                    xa, ya, xb, yb = (_NAN if v is None else float(v) for v in at)
                    key = (*names[0], "-", *names[1], distance if a is None or b is None else None)
                    row = (names[0], names[1], a, b, (xa, ya, xb, yb), 2**31 - 1 if distance is None else distance)
                    if key not in instant.pairs or row[5] < instant.pairs[key][5]:
                        instant.pairs[key] = row
                yield camera_id, ts_ms, instant


class _Stream:
    """One camera's records in order, and the rules applied to them.

    Attributes:
        newest_ms: Its latest instant; None before the first.
        heard_ms: The clock when its last record came.
    """

    def __init__(self, site: Site, camera: Camera, rules: Sequence[AlarmRule], ground: Ground) -> None:
        camera_rules = [r for r in rules if not r.camera_ids or camera.camera_id in r.camera_ids]
        self._camera, self._ground = camera, ground
        self._distance_mm = round(site.settings.distance_m * 1000)
        self._gap_ms = round(site.settings.episode_gap_s * 1000)
        self._situations = [
            Situations(site, ground=ground, rule=r, camera_id=camera.camera_id)
            for r in camera_rules
            if r.kind != "silence"
        ]
        self._silences = [
            Silence(site, rule=r, camera_id=camera.camera_id) for r in camera_rules if r.kind == "silence"
        ]
        self._companions = (
            Companions(site.settings)
            if any(r.kind == "contact" and r.is_between_groups for r in camera_rules)
            else None
        )
        self._opening = Opening(site)
        self._fixed_interval_ms = None if camera.hz is None else 1000 / camera.hz
        self._waiting: dict[int, Instant] = {}
        self._intervals: deque[int] = deque(maxlen=_INTERVALS)
        self._last_ms: int | None = None
        self._tolerated_ms = _INTERVAL_MAX_MS * 5 // 2  # the longest gap within a situation, until the rate is known
        self._over_ms = -(2**62)  # earlier instants have been handled
        self.newest_ms: int | None = None
        self.heard_ms = 0
        self.n_instants = 0

    @property
    def n_in_memory(self) -> int:
        waiting = sum(1 + len(i.persons) + len(i.pairs) for i in self._waiting.values())
        people = 0 if self._companions is None else self._companions.n_in_memory
        return waiting + people + sum(s.n_in_memory for s in self._situations)

    @property
    def open_alarms(self) -> list[str]:
        judged: list[Situations | Silence] = [*self._situations, *self._silences]
        return [alarm for rule in judged for alarm in rule.open_alarms]

    def watch(self, ts_ms: int, clock_ms: int) -> None:
        """Expect records from `ts_ms` on."""
        self.newest_ms, self.heard_ms = ts_ms, clock_ms
        for silence in self._silences:
            silence.watch(ts_ms)

    def instant(self, ts_ms: int) -> Instant | None:
        """Return the collection of records of an instant; None when the instant has been handled already."""
        waiting = self._waiting.get(ts_ms)
        if waiting is None and ts_ms >= self._over_ms:
            waiting = self._waiting[ts_ms] = Instant(has_engine_pairs=False, persons={}, pairs={})
        return waiting

    def hear(self, newest_ms: int, clock_ms: int) -> None:
        """Note the newest instant and the clock when it came."""
        self.newest_ms = newest_ms if self.newest_ms is None else max(newest_ms, self.newest_ms)
        self.heard_ms = clock_ms

    def pass_time(self, ts_ms: int, *, is_all: bool = False) -> list[AlarmEvent]:
        """Handle the waiting instants before `ts_ms` (`is_all`: also later ones), then the silence."""
        if self.newest_ms is None:
            return []
        events: list[AlarmEvent] = []
        for at_ms in sorted(t for t in self._waiting if is_all or t < ts_ms):
            events += self._handle(at_ms, self._waiting.pop(at_ms))
        self._over_ms = max(self._over_ms, self.newest_ms + 1 if is_all else min(ts_ms, self.newest_ms + 1))
        for situations in self._situations:
            events += situations.pass_time(ts_ms, self._tolerated_ms)
        for silence in self._silences:
            events += silence.pass_time(ts_ms)
        return events

    def _handle(self, ts_ms: int, instant: Instant) -> list[AlarmEvent]:
        self.n_instants += 1
        events = [event for silence in self._silences for event in silence.hear(ts_ms)]
        if self._situations:
            frame = people_graph(instant, distance_mm=self._distance_mm)
            between: list[Sighting] = []
            if self._companions is not None:
                between = contacts(frame, self._companions.see(frame, ts_ms=ts_ms, interval_ms=self._interval_ms()))
            clusters = gatherings(frame)
            for situations in self._situations:
                rule = situations.rule
                if rule.kind == "gathering":
                    sightings = clusters
                else:
                    sightings = between if rule.is_between_groups else contacts(frame, frame.edges)
                events += situations.see(self._matching(situations.rule, sightings, ts_ms), ts_ms, self._tolerated_ms)
        if self._last_ms is not None:
            self._intervals.append(ts_ms - self._last_ms)
            self._tolerated_ms = max(self._gap_ms, round(2.5 * self._interval_ms()))
        self._last_ms = ts_ms
        return events

    def _matching(self, rule: AlarmRule, sightings: Sequence[Sighting], ts_ms: int) -> list[Sighting]:
        """Return the sightings that match a rule: its hours, number of people and area."""
        if not sightings or (rule.is_open_only and not self._opening.is_open(ts_ms)):
            return []
        n_min = rule.n_people if rule.kind == "gathering" else 2
        area, camera = rule.area_id, self._camera.camera_id
        return [
            s
            for s in sightings
            if s.n_people >= n_min and (area is None or self._ground.is_in(area, camera, s.x_mm, s.y_mm))
        ]

    def _interval_ms(self) -> float:
        """Return the frame interval: 1000 / hz of vsd.toml, else the median of the last ones."""
        if self._fixed_interval_ms is not None:
            return self._fixed_interval_ms
        return float(min(statistics.median(self._intervals), _INTERVAL_MAX_MS)) if self._intervals else 1000.0


def _rows(tables: Mapping[TableName, pa.Table], name: TableName, *columns: str) -> Iterator[tuple]:  # type: ignore[type-arg]
    """Yield camera, instant in UTC milliseconds and the named columns of each row."""
    table = tables.get(name)
    if table is not None and table.num_rows:
        ts_ms = table["ts"].cast(pa.int64()).to_pylist()
        yield from zip(table["camera_id"].to_pylist(), ts_ms, *(table[c].to_pylist() for c in columns), strict=True)


def epoch_ms(instant: datetime) -> int:
    """Return an instant as UTC milliseconds since 1970."""
    return round(instant.timestamp() * 1000)
