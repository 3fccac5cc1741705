"""Proposing the renames of a table whose columns have other names, all at once; they are shown, never used unasked."""

from __future__ import annotations

import difflib
import re
import shlex
from collections.abc import Collection, Mapping, Sequence
from typing import Final

from vsd_analytics.config.file_columns import FILE_COLUMNS, PLACES
from vsd_analytics.ingest.reading.column_hints import (
    ids_like,
    is_whole_box,
    named_like,
    of_another_person,
    place_like,
    time_like,
)
from vsd_analytics.ingest.reading.table_file import Header
from vsd_analytics.ingest.reading.units import unit_in_name
from vsd_analytics.schema import TableName

_ORDER: Final = ("ts", "camera_id", "track_id")
_FAINT: Final = 0.3
_OF_TIME: Final = re.compile(
    "time|^ts|[^a-z]ts$|date|stamp|clock|utc|epoch|zeit|hora|heure|jour|giorno|fecha|datum|ora$"
)
_THEIR_NAME: Final = "THEIR_NAME"
_TIME_OF_INFLUX: Final = "_time"


def proposed_columns(header: Header, known: Mapping[str, int], *, kind: TableName) -> dict[str, str]:
    """Return the renames that the names of a table's columns suggest, of our columns that it lacks: ours = theirs.

    Both axes of a place are named together, and a box as a box, never as metres.

    Args:
        header: The table's columns; for one without names of its own, nothing is proposed.
        known: Number of the column of each of our names that is there.
        kind: What a row is: pairs have neither place nor track of one person.
    """
    if header.line is None and header.text is not None:
        return {}
    taken = {header.names[i] for i in known.values()}
    free = [n for n in header.names if n not in taken and n.lower() not in FILE_COLUMNS and _can_be_mapped(n)]
    renames: dict[str, str] = {}
    if "ts" not in known and "frame" not in known and (time := _time(free)) is not None:
        renames["ts"] = time
    if "camera_id" not in known and (cameras := named_like(free, "camera")):
        renames["camera_id"] = cameras[0]
    if kind == "pairs":
        return renames
    place = {} if any(set(p) <= set(known) for p in PLACES) else place_like(header.names)
    place = {o: name for o, name in place.items() if o not in known or header.names[known[o]] != name}
    if not all(map(_can_be_mapped, place.values())):
        place = {}
    used = {*renames.values(), *place.values()}
    if "track_id" not in known and (ids := [name for name in ids_like(free) if name not in used]):
        renames["track_id"] = ids[0]
    return renames | place


def proposed_pairs(header: Header) -> dict[str, str]:
    """Return the renames of a table with two people in a row: two ids, and two places or a distance; {} for others."""
    for name in ids_like(header.names):
        other = of_another_person(name, header.names) or _with_b(name, header.names)
        if other is None or not (_can_be_mapped(name) and _can_be_mapped(other)):
            continue
        place = place_like([n for n in header.names if n not in (name, other)])
        corners = [place.get(side) for side in ("left", "top", "right", "bottom")]
        if all(corners):
            ours = ("track_a", "track_b", "x_a_m", "y_a_m", "x_b_m", "y_b_m")
            return {o: str(n) for o, n in zip(ours, (name, other, *corners), strict=True)}
        if distances := [n for n in named_like(header.names, "distance") if _can_be_mapped(n)]:
            return {"track_a": name, "track_b": other, "distance_m": distances[0]}
    return {}


def _with_b(name: str, names: Sequence[str]) -> str | None:
    """Return the name that ends in B where this one ends in A, as `Person A` does."""
    swapped = {"a": "b", "A": "B"}.get(name[-1:])
    return next((n for n in names if swapped is not None and n == name[:-1] + swapped), None)


def completed(
    proposed: Mapping[str, str], ours: str, header: Header, *, wanted: str, taken: Collection[str] = ()
) -> dict[str, str]:
    """Return renames that also name a column that is missing: by the nearest name, or "THEIR_NAME".

    Args:
        proposed: What `proposed_columns` returned.
        ours: Our column that is missing; neither a camera nor another place than the proposed one needs a
            name.
        header: The table's columns.
        wanted: The name that was looked for: `ours`, or what the user said.
        taken: Columns that are read as something else already.
    """
    renames = dict(proposed)
    is_place = any(ours in place for place in PLACES)
    has_place = any(column in place for place in PLACES for column in renames)
    if ours not in renames and wanted != "camera_id" and not (is_place and has_place):
        # a column with one of our names is not another one under a wrong name, so it is no suggestion
        shown = [n for n in header.names if not n.startswith("_") and n not in {*renames.values(), *taken}]
        other = shown if ours != wanted else [n for n in shown if n.lower() not in FILE_COLUMNS]
        if is_place:  # neither a time nor an id is a place, and no cell with a whole box is one side of it
            other = [n for n in other if time_like([n]) is None and not ids_like([n]) and not is_whole_box(n)]
        if ours == wanted == "ts":
            other = [n for n in other if _OF_TIME.search(n.lower())]
        renames[ours] = nearest_name(wanted, [n for n in other[:1000] if len(n) <= 100]) or _THEIR_NAME
    rank = {name: i for i, name in enumerate(_ORDER)}
    return dict(sorted(renames.items(), key=lambda rename: rank.get(rename[0], len(rank))))


def renames_option(renames: Mapping[str, str]) -> str:
    """Return the option `--map` of renames, quoted for a shell, with a note on a place of two readings; "" for none."""
    if not renames:
        return ""
    joined = ",".join(f"{ours}={theirs}" for ours, theirs in renames.items())
    return f"--map {shlex.quote(joined)}{note_on_place(renames)}"


def nearest_name(column: str, names: Sequence[str]) -> str | None:
    """Return the name that is most like a column's, or None."""
    lower = {n.lower(): n for n in reversed(names)}
    close = difflib.get_close_matches(column.lower(), lower, n=1, cutoff=_FAINT)
    if close:
        return lower[close[0]]
    stem = column.lower().split("_")[0]
    return next((n for n in names if n.lower() in column.lower() or stem in n.lower()), None)


def _can_be_mapped(name: str) -> bool:
    """Return whether a name is one of the file: a blank one became `_` and its number; `_id` names a document."""
    return (not name.startswith("_") or name == _TIME_OF_INFLUX) and "," not in name and "=" not in name


def _time(names: Sequence[str]) -> str | None:
    """Return the column of instants, or `date+time`."""
    dates, times = named_like(names, "date"), named_like(names, "time")
    return f"{dates[0]}+{times[0]}" if dates and times else time_like(names)


def note_on_place(renames: Mapping[str, str]) -> str:
    """Return how else the columns of a proposed place may be meant, which their names do not say."""
    places = {ours: theirs for ours, theirs in renames.items() if any(ours in place for place in PLACES)}
    if set(places) == {"x_m", "y_m"} and all(unit_in_name(name) is None for name in places.values()):
        return f"   (metres; of the picture: u_px={places['x_m']},v_px={places['y_m']}; another unit: --unit mm)"
    if (distance := renames.get("distance_m")) and unit_in_name(distance) is None:
        return "   (metres; another unit: --unit cm)"
    if set(places) == {"left", "top", "width", "height"}:
        return f"   (the upper left corner; if it is the centre: center_x={places['left']},center_y={places['top']})"
    return "" if places else "      (or in vsd.toml, under [ingest.map])"
