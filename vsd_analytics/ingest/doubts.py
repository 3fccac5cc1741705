"""What looks wrong about a source before any of it is stored: each doubt with its reason and what fixes it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from typing import Final

from vsd_analytics.ingest.doubt_case import Case, Doubt
from vsd_analytics.ingest.doubts_of_axes import AXIS_LOOKS
from vsd_analytics.ingest.doubts_of_bodies import BODY_LOOKS
from vsd_analytics.ingest.doubts_of_calibrated_places import CALIBRATED_LOOKS
from vsd_analytics.ingest.doubts_of_columns import COLUMN_LOOKS
from vsd_analytics.ingest.doubts_of_frames import FRAME_LOOKS
from vsd_analytics.ingest.doubts_of_handovers import HANDOVER_LOOKS
from vsd_analytics.ingest.doubts_of_ids import ID_LOOKS
from vsd_analytics.ingest.doubts_of_pairs import PAIR_LOOKS
from vsd_analytics.ingest.doubts_of_pictures import PICTURE_LOOKS
from vsd_analytics.ingest.doubts_of_places import PLACE_LOOKS
from vsd_analytics.ingest.doubts_of_times import TIME_LOOKS

_LOOKS: Final[tuple[Callable[[Case], Iterator[Doubt]], ...]] = (
    *TIME_LOOKS,
    *FRAME_LOOKS,
    *PLACE_LOOKS,
    *PAIR_LOOKS,
    *AXIS_LOOKS,
    *BODY_LOOKS,
    *COLUMN_LOOKS,
    *ID_LOOKS,
    *HANDOVER_LOOKS,
    *PICTURE_LOOKS,
    *CALIBRATED_LOOKS,
)
"""In the order in which a person should read them: wrong times make wrong speeds."""


def doubts_of(case: Case) -> tuple[Doubt, ...]:
    """Return what looks wrong, almost sure mistakes first."""
    found = chain.from_iterable(look(case) for look in _LOOKS)
    return tuple(sorted(found, key=lambda doubt: not doubt.is_sure))
