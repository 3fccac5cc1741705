"""Search for the most likely links between sightings, frame by frame in order of time.

Given what was found before, each frame asks two things. Which past goes on as which future? And: which sighting of this
frame belongs to which walk, where walks are what is before and after the frame? The second finds what the first cannot:
two people who changed places for one frame only, since every half of that exchange looks worse than none.

From links that are locally the best no such step leads away. So at first the choices are made by chance: noise is added
to all costs, less from sweep to sweep (simulated annealing).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from vsd_analytics.engine.floor_sightings import FloorSightings
from vsd_analytics.engine.links import NO_LINK, links_after
from vsd_analytics.engine.people import Array
from vsd_analytics.engine.walks import Rows, Velocities, Walks, joined, surprise

MISSED: Final = 0.03
"""Chance that the detector misses somebody for a while."""
LOST_S: Final = 1.0
LOST_FRAMES: Final = 2
LOST_MOST_S: Final = 5.0
"""A track ends when it was seen neither for `LOST_S` nor in so many frames, and in any case after `LOST_MOST_S`."""
_HOPELESS: Final = 15.0
"""By so much a link may look worse from the past alone than no link; then the future is not asked."""
_MISSED_COST: Final = float(-2 * np.log(MISSED))


class LinkSearch:
    """One sweep over all frames.

    Args:
        seen: All sightings, in order of time.
        before: Links as they were; None = there are none, and links are chosen from the past alone.
        futures: What each sighting and all later ones of its track say of the walk; replaced where links change.
        exchanges: Whether sightings of one frame are exchanged between walks, too.
        noise: Scale of the logistic noise on every choice, in units of -2 log likelihood. By a scale of 2 one choice
            is yes as often as yes is likely.
        rng: Where the noise comes from.
    """

    def __init__(
        self,
        seen: FloorSightings,
        before: Rows | None = None,
        futures: Walks | None = None,
        *,
        exchanges: bool = False,
        noise: float = 0.0,
        rng: np.random.Generator | None = None,
    ) -> None:
        self._seen = seen
        self._before = np.full(len(seen.frame), NO_LINK) if before is None else before.copy()
        self._after = links_after(self._before)
        self._futures = futures
        self._exchanges, self._noise = exchanges, noise
        self._rng = rng or np.random.default_rng(0)

    def found(self) -> Rows:
        """Return the sighting before each in its track, -1 at begins."""
        seen = self._seen
        pasts = Walks.unseen(len(seen.frame))
        open_rows = np.empty(0, dtype=np.intp)
        for i, rows in enumerate(seen.rows()):
            open_rows = open_rows[self._is_followed(open_rows, np.full(len(open_rows), i))]
            past = pasts[open_rows].after(seen.time_s[i] - seen.time_s[seen.frame[open_rows]])
            if self._futures is not None and self._exchanges:
                self._exchange(rows, open_rows, past, self._futures)
            of_open, of_row = self._matches(rows, open_rows, past)
            a, b = open_rows[of_open], rows[of_row]
            self._after[self._before[rows[self._before[rows] != NO_LINK]]] = NO_LINK
            self._before[rows] = NO_LINK
            self._before[self._after[a[self._after[a] != NO_LINK]]] = NO_LINK
            self._before[b], self._after[a] = a, b
            pasts.put(rows, Walks.begun(seen.xy[rows], seen.covariance[rows], seen.usual[rows]))
            pasts.put(b, past[of_open].seen(seen.xy[b], seen.covariance[b], seen.usual[b]))
            still = np.ones(len(open_rows), dtype=bool)
            still[of_open] = False
            open_rows = np.concatenate([open_rows[still], rows])
        return self._before

    def _is_followed(self, row: Rows, frame: Rows) -> Array:
        """Return whether a track, last seen at a row, may be seen again in a frame."""
        seen = self._seen
        unseen_s = seen.time_s[frame] - seen.time_s[seen.frame[row]]
        is_recent = (unseen_s <= LOST_S + 1e-9) | (frame - seen.frame[row] <= LOST_FRAMES)
        return np.asarray(is_recent & (unseen_s <= LOST_MOST_S))

    def _gap(self, frames: Rows) -> Array:
        """Return what it costs that a track is not seen for some frames, from one sighting to the next."""
        return np.where(frames > 1, _MISSED_COST, 0.0)

    def _chosen(self, gain: Array) -> tuple[Rows, Rows]:
        """Return the assignment of most gain (negative costs); 0 = it cannot be, or brings nothing."""
        if self._noise:
            gain = np.where(gain != 0, gain + self._rng.logistic(scale=self._noise, size=gain.shape), 0.0)
        gain = np.minimum(gain, 0.0)
        left, right = linear_sum_assignment(gain)
        is_one = gain[left, right] < 0
        return left[is_one], right[is_one]

    def _links_of_past(self, rows: Rows, open_rows: Rows, past: Walks) -> tuple[Array, Rows, Rows]:
        """Return what each sighting costs by the past of each open track, and which pairs are not hopeless."""
        seen = self._seen
        off = seen.xy[rows][None] - past.state[:, None, :2]
        link = surprise(off, past.covariance[:, None, :2, :2] + seen.covariance[rows][None])
        link += self._gap(seen.frame[rows[0]] - seen.frame[open_rows])[:, None]
        of_open, of_row = np.nonzero(link < seen.end[open_rows][:, None] + seen.begin[rows] + _HOPELESS)
        return link, of_open, of_row

    def _matches(self, rows: Rows, open_rows: Rows, past: Walks) -> tuple[Rows, Rows]:
        """Return which of the open tracks go on as which of a frame's sightings, as is most likely."""
        if not len(open_rows) or not len(rows):
            return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
        seen, futures, after = self._seen, self._futures, self._after
        frame = seen.frame[rows[0]]
        apart = seen.end[open_rows].copy()
        link, a, b = self._links_of_past(rows, open_rows, past)
        if futures is not None:
            link = np.full(link.shape, np.inf)
            if len(a):
                link[a, b] = joined(past[a], futures[rows[b]]) + self._gap(frame - seen.frame[open_rows[a]])
            late = np.flatnonzero((after[open_rows] != NO_LINK) & (seen.frame[after[open_rows]] > frame))
            if len(late):  # seen again after this frame: that link would be lost
                then = after[open_rows[late]]
                step_s = seen.time_s[seen.frame[then]] - seen.time_s[frame]
                other = joined(past[late].after(step_s), futures[then]) + _MISSED_COST
                apart[late] = np.minimum(apart[late], other - seen.begin[then])
        gain = link - apart[:, None] - seen.begin[rows]
        return self._chosen(np.where(np.isfinite(gain), gain, 0.0))

    def _exchange(self, rows: Rows, open_rows: Rows, past: Walks, futures: Walks) -> None:
        """Choose again which sighting of a frame belongs to which walk before and after it.

        A walk has a past (an open track), a future, or both. A sighting may be in none, and a walk may miss the frame.
        """
        if not len(rows):
            return
        seen, before, after = self._seen, self._before, self._after
        i, n_open = seen.frame[rows[0]], len(open_rows)
        then = after[open_rows]
        is_here = (then != NO_LINK) & (seen.frame[then] == i)
        then[is_here] = after[then[is_here]]
        heads = after[rows[(before[rows] == NO_LINK) & (after[rows] != NO_LINK)]]
        then = np.concatenate([then, heads])
        has_past, has_future = np.arange(len(then)) < n_open, then != NO_LINK

        without = np.zeros(len(then))
        without[:n_open] = seen.end[open_rows]
        without[has_future] += seen.begin[then[has_future]]
        goes_on = np.zeros(len(then), dtype=bool)
        both = np.flatnonzero(has_past & has_future)
        both = both[self._is_followed(open_rows[both], seen.frame[then[both]])]
        if len(both):
            step_s = seen.time_s[seen.frame[then[both]]] - seen.time_s[i]
            missed = joined(past[both].after(step_s), futures[then[both]]) + _MISSED_COST
            goes_on[both] = missed < without[both]
            without[both] = np.minimum(without[both], missed)

        link, of_open, of_row = self._links_of_past(rows, open_rows, past)
        n_past = len(of_open)
        walk = np.concatenate([of_open, np.repeat(np.arange(n_open, len(then)), len(rows))])
        of_row = np.concatenate([of_row, np.tile(np.arange(len(rows)), len(heads))])
        at = rows[of_row]
        there = Walks.begun(seen.xy[at], seen.covariance[at], seen.usual[at])
        with_past = past[of_open].seen(seen.xy[at[:n_past]], seen.covariance[at[:n_past]], seen.usual[at[:n_past]])
        there.put(np.arange(n_past), with_past)
        cost = np.concatenate([link[of_open, of_row[:n_past]], seen.begin[at[n_past:]]])
        goes = np.flatnonzero(has_future[walk])
        cost += np.where(has_future[walk], 0.0, seen.end[at])
        if len(goes):
            next_row = then[walk[goes]]
            step_s = seen.time_s[seen.frame[next_row]] - seen.time_s[i]
            cost[goes] += joined(there[goes].after(step_s), futures[next_row]) + self._gap(seen.frame[next_row] - i)
        gain = np.zeros((len(then), len(rows)))
        gain[walk, of_row] = cost - without[walk] - seen.begin[at] - seen.end[at]
        chosen, of_row = self._chosen(gain)

        after[open_rows] = after[rows] = before[rows] = before[then[has_future]] = NO_LINK
        goes_on[chosen] = False
        passed = np.flatnonzero(goes_on)
        after[open_rows[passed]], before[then[passed]] = then[passed], open_rows[passed]
        first, last = chosen[has_past[chosen]], chosen[has_future[chosen]]
        row, row_before_next = rows[of_row[has_past[chosen]]], rows[of_row[has_future[chosen]]]
        after[open_rows[first]], before[row] = row, open_rows[first]
        after[row_before_next], before[then[last]] = then[last], row_before_next
        self._put_futures(rows, futures)

    def _put_futures(self, rows: Rows, futures: Walks) -> None:
        """Replace the futures of a frame's sightings by what its links say now."""
        seen = self._seen
        anywhere = Velocities.anywhere(len(rows))
        futures.put(rows, Walks.begun(seen.xy[rows], seen.covariance[rows], anywhere))
        of_row = np.flatnonzero(self._after[rows] != NO_LINK)
        if len(of_row):
            row, then = rows[of_row], self._after[rows[of_row]]
            walk = futures[then].backward().after(seen.time_s[seen.frame[then]] - seen.time_s[seen.frame[row]])
            futures.put(row, walk.seen(seen.xy[row], seen.covariance[row], anywhere[of_row]).backward())
