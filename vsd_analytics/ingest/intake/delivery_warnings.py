"""What is said of a recording that is here already, in another unit, at other places, or seen by a second camera.

`second_delivery` compares; each function here makes one warning of what it found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Final

import numpy as np

from vsd_analytics.ingest.checks.check_case import SourceWarning
from vsd_analytics.ingest.intake.recording import Floats, Ints, Match, Recording
from vsd_analytics.ingest.intake.unit_changes import UnitChange
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.store.imports import ImportLine, purge_command
from vsd_analytics.store.store import Store

SAME_SHARE: Final = 0.8
"""From this share of the records on it is the same recording; below it, a part of it."""
VIEWS_M: Final = (0.5, 0.25)
"""Two cameras that see one person place them this near; in a crowd the nearer tells more."""
_SPREAD: Final = 0.8
"""Records that are spread over this share of the file's time cannot be cut off it."""


def same_again(site: Site, camera: Camera, here: Recording, matched: Match, *, factor: float = 1.0) -> SourceWarning:
    """Return the warning of a recording, or a part of one, that is stored already: W230.

    Args:
        site: The site.
        camera: Camera of the records.
        here: The records.
        matched: Which of them are stored.
        factor: How many times as large their places are.
    """
    other, record = matched.other, matched.record[matched.is_near]
    names = [other.cameras[no] for no in np.unique(other.camera[record]).tolist()]
    near_ms = here.ts_ms[matched.is_near]
    of_whom = f"camera{'' if len(names) == 1 else 's'} {', '.join(names)}"
    as_whom = "" if camera.camera_id in names else f" and comes as camera {camera.camera_id}"
    how = _apart(matched) + (f", and {_rounded(factor)} times as large" if factor != 1 else "")
    if matched.share >= SAME_SHARE:
        return _refused(
            f"the same recording is stored already, for {of_whom}{as_whom}: {matched.share:.0%} of its records are at "
            f"the same places at the same times{how}",
            "people would be counted twice",
            _leave_out(site, matched),
        )
    first, last = time_text(site, near_ms.min()), time_text(site, near_ms.max())
    is_spread = np.ptp(near_ms) >= _SPREAD * np.ptp(here.ts_ms)
    return _refused(
        f"a part of it is stored already, for {of_whom}{as_whom}: {matched.share:.0%} of its records, from {first} to "
        f"{last}, are at the same places at the same times{how}",
        "people would be counted twice" + (", and no cut parts them" if is_spread else " in that time"),
        _leave_out(site, matched) if is_spread else "cut the file there, and import the rest",
    )


def same_beside(site: Site, matched: Match, away_m: float) -> SourceWarning:
    """Return the warning of people whom the same camera has a little further, as after a new calibration: W230."""
    return _refused(
        f"the same recording is stored already, {away_m:.2g} m away: {matched.share:.0%} of its records are there at "
        f"the same times{_apart(matched)}, and {matched.chance:.0%} by chance",
        "people would be counted twice, once at each place",
        _leave_out(site, matched),
    )


def second_view(camera: Camera, here: Recording, matched: Match, *, has_view: Mapping[str, bool]) -> SourceWarning:
    """Return the warning of two cameras that see the same people: W231.

    Args:
        camera: Camera of the records.
        here: The records.
        matched: Which of them another camera sees.
        has_view: Whether vsd.toml says what each camera sees.
    """
    other = matched.other
    no = by_number(other.camera[matched.record[matched.is_near]])[0]
    name = other.cameras[no]
    lines = [
        f'under [[camera]] id = "{c}": view = {view}'
        for c, view in ((camera.camera_id, _view(here)), (name, _view(other.at(other.camera == no))))
        if not has_view[c]
    ]
    return SourceWarning(
        f"cameras {camera.camera_id} and {name} see the same people: at one time, {matched.share:.0%} of the records "
        f"of {camera.camera_id} have one of {name} within {matched.within_m:g} m, and {matched.chance:.0%} at other "
        "times",
        "vsd.toml does not say what each camera sees, so whoever is seen by both counts twice in all figures",
        f"add what each camera sees to vsd.toml: {'; '.join(lines)}",
        code="W231",
    )


