"""The table of checks: what looks wrong about a source before any of it is stored, with its reason and its fix."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from typing import Final

from vsd_analytics.ingest.checks.axis_checks import AXIS_CHECKS
from vsd_analytics.ingest.checks.body_checks import BODY_CHECKS
from vsd_analytics.ingest.checks.calibration_checks import CALIBRATION_CHECKS
from vsd_analytics.ingest.checks.check_case import Case, SourceCheck, SourceWarning, usable
from vsd_analytics.ingest.checks.column_checks import COLUMN_CHECKS
from vsd_analytics.ingest.checks.filter_checks import FILTER_CHECKS
from vsd_analytics.ingest.checks.frame_checks import FRAME_CHECKS
from vsd_analytics.ingest.checks.id_checks import ID_CHECKS
from vsd_analytics.ingest.checks.id_switch_checks import ID_SWITCH_CHECKS
from vsd_analytics.ingest.checks.pair_checks import PAIR_CHECKS
from vsd_analytics.ingest.checks.picture_checks import PICTURE_CHECKS
from vsd_analytics.ingest.checks.place_checks import PLACE_CHECKS
from vsd_analytics.ingest.checks.time_checks import TIME_CHECKS

CHECKS: Final[tuple[SourceCheck, ...]] = (
    *TIME_CHECKS,
    *FRAME_CHECKS,
    *PLACE_CHECKS,
    *PAIR_CHECKS,
    *AXIS_CHECKS,
    *BODY_CHECKS,
    *COLUMN_CHECKS,
    *FILTER_CHECKS,
    *ID_CHECKS,
    *ID_SWITCH_CHECKS,
    *PICTURE_CHECKS,
    *CALIBRATION_CHECKS,
)
"""In the order in which a person should read them: wrong times make wrong speeds."""


def warnings_of(case: Case) -> tuple[SourceWarning, ...]:
    """Return what looks wrong, almost sure mistakes first; fixes name no option that the format does not read."""
    proposed = chain.from_iterable(check.warnings(case) for check in CHECKS)
    warnings = (replace(warning, fix=usable(warning.fix, case.uses)) for warning in proposed)
    return tuple(sorted(warnings, key=lambda warning: not warning.is_sure))
