"""What looks wrong about a source before any of it is stored: each doubt with its reason and what fixes it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from typing import Final

from vsd_analytics.ingest.checks.axis_checks import AXIS_LOOKS
from vsd_analytics.ingest.checks.body_checks import BODY_LOOKS
from vsd_analytics.ingest.checks.calibration_checks import CALIBRATED_LOOKS
from vsd_analytics.ingest.checks.check_case import Case, SourceWarning
from vsd_analytics.ingest.checks.column_checks import COLUMN_LOOKS
from vsd_analytics.ingest.checks.frame_checks import FRAME_LOOKS
from vsd_analytics.ingest.checks.id_checks import ID_LOOKS
from vsd_analytics.ingest.checks.id_switch_checks import HANDOVER_LOOKS
from vsd_analytics.ingest.checks.pair_checks import PAIR_LOOKS
from vsd_analytics.ingest.checks.picture_checks import PICTURE_LOOKS
from vsd_analytics.ingest.checks.place_checks import PLACE_LOOKS
from vsd_analytics.ingest.checks.time_checks import TIME_LOOKS

_LOOKS: Final[tuple[Callable[[Case], Iterator[SourceWarning]], ...]] = (
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


def warnings_of(case: Case) -> tuple[SourceWarning, ...]:
    """Return what looks wrong, almost sure mistakes first."""
    found = chain.from_iterable(look(case) for look in _LOOKS)
    return tuple(sorted(found, key=lambda doubt: not doubt.is_sure))
