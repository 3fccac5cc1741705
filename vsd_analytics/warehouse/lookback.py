"""How far beyond an hour its facts read records, and which parts of the hours beside it hold any so near.

A running hour gets part after part. Most begin long after the hour before it ended, and change none of its facts.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from vsd_analytics.schema import TABLES
from vsd_analytics.store.layout import HOUR_MS, Part
from vsd_analytics.store.spans import ends_ms
from vsd_analytics.warehouse.units import PartIndex

SPANS = b"vsd.spans"
"""Metadata key of a file of `camera_days`: first and last instant of those parts that share an hour and a table."""

Spans = Mapping[str, tuple[int, int]]
"""First and last instant, UTC milliseconds, by digest of a part."""

_GAPS = ("episode_gap_ms", "visit_gap_ms", "gathering_link_ms")


def lookback_ms(settings: Mapping[str, Any], days: Iterable[Mapping[str, Any]]) -> int:
    """Return how far beyond an hour its facts read records: to the next frame, or over the longest gap they bridge.

    Only without a heartbeat does a silence count as recorded.

    Args:
        settings: The settings and rules that SQL reads.
        days: Rows of `camera_days` of all UTC days that the hour and its two neighbours lie in.
    """
    rows, half_intervals = list(days), int(settings["gap_half_intervals"])
    gaps = [
        int(settings["number_silence_ms"]),
        *(int(settings[name]) for name in _GAPS),
        *(half_intervals * int(row["interval_ms"]) // 2 for row in rows),
    ]
    if not all(row["has_heartbeat"] for row in rows):
        gaps.append(int(settings["coverage_gap_ms"]))
    return max(gaps)


class NearParts:
    """Which parts of the hours beside an hour its facts depend on.

    Args:
        index: The stored parts.
        spans: Of parts that share an hour and a table; where one is unknown, all its instants count as near.
    """

    def __init__(self, index: PartIndex, spans: Spans) -> None:
        self._index, self._spans = index, spans

    def __call__(self, hour: int, lookback_ms: int) -> frozenset[Part]:
        """Return the parts of both neighbours that may hold records at most `lookback_ms` from an hour.

        The only part of an hour and table always counts: so most hours need no spans.
        """
        first, after = hour * HOUR_MS, (hour + 1) * HOUR_MS
        near = set[Part]()
        for beside in (hour - 1, hour + 1):
            for parts in self._index.between(beside, beside).values():
                for part in parts:
                    span = self._spans.get(part.digest) if len(parts) > 1 else None
                    is_far = span is not None and (span[1] < first - lookback_ms or span[0] >= after + lookback_ms)
                    near |= set() if is_far else {part}
        return frozenset(near)


def noted_spans(parts: Mapping[Any, Iterable[Part]]) -> dict[bytes, bytes]:
    """Return the metadata of a file of `camera_days` about the parts of its UTC day, by table; empty where none share.

    Files that nobody appended to have the bytes they always had.
    """
    spans: dict[str, tuple[int, int]] = {}
    for table in TABLES:
        of_hour: dict[int, list[Part]] = {}
        for part in parts[table]:
            of_hour.setdefault(part.hour, []).append(part)
        for shared in (found_parts for found_parts in of_hour.values() if len(found_parts) > 1):
            spans |= {part.digest: span for part in shared if (span := ends_ms(part.path)) is not None}
    return span_metadata(spans)


def span_metadata(spans: Spans) -> dict[bytes, bytes]:
    """Return the metadata that notes some spans; empty without any."""
    return {SPANS: json.dumps(spans, sort_keys=True).encode()} if spans else {}


def spans_of(metadata: Mapping[bytes, bytes] | None) -> Spans:
    """Return the spans that the metadata of a file notes; files of an older version note none."""
    noted = json.loads((metadata or {}).get(SPANS, b"{}"))
    return {str(digest): (int(first), int(last)) for digest, (first, last) in noted.items()}
