"""Who moves together, as far as it is known while it happens: a causal form of the reports' rule for groups.

Two people of one camera are together once all of this is true at one instant, of their records so far:

* they were closer than `distance_m` in at least 3 records and for at least 2 seconds,
* in at least half of these they were at most `together_m` apart (their median distance is),
* these are at least `together_share` of the records that have either of them: n / (life_a + life_b - n), and
* the point between them has moved at least `together_walk_m` since they were first close.

They stay together until one of them has not been seen for `FORGET_MS`. The rule makes two errors: people who came
together and never walk count as not together, and people who queue closely from their first record on, and move with
the queue, count as together although they did not come together. Without positions nobody is known to move, so nobody
is together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from vsd_analytics.live.situations import Edge, PeopleGraph
from vsd_analytics.settings import Settings

FORGET_MS = 600_000
"""People not seen for this long are forgotten: no engine gives them the same id again."""
SWEEP_MS = 60_000


@dataclass(slots=True)
class _Closeness:
    """What a pair did while closer than `distance_m`."""

    at_mm: tuple[float, float] | None
    n: int = 0
    n_near: int = 0
    is_together: bool = False


class Companions:
    """The people one camera has seen, and who of them move together.

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

    @property
    def n_in_memory(self) -> int:
        """Return how many people and pairs are in memory."""
        return len(self._seen_ms) + len(self._pairs)

    def see(self, frame: PeopleGraph, *, ts_ms: int, interval_ms: float) -> list[Edge]:
        """Take one frame and return its close pairs that do not move together, as far as is known."""
        for track in frame.observed:
            self._lives[track] = self._lives.get(track, 0) + 1
            self._seen_ms[track] = ts_ms
        if ts_ms // SWEEP_MS != self._swept:
            self._swept = ts_ms // SWEEP_MS
            self._sweep(ts_ms)
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
        return pair.is_together

    def _sweep(self, ts_ms: int) -> None:
        """Forget people not seen for long, and their pairs."""
        gone = {track for track, seen in self._seen_ms.items() if ts_ms - seen > FORGET_MS}
        if gone:
            for track in gone:
                del self._seen_ms[track]
                self._lives.pop(track, None)
            self._pairs = {pair: v for pair, v in self._pairs.items() if not gone.intersection(pair)}