def other_unit(camera: Camera, change: UnitChange, where: str, *, is_inside: bool) -> SourceWarning:
    """Return the warning of positions that are larger by the factor of a unit, or smaller: W220."""
    unit, is_larger = change.unit, change.factor > 1
    before, after = change.speeds_m_s
    if is_inside:
        part = "the later part" if is_larger else "the earlier part"
        fix = f"cut the file there, and import {part} with --unit {unit}"
    elif is_larger:
        fix = f"--unit {unit}"
    else:
        fix = f"take the stored ones back, and import them with --unit {unit}: vsd imports, vsd purge --import ID"
    return SourceWarning(
        f"{where}, positions of camera {camera.camera_id} are {_rounded(change.factor)} times as large, and half of "
        f"the steps faster than {after:.2g} m/s in place of {before:.2g} m/s",
        f"one camera sees one floor: one of the two is in {unit}",
        fix,
        is_sure=True,
        code="W220",
    )


def with_other_times(site: Site, line: ImportLine, matched: Match, lag_ms: int) -> SourceWarning:
    """Return the warning of a recording that an import brought with other times: W230."""
    return _refused(
        f"the same recording is stored already, with other times: import {line.id}; {matched.share:.0%} of the records "
        f"are at the same places {_span(lag_ms)} {'later' if lag_ms > 0 else 'earlier'}",
        "people would be at the same places again, and be counted twice",
        f"take the first import back with `{_purge(site, line.id)}`, and import again",
    )


def other_places(site: Site, apart_m: Floats, n_compared: int, owner: str) -> SourceWarning:
    """Return the warning of records whose time and id are stored at another place, and which are left out: W230.

    More than half a metre further, they are hardly a corrected export of the same people: the source is refused.

    Args:
        site: The site.
        apart_m: How far from the stored place, of each such record.
        n_compared: Records whose time and id are stored.
        owner: The import of most of the stored ones; "" = unknown.
    """
    away_m = float(np.median(apart_m))
    purge = _purge(site, owner) if owner else "vsd purge --camera and --range"
    is_far = away_m > VIEWS_M[0]
    return SourceWarning(
        f"{len(apart_m):,} of {n_compared:,} records that were compared have the time and id of stored ones, "
        f"{_rounded(away_m)} m away, and would be left out",
        "a camera has one record of each id at each time, and the first one stays",
        ("name the camera that saw them, if it is another one; " if is_far else "")
        + f"a corrected export takes the place of the first after `{purge}`",
        is_sure=is_far,
        code="W230",
    )


def by_number(numbers: Ints) -> list[int]:
    """Return different numbers, the most frequent first."""
    values, n = np.unique(numbers, return_counts=True)
    return list(values[np.argsort(-n, kind="stable")].tolist())


def _refused(what: str, why: str, fix: str) -> SourceWarning:
    return SourceWarning(what, why, fix, is_sure=True, code="W230")


def _leave_out(site: Site, matched: Match) -> str:
    """Return what to do about the same people, with the imports that brought them first."""
    owners = [matched.other.owners[no] for no in by_number(matched.other.owner[matched.record[matched.is_near]])]
    purges = [f"`{_purge(site, owner)}`" for owner in owners[:5] if owner]
    instead = f"; to have it in place of what is stored: {', '.join(purges)}, and import again" if purges else ""
    return f"leave it out{instead}"


def _purge(site: Site, import_id: str) -> str:
    return purge_command(Store(site.root / "store", site_id=site.site_id), import_id)


def _apart(matched: Match) -> str:
    return "" if abs(matched.lag_ms) < 5 else f", {matched.lag_ms / 1000:+g} s apart"


def _rounded(value: float) -> str:
    """Return a number with three digits that count: 3.28, 1,000."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def _span(lag_ms: int) -> str:
    seconds = abs(lag_ms) / 1000
    for unit, name in ((86400, "days"), (3600, "hours"), (60, "minutes")):
        count = round(seconds / unit)
        if count and math.isclose(seconds, count * unit, abs_tol=1):
            return f"{count} {name[:-1] if count == 1 else name}"
    return f"{seconds:,.1f} s"


def _view(recording: Recording) -> str:
    """Return the rectangle of nearly all places as the value of `view`."""
    low, high = np.quantile(recording.places, [0.005, 0.995], axis=0)
    (left, bottom), (right, top) = np.floor(low * 10 - 1) / 10, np.ceil(high * 10 + 1) / 10
    corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    return "[" + ", ".join(f"[{x:.1f}, {y:.1f}]" for x, y in corners) + "]"


def time_text(site: Site, ms: int) -> str:
    """Return an instant on the site's clock, to the second."""
    return datetime.fromtimestamp(int(ms) / 1000, tz=UTC).astimezone(site.zone).isoformat(sep=" ", timespec="seconds")
