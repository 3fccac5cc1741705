"""Links between sightings of one person: for each the row of the sighting before it in its track."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.walks import Rows

NO_LINK: Final = -1
"""A track begins: nothing is before the sighting."""


def links_after(before: Rows) -> Rows:
    """Return the next sighting of each, of the one before each, and the other way round."""
    after = np.full(len(before), NO_LINK)
    linked = np.flatnonzero(before != NO_LINK)
    after[before[linked]] = linked
    return after


def reversed_links(before: Rows) -> Rows:
    """Return the links with time reversed."""
    after = links_after(before)[::-1]
    return np.where(after == NO_LINK, NO_LINK, len(before) - 1 - after)


def track_numbers(before: Rows) -> NDArray[np.int64]:
    """Return the track of each sighting, numbered from 1 in the order in which they begin."""
    number = np.cumsum(before == NO_LINK)
    for row in np.flatnonzero(before != NO_LINK).tolist():
        number[row] = number[before[row]]
    return np.asarray(number, dtype=np.int64)
