"""Who is together, as far as it is known while it happens: causal forms of the reports' rules for groups.

Two people of one camera **walk** together once all of this is true at one instant, of their records so far:

* they were closer than `distance_m` in at least 3 records and for at least 2 seconds,
* in at least half of these they were at most `together_m` apart (their median distance is),
* these are at least `together_share` of the records that have either of them: n / (life_a + life_b - n), and
* the point between them has moved at least `together_walk_m` since they were first close.

They stay together until one of them has not been seen for `FORGET_MS`.

They **stand** together while they are in one company (`stats/standing_company.py`) by the records of the running window
of two minutes; until these are 30 seconds, by those of the window before.

The rules make errors: strangers who stay within 1.25 m of each other for 30 seconds count as together, and so do people
who queue closely from their first record on. Without positions nobody is known to walk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from vsd_analytics.live.situations import Edge, PeopleGraph
from vsd_analytics.settings import Settings
from vsd_analytics.stats.standing_company import mean_distances_mm, stands_together
from vsd_analytics.warehouse.graphs import least_connected
from vsd_analytics.warehouse.rules import RULES

FORGET_MS = 600_000
"""People not seen for this long are forgotten: no engine gives them the same id again."""
SWEEP_MS = 60_000
JUDGE_MS = 2000
"""Who is standing together is judged again after this long."""


@dataclass(slots=True)
class _Closeness:
    """What a pair did while closer than `distance_m`."""

    at_mm: tuple[float, float] | None
    n: int = 0
    n_near: int = 0
    is_together: bool = False


@dataclass(slots=True)
class _Window:
    """What the records of a window say of who is close to whom; times in milliseconds.

    Attributes:
        start_ms: Its start.
        judged_ms: When it was judged last.
        seen_ms: How long each track was seen.
        close: Of each pair closer than `company_reach_mm`: how long, sum of time times distance, and number of records.
        company: Company of each track that is in one.
        before: The same of the window before.
    """

    start_ms: int = 0
    judged_ms: int = 0
    seen_ms: dict[str, int] = field(default_factory=dict)
    close: dict[tuple[str, str], list[int]] = field(default_factory=dict)
    company: dict[str, int] = field(default_factory=dict)
    before: dict[str, int] = field(default_factory=dict)

    def add(self, frame: PeopleGraph, *, ts_ms: int, interval_ms: float, together_mm: int) -> None:
        """Take one frame."""
        start_ms = ts_ms // RULES["company_window_ms"] * RULES["company_window_ms"]
        if start_ms != self.start_ms:
            self.judge(together_mm)
            follows = start_ms - self.start_ms == RULES["company_window_ms"]
            before = self.company if follows else {}
            self.start_ms, self.judged_ms, self.before = start_ms, ts_ms, before
            self.seen_ms, self.close, self.company = {}, {}, {}
        weight = round(interval_ms)
        for track in frame.observed:
            self.seen_ms[track] = self.seen_ms.get(track, 0) + weight
        for edge in frame.edges:
            a, b = frame.tracks[edge.a], frame.tracks[edge.b]
            if a is not None and b is not None and a != b and edge.distance_mm < RULES["company_reach_mm"]:
                sums = self.close.setdefault((a, b) if a < b else (b, a), [0, 0, 0])
                sums[0] += weight
                sums[1] += weight * edge.distance_mm
                sums[2] += 1
        if ts_ms - self.judged_ms >= JUDGE_MS:
            self.judged_ms = ts_ms
            self.judge(together_mm)

    def judge(self, together_mm: int) -> None:
        """Find the companies of the records so far."""
        tracks = sorted(self.seen_ms)
        number = {track: k for k, track in enumerate(tracks)}
        pairs = [(number[a], number[b], *sums) for (a, b), sums in self.close.items() if a in number and b in number]
        every = np.array(pairs, dtype=np.int64).reshape(-1, 5)
        a, b, close_ms, mm_ms, n_records = every[every[:, 2] > 0].T
        seen_ms = np.array([self.seen_ms[track] for track in tracks], dtype=np.int64)
        reach_mm = RULES["company_reach_mm"]
        mean_mm = mean_distances_mm(mm_ms, close_ms, np.maximum(seen_ms[a], seen_ms[b]), reach_mm=reach_mm)
        is_long = (close_ms >= RULES["company_least_ms"]) & (n_records >= RULES["company_least_records"])
        edges = stands_together(a, b, mean_mm, is_long, together_mm=together_mm, reach_mm=reach_mm)
        company = least_connected(a[edges], b[edges], len(tracks))
        self.company = {tracks[k]: int(company[k]) for k in {*a[edges].tolist(), *b[edges].tolist()}}

    def is_company(self, a: str, b: str, *, ts_ms: int) -> bool:
        """Return whether two tracks stand in one company, as far as is known."""
        is_young = ts_ms - self.start_ms < RULES["company_least_ms"]
        return any(
            a in companies and companies[a] == companies.get(b)
            for companies in (self.company, *([self.before] if is_young else []))
        )


class Companions:
    """The people one camera has seen, and who of them walk or stand together.

    Args:
        settings: Those called `together_` of `[rule]` are used.
    """

    def __init__(self, settings: Settings) -> None:
        self._near_mm = settings.together_m * 1000
        self._share = settings.together_share
        self._walk_mm = settings.together_walk_m * 1000
        self._min_ms, self._min_records = settings.together_min_s * 1000, settings.together_min_records
        self._lives: dict[str, int] = {}
        self._seen_ms: dict[str, int] = {}
        self._pairs: dict[tuple[str, str], _Closeness] = {}
        self._swept = 0
        self._window = _Window()

    @property
    def n_in_memory(self) -> int:
        """Return how many people and pairs are in memory."""
        return len(self._seen_ms) + len(self._pairs) + len(self._window.seen_ms) + len(self._window.close)

    def see(self, frame: PeopleGraph, *, ts_ms: int, interval_ms: float) -> list[Edge]:
        """Take one frame and return its close pairs that neither walk nor stand together, as far as is known."""
        for track in frame.observed:
            self._lives[track] = self._lives.get(track, 0) + 1
            self._seen_ms[track] = ts_ms
        if ts_ms // SWEEP_MS != self._swept:
            self._swept = ts_ms // SWEEP_MS
            self._sweep(ts_ms)
        self._window.add(frame, ts_ms=ts_ms, interval_ms=interval_ms, together_mm=round(self._near_mm))
        n_min = max(self._min_records, self._min_ms / interval_ms)
        return [edge for edge in frame.edges if not self._is_together(frame, edge, ts_ms, n_min)]

    def _is_together(self, frame: PeopleGraph, edge: Edge, ts_ms: int, n_min: float) -> bool:
        a, b = frame.tracks[edge.a], frame.tracks[edge.b]
        if a is None or b is None:
            return False
        self._seen_ms[a] = self._seen_ms[b] = ts_ms
        place_a, place_b = frame.places[edge.a], frame.places[edge.b]
        middle = None
        if place_a is not None and place_b is not None:
            middle = ((place_a[0] + place_b[0]) / 2, (place_a[1] + place_b[1]) / 2)
        pair = self._pairs.setdefault((a, b) if a < b else (b, a), _Closeness(middle))
        pair.at_mm = pair.at_mm or middle
        pair.n += 1
        pair.n_near += edge.distance_mm <= self._near_mm
        if not pair.is_together and middle is not None and pair.at_mm is not None:
            life_a, life_b = self._lives.get(a, 0), self._lives.get(b, 0)
            either = life_a + life_b - pair.n
            pair.is_together = (
                min(life_a, life_b) > 0  # unknown when an engine sends pairs only, without records of persons
                and pair.n >= n_min
                and 2 * pair.n_near >= pair.n
                and pair.n >= self._share * either
                and math.dist(middle, pair.at_mm) >= self._walk_mm
            )
        return pair.is_together or self._window.is_company(a, b, ts_ms=ts_ms)

    def _sweep(self, ts_ms: int) -> None:
        """Forget people not seen for long, and their pairs."""
        gone = {track for track, seen in self._seen_ms.items() if ts_ms - seen > FORGET_MS}
        if gone:
            for track in gone:
                del self._seen_ms[track]
                self._lives.pop(track, None)
            self._pairs = {pair: v for pair, v in self._pairs.items() if not gone.intersection(pair)}
