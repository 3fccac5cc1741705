"""Which records `vsd purge` and `vsd export` mean: a camera and a span of time."""

from __future__ import annotations

import re
from datetime import timedelta

from vsd_analytics.cli.project import Project
from vsd_analytics.errors import UsageError
from vsd_analytics.site.instants import instant, parse_range

RECORD_NAMES = {"observations": "person record", "pairs": "pair record", "frames": "frame"}


def parse_span(text: str, *, project: Project) -> tuple[int, int]:
    """Return first instant and end (exclusive), in UTC milliseconds, of local days or times, or of an ISO week.

    Raises:
        UsageError: E101.
    """
    zone = project.site.timezone
    first, dots, last = text.partition("..")
    if "T" in text:
        if not dots:
            raise UsageError(f"--range {text!r} has no end", fix="--range 2026-11-09T10:00..2026-11-09T12:00")
        ends = [_end(part, is_last=i == 1, zone=zone) for i, part in enumerate((first, last))]
    else:
        days = parse_range(text)
        ends = [_end(f"{d}", is_last=i == 1, zone=zone) for i, d in enumerate(days)]
    if ends[0] >= ends[1]:
        raise UsageError(f"--range {text!r} ends before it begins", fix="write the earlier time first")
    return ends[0], ends[1]


def _end(text: str, *, is_last: bool, zone: str) -> int:
    """Return one end of a range; of a day its start, or its end where it comes last."""
    found = instant(text, zone=zone, what="--range")
    if "T" not in text and is_last:
        found = instant(f"{found.date() + timedelta(days=1)}", zone=zone, what="--range")
    return round(found.timestamp() * 1000)


def camera_id_of(project: Project, camera: str | None) -> str | None:
    """Return a camera's id, also one that only records still name."""
    if camera is None:
        return None
    known = {name: c.camera_id for c in project.site.cameras for name in (c.camera_id, *c.engine_ids)}
    if camera not in known and not re.fullmatch(r"[a-z0-9][a-z0-9_-]{0,62}", camera):
        raise UsageError(f"--camera {camera!r} is no camera", fix=f"one of {', '.join(list(known)[:20])}")
    return known.get(camera, camera)
