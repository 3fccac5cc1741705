"""Brings the JSON of an older version of the weekly report to the names of today; the only place that knows them."""

from __future__ import annotations

from typing import Any, Final

from vsd_analytics.report.model.week import SCHEMA

FAMILY, _, _VERSION = SCHEMA.partition("/")
VERSION: Final = int(_VERSION)
RATES: Final = {"often": "violation_rate", "risky": "encounter_rate", "close_share": "close_time_share"}
_ENDS: Final = ("", "_lo", "_hi", "_ratio", "_before", "_after", "_reason")
RENAMED: Final = {
    **{old + end: new + end for old, new in RATES.items() for end in _ENDS},
    "usual_often": "usual_violation_rate",
    "target_often": "target_violation_rate",
}
"""Names of fields in version 1, with those of today."""
OLD_VERDICTS: Final = {"no_clear_change": "cannot_tell"}
"""Verdicts of version 1 as those of today: it said "no_clear_change" of any interval that includes no change."""


def brought_up_to_date(decoded: Any) -> Any:
    """Return a decoded JSON report with the names and verdicts of today; one of today comes back as it is.

    Args:
        decoded: The JSON object, or its parts with `schema`.
    """
    if not isinstance(decoded, dict) or decoded.get("schema") != f"{FAMILY}/1":
        return decoded
    return {**_of_version_1(decoded), "schema": SCHEMA}


def _of_version_1(value: Any) -> Any:
    if isinstance(value, dict):
        return {
            RENAMED.get(key, key): OLD_VERDICTS.get(inner, inner)
            if key == "verdict" and isinstance(inner, str)
            else _of_version_1(inner)
            for key, inner in value.items()
        }
    return [_of_version_1(inner) for inner in value] if isinstance(value, list) else value
