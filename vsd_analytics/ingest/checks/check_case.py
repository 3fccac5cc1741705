"""What a check of a source looks at, when it applies, and what it says."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Final

from vsd_analytics.geometry.picture_size import picture_size
from vsd_analytics.ingest.checks.sample import Sample
from vsd_analytics.ingest.reading.adapter import CHOICES, IngestOptions
from vsd_analytics.ingest.reading.table_head import TableHead
from vsd_analytics.site.model import Camera, Floor, Site

Bounds = tuple[float, float, float, float]
"""Least x, largest x, least y, largest y, in metres."""

ROWS_MIN: Final = 10
"""Fewer records show no pattern."""


@dataclass(frozen=True, slots=True)
class SourceWarning:
    """One thing that looks wrong.

    Attributes:
        code: "W220" to "W228", or "W230"; a check of the table has its own, see `SourceCheck`.
        what: What was seen.
        why: Why it matters.
        fix: The option or line of vsd.toml that settles it.
        is_sure: Almost surely wrong: nothing of the source is stored unless the user says so.
        is_note: Good to know, and perhaps as it should be: an ingest does not ask for attention.
    """

    code: str = field(default="", kw_only=True)
    what: str
    why: str
    fix: str
    is_sure: bool = False
    is_note: bool = False


@dataclass(frozen=True, slots=True)
class Case:
    """All that a check may look at.

    Attributes:
        site: The site.
        options: What the user says, completed from vsd.toml.
        sample: The first records.
        head: The columns, for tables; None for formats without columns of the user's choice.
        file: Name of the source.
        now: The clock; None = unknown.
        uses: Options that the format reads, fields of `CHOICES`.
        differing_cameras: Those that names of the command's sources and of earlier imports say, where they differ.
    """

    site: Site
    options: IngestOptions
    sample: Sample
    head: TableHead | None
    file: str = ""
    differing_cameras: frozenset[str] = frozenset()
    now: datetime | None = None
    uses: frozenset[str] = frozenset(CHOICES)

    @property
    def columns(self) -> TableHead:
        """Return the columns, for checks of sources that have them."""
        if self.head is None:
            raise ValueError("this source has no columns of the user's choice")
        return self.head

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """Return the cameras of the site that records of the sample name."""
        named = set(self.sample.camera.names)
        return tuple(c for c in self.site.cameras if named & {c.camera_id, *c.engine_ids})

    def is_settled_by_where(self, column: str) -> bool:
        """Return whether the user's filter names a column."""
        return self.head is not None and column in self.head.plan.compared


@dataclass(frozen=True, slots=True)
class SourceCheck:
    """One entry of the table of checks.

    Attributes:
        code: That of all its warnings.
        applies: Whether a source has what the check looks at.
        find: Yields a warning for each thing that looks wrong.
        words: What it looks for.
    """

    code: str
    applies: Callable[[Case], bool]
    find: Callable[[Case], Iterator[SourceWarning]]
    words: str

    def warnings(self, case: Case) -> Iterator[SourceWarning]:
        """Yield what looks wrong, with the code of this check unless another check of the table found it."""
        if self.applies(case):
            for warning in self.find(case):
                yield warning if warning.code else replace(warning, code=self.code)


def usable(fix: str, uses: frozenset[str]) -> str:
    """Return the clauses of a fix whose options a format reads; the words for all formats where none is left.

    Args:
        fix: Clauses with semicolons between. One that names another format is of that format's options.
        uses: Fields of `CHOICES` that the format reads.
    """
    unused = {option for name, option in CHOICES.items() if name not in uses}
    options = ((clause, re.findall(r"(?<![\w-])--[a-z-]+", clause)) for clause in fix.split("; "))
    clauses = [clause for clause, named in options if "--format" in named or unused.isdisjoint(named)]
    return "; ".join(clauses).removeprefix("or ") or "let the engine write it otherwise: its format has no such option"


def always(_: Case) -> bool:
    """Return True: the check looks at any source."""
    return True


def has_positions(case: Case) -> bool:
    """Return whether records are of single people."""
    return not case.sample.is_pairs


def is_on_floor(case: Case) -> bool:
    """Return whether records are of single people on the floor."""
    return not case.sample.is_pairs and case.sample.has_floor


def is_in_picture(case: Case) -> bool:
    """Return whether records are of single people in the picture."""
    return not case.sample.is_pairs and not case.sample.has_floor


def has_tracks(case: Case) -> bool:
    """Return whether records are of single people with ids."""
    return not case.sample.is_pairs and case.sample.has_ids


def has_columns(case: Case) -> bool:
    """Return whether the user has a say in which columns are read."""
    return case.head is not None


def has_person_columns(case: Case) -> bool:
    """Return whether rows are single people, and the user has a say in which columns are read."""
    return case.head is not None and not case.sample.is_pairs


def has_pair_columns(case: Case) -> bool:
    """Return whether rows are pairs, and the user has a say in which columns are read."""
    return case.head is not None and case.sample.is_pairs


def plan_bounds_m(floor: Floor) -> Bounds | None:
    """Return the rectangle of a floor's plan; None where there is none, or its size is not known."""
    size = None if floor.plan is None or floor.plan_m_per_px is None else picture_size(floor.plan)
    if size is None or floor.plan_m_per_px is None:
        return None
    (x, y), scale = floor.plan_origin_m, floor.plan_m_per_px
    return x, x + size[0] * scale, y, y + size[1] * scale


def floor_bounds_m(case: Case) -> Bounds | None:
    """Return the rectangle of the plans, or of the stated views, of the cameras.

    None where neither is known for all of them.
    """
    boxes = []
    floors = {f.floor_id: f for f in case.site.floors}
    for camera in case.cameras:
        floor = floors.get(camera.floor_id)
        bounds_m = None if floor is None else plan_bounds_m(floor)
        if bounds_m is not None:
            boxes.append(bounds_m)
        elif camera.view:
            xs, ys = zip(*camera.view, strict=True)
            boxes.append((min(xs), max(xs), min(ys), max(ys)))
        else:
            return None
    if not boxes:
        return None
    low_x, high_x, low_y, high_y = zip(*boxes, strict=True)
    return min(low_x), max(high_x), min(low_y), max(high_y)


def picture_px(case: Case) -> tuple[int, int] | None:
    """Return width and height of the cameras' pictures; None where they are not known or differ."""
    sizes = {c.picture_px for c in case.cameras}
    return sizes.pop() if len(sizes) == 1 else None


def where_equal(column: str, value: str) -> str:
    """Return the option that reads the rows with a value in a column."""
    text = "'" + value.replace("'", "''") + "'"
    return f'--where "{quoted(column)} = {value if value.isdecimal() else text}"'


def quoted(column: str) -> str:
    """Return a column as `--where` names it."""
    is_plain = column.replace("_", "a").isalnum() and not column[:1].isdigit()
    return column if is_plain else f'\\"{column}\\"'
