"""Opening hours of `vsd.toml`: `opening` of `[site]`, and `[[opening]]`, what holds from a day on."""

from __future__ import annotations

from datetime import date
from typing import Final

from vsd_analytics.config.opening import WEEKDAYS, parse_opening
from vsd_analytics.config.reader import DATE, Form, TableReader
from vsd_analytics.config.values import parse_date
from vsd_analytics.site.calendar import Opening, OpeningChange

_DAY: Final = f"({'|'.join(WEEKDAYS)})"
_HOURS: Final[Form] = {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}
_OPENING: Final[Form] = {"patternProperties": {f"^{_DAY}(-{_DAY})?$": _HOURS}, "additionalProperties": False}
EXAMPLE: Final = '{ mon-sat = "08:00-21:00", sun = "10:00-18:00" }'


def read_opening(table: TableReader, key: str = "opening") -> Opening | None:
    """Return the opening hours under a key of a table; None where it is absent.

    Args:
        table: Reader of the table.
        key: Its key.
    """
    if table.raw(key, {"type": "object", **_OPENING}) is None:
        return None
    opening, mistakes = parse_opening(table.table(key, example=EXAMPLE, form=_OPENING))
    for day, error in mistakes:
        path = (*table.path, key, day)
        table.mistakes.add(path, f"{table.label} {key}: {error}", code="E127", fix=error.fix)
    return opening


def read_opening_changes(root: TableReader) -> tuple[OpeningChange, ...]:
    """Return what each `[[opening]]` says, in the order of their days.

    Args:
        root: Reader of the file.
    """
    changes: dict[date, OpeningChange] = {}
    for entry in root.each("opening"):
        first = entry.parsed("from", example='"2026-12-01"', parse=parse_date, form=DATE)
        opening = read_opening(entry, "hours")
        by = entry.text("by", example='"Anna"')
        for key, example in (("from", '"2026-12-01"'), ("hours", EXAMPLE)):
            if key not in entry.values:
                entry.missing(key, example)
        entry.close()
        if first is None or opening is None:
            continue
        if first in changes:
            entry.fault("from", f"two [[opening]] begin on {first}", fix="keep one of them")
        changes[first] = OpeningChange(first, opening, by)
    return tuple(changes[first] for first in sorted(changes))
