"""Checks of track ids: none, ids that do not last, ids of several people (W225)."""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Iterator
from typing import Final

import numpy as np

from vsd_analytics.ingest.checks.check_case import ROWS_MIN, Case, SourceCheck, SourceWarning, has_positions, has_tracks
from vsd_analytics.ingest.checks.sample import is_new
from vsd_analytics.ingest.reading.column_hints import OBJECTS, PERSON, ids_like, letters
from vsd_analytics.ingest.reading.table_head import TableHead

TWO_PLACES_M: Final = 1.0
"""Nobody is in two places this far apart at once; two boxes of one person are nearer."""
FAR_SHARE: Final = 0.1
"""Of pixels, a share of the extent of all of them."""
TWO_PLACES_SHARE: Final = 0.002
SECOND_SHARE: Final = 0.05
COUNTED_SHARE: Final = 0.99
COMINGS_MIN: Final = 10
"""So often somebody must come or go before numbers without a gap show that they number a frame."""
SPELLED_SHARE: Final = 0.1
UNKNOWN_SHARE: Final = 0.2
"""Of rows without an id: violations of such people cannot be counted."""


def _ids(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if not sample.n:
        return
    why = "a violation needs the same two people for 3 seconds; records, person-hours and maps are not concerned"
    like = [] if case.head is None else [n for n in ids_like(case.head.ignored) if not _holds_classes(case.head, n)]
    named = f"--map {shlex.quote('track_id=' + like[0])}" if like else "export it as track_id"
    if case.head is not None and not sample.has_ids:
        what = "there are no track ids: violations cannot be counted"
        unread = ", ".join(name[:40] for name in case.head.ignored[:5])
        of_these = f"; map them (--map) if one of the columns that are not read holds them: {unread}" if unread else ""
        fix = named if like else f"export the tracker's ids as track_id{of_these}"
        yield SourceWarning(what, why, fix, is_note=not like)
        return
    if sample.has_ids:
        n_without = int((sample.track.no < 0).sum())
        if n_without > UNKNOWN_SHARE * sample.n:
            what = f"{n_without:,} of {sample.n:,} rows have no track id"
            yield SourceWarning(what, why, "export the tracker's ids for everybody in view", is_note=True)
        is_once = sample.track.counts == 1
        if len(sample.track.names) >= 2 * ROWS_MIN and sample.n_instants >= 3 and is_once.mean() > 0.9:
            what = f"{len(sample.track.names):,} track ids, and nearly each has one record: they do not last"
            yield SourceWarning(what, why, f"map the id of the track, not of the detection or row: {named}")


def _holds_classes(head: TableHead, column: str) -> bool:
    """Return whether a column whose name may be that of an id holds classes, as `name` does."""
    values = head.values.get(column, ())
    return bool(values) and all(letters(value) in PERSON | OBJECTS for value in values)


def _of_several(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if case.options.period_s is not None:
        return
    far, ways = TWO_PLACES_M if sample.has_floor else FAR_SHARE * sample.picture_side_px, sample.ways
    if not ways.is_again.any() or sample.n_second > SECOND_SHARE * sample.n:
        return  # so many have times that are too coarse: W224
    is_several = ways.is_again | np.roll(ways.is_again, -1)
    places, starts = ways.places[is_several], np.flatnonzero(~ways.is_again[is_several])
    spread = np.maximum.reduceat(places, starts) - np.minimum.reduceat(places, starts)
    n_far = int((np.hypot(*spread.T) > far).sum())
    if n_far < max(ROWS_MIN, TWO_PLACES_SHARE * sample.n):
        return
    names = Counter(sample.track.names[no] for no in sample.track.no[np.sort(ways.row[is_several])]).most_common(3)
    yield SourceWarning(
        f"an id is in two places at once {n_far:,} times: {', '.join(name[:20] for name, _ in names)}",
        "it is no id of one person: all but one of them are left out, and its way leads from one to the other",
        "export ids that are unique among people in view, and none for people whom the tracker does not follow",
    )


def _numbers_of_a_frame(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    if sample.n < 5 * ROWS_MIN:
        return
    if not all(re.fullmatch("[0-9]{1,4}", name) for name in sample.track.names):
        return
    number = np.array(sample.track.names, dtype=np.int64)[sample.tracked.track_no]
    frame_no = sample.frame_no[sample.tracked.row]
    order = np.lexsort((number, frame_no))
    number, is_first = number[order], is_new(frame_no[order])
    starts = np.flatnonzero(is_first)
    sizes, least = np.diff(starts, append=len(order)), number[starts]
    is_gap = ~is_first & (np.diff(number, prepend=0) != 1)
    is_counted = (least <= 1) & (least == least[0]) & ~np.logical_or.reduceat(is_gap, starts)
    if np.count_nonzero(np.diff(sizes)) >= COMINGS_MIN and is_counted.mean() >= COUNTED_SHARE and sizes.max() > 2:
        yield SourceWarning(
            f"in nearly each frame the ids are {least[0]}, {least[0] + 1}, ... without a gap",
            "they number the people of a frame: who has number 2 is somebody else as soon as number 1 leaves",
            "map the id of the track (--map), or export it; if there is none, violations cannot be counted",
        )


def _spelled_twice(case: Case) -> Iterator[SourceWarning]:
    sample = case.sample
    spellings: dict[str, list[str]] = {}
    for name in sample.track.names:
        spellings.setdefault(re.sub(r"^0+(?=.)", "", name.strip().casefold()), []).append(name)
    n_twice = len(sample.track.names) - len(spellings)
    if n_twice >= max(2, SPELLED_SHARE * len(spellings)):
        first = next(names for names in spellings.values() if len(names) > 1)
        yield SourceWarning(
            f"{n_twice:,} ids are written in two ways, such as {' and '.join(name[:20] for name in first[:2])}",
            "each way of writing would count as a person of its own, and nobody would stay for long",
            "export ids in one way; leave it if small and capital letters, or zeros in front, mean different people",
        )


ID_CHECKS: Final = (
    SourceCheck("W225", has_positions, _ids, "no ids, or ids that do not last"),
    SourceCheck(
        "W225",
        has_tracks,
        _of_several,
        "ids in two places at once, such as one id for everybody whom no tracker follows",
    ),
    SourceCheck("W225", has_tracks, _numbers_of_a_frame, "ids that number the people of each frame from 0 or 1 on"),
    SourceCheck("W225", has_tracks, _spelled_twice, "one id written in two ways, such as 7 and 007"),
)
