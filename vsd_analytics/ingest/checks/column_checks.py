"""Checks of columns: cameras, classes, ids, people that are not read (W221, W222, W225, W228)."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from typing import Final

import numpy as np

from vsd_analytics.config.file_columns import METRES
from vsd_analytics.ingest.checks.check_case import (
    ROWS_MIN,
    Case,
    SourceCheck,
    SourceWarning,
    always,
    has_columns,
    has_person_columns,
    quoted,
    where_equal,
)
from vsd_analytics.ingest.reading.cell_values import full_score, is_number
from vsd_analytics.ingest.reading.column_hints import (
    GONE,
    OBJECTS,
    PERSON,
    SUMS,
    VAGUE,
    cameras_in,
    is_address,
    is_named_like,
    letters,
    named_like,
    of_another_person,
    scored_class,
)
from vsd_analytics.ingest.reading.reasons import NO_CLASS, NOT_A_PERSON
from vsd_analytics.ingest.reading.units import LENGTHS, unit_in_name

WEAK: Final = 0.3
"""Confidence below which detectors hardly ever show a box."""
WEAK_SHARE: Final = 0.5
STOREY_MIN_M: Final = 2.2
"""Floors are no nearer above each other; nobody's head or hip is as far from another's on one floor."""
_UNITS: Final = {"m": "m", "in": "in"}
"""Units that a column's name says only behind an axis."""
_TOPICS: Final = frozenset({"topic", "mqtttopic"})
TOPICS_MAX: Final = 50
_YES: Final = frozenset({"1", "1.0", "true", "t", "yes", "y", "wahr", "ja", "vero", "vrai", "oui", "verdadero"})
_NO: Final = frozenset({"0", "0.0", "false", "f", "no", "n", "falsch", "nein", "falso", "faux", "non"})
"""How programs and databases write them."""


def _cameras_of_files(case: Case) -> Iterator[SourceWarning]:
    camera = case.options.camera
    is_named = case.head is not None and "camera_id" in case.head.plan.theirs
    if is_named or not case.sample.n or camera is None or case.options.camera_from_name is not None:
        return
    if not case.options.is_only_camera:
        named, meant = (cameras_in([name]) for name in (case.file.rpartition("/")[2], camera))
        if named and meant and not named & meant:
            yield SourceWarning(
                f"the name of the file tells of {', '.join(sorted(named))}, and all rows go to {camera}, as you say",
                "people of another place would be counted there",
                "--camera says which camera it is; a [[source]] with camera_from_name reads it from such names",
                is_note=True,
            )
        return
    if not case.sample.camera.is_in([camera]).all():
        return
    if (n := len(case.differing_cameras)) > 1:
        fix = "a [[camera]] for each, and a [[source]] with camera_from_name; or one command for each, with --camera ID"
        yield _merged_cameras(case, f"the names of these files tell of {n} cameras", case.differing_cameras, fix)
        return
    known = cameras_in(name for c in case.site.cameras for name in (c.camera_id, c.name, *c.engine_ids))
    named = cameras_in(name.rpartition("/")[2] for name in [case.file])
    if known and named and not named & known:
        yield SourceWarning(
            f"the name of the file tells of {', '.join(sorted(named))}, and all rows go to {camera}",
            "people of another place would be counted there",
            "--camera says which camera it is; engine_ids in vsd.toml hold its other names",
            is_note=True,
        )


def _cameras(case: Case) -> Iterator[SourceWarning]:
    if "camera_id" in case.columns.plan.theirs:
        return
    if len(cameras := cameras_in(case.sample.track.names)) > 1:
        yield _merged_cameras(
            case, f"the ids of people name {len(cameras)} cameras", cameras, "export the camera in a column of its own"
        )
    if len(parts := cameras_in(case.columns.parts)) > 1:
        yield _merged_cameras(
            case,
            f"the names of its files tell of {len(parts)} cameras",
            parts,
            "a [[source]] with camera_from_name, or name them one by one, each with --camera",
        )
    for column in named_like(case.columns.values, "file"):
        if len(cameras := cameras_in(case.columns.values[column])) > 1 and not case.is_settled_by_where(column):
            what = f"{column[:80]!r} names {len(cameras)} cameras"
            yield _merged_cameras(case, what, cameras, _as_camera(column))
        elif letters(column) in _TOPICS and 1 < len(topics := case.columns.values[column]) <= TOPICS_MAX:
            yield SourceWarning(
                f"{column[:80]!r} has {len(topics)} values ({', '.join(v[:40] for v, _ in topics.most_common(3))}), "
                f"and all rows go to {case.options.camera}",
                "where each camera has a topic of its own, people of several places would be counted as if together",
                f"{_as_camera(column)} (and engine_ids in vsd.toml)",
            )
    for column in named_like(case.columns.values, "storey"):
        values = case.columns.values[column]
        if 1 < len(values) <= 20 and not case.is_settled_by_where(column):
            yield SourceWarning(
                f"{column[:80]!r} names {len(values)} floors ({', '.join(v[:20] for v, _ in values.most_common(4))}), "
                f"and all rows go to {case.options.camera}",
                "people above each other would be counted as if they stood together",
                f"{where_equal(column, values.most_common(1)[0][0])} --camera {case.options.camera}; a command like "
                "this for each floor",
                is_sure=True,
            )
    known = {name.lower() for c in case.site.cameras for name in (c.camera_id, c.name, *c.engine_ids)}
    for column in case.columns.values:
        values = case.columns.values[column]
        is_camera = all(
            value.lower() in known or is_address(value) or cameras_in([value]) == {_plain(value)} for value in values
        )
        if not is_named_like(column, "camera") and (not is_camera or len(values) > 50):
            continue
        if len(values) < 2 or case.is_settled_by_where(column):
            continue
        if len(values) > 50 and len(values) > sum(values.values()) / 10:  # such as the picture's file name
            continue
        shown = ", ".join(value[:20] for value, _ in values.most_common(4))
        yield SourceWarning(
            f"{column[:80]!r} names {len(values)} cameras ({shown}), and all rows go to {case.options.camera}",
            "people of several places would be counted as if they stood together",
            f"{_as_camera(column)} (and engine_ids in vsd.toml), or {where_equal(column, values.most_common(1)[0][0])}",
            is_sure=True,
        )


def _as_camera(column: str) -> str:
    return f"--map {shlex.quote(f'camera_id={column}')}"


def _heights(case: Case) -> Iterator[SourceWarning]:
    if not case.sample.has_floor:
        return
    metres = METRES[case.columns.plan.units.get("x_m", "m")]
    for column in named_like(case.columns.ignored, "third axis"):
        values = case.columns.values[column].items() if column in case.columns.values else ()
        heights_m = [(float(v) * metres, n) for v, n in values if is_number(v)]
        heights = np.sort(np.repeat(*map(np.asarray, zip(*heights_m, strict=True)))) if heights_m else np.empty(0)
        inner = heights[int(0.05 * len(heights)) : len(heights) - int(0.05 * len(heights))]
        if len(inner) < ROWS_MIN or (gap := np.diff(inner)).max() < STOREY_MIN_M or case.is_settled_by_where(column):
            continue
        low, high = inner[np.argmax(gap)], inner[np.argmax(gap) + 1]
        yield SourceWarning(
            f"{column[:80]!r} holds two heights: up to {low:.1f} m, and from {high:.1f} m on",
            "people of two floors would be counted as if they stood together",
            f'--where "{quoted(column)} < {(low + high) / 2 / metres:.3g}" with --camera, one command for each floor',
        )


def _plain(name: str) -> str:
    """Return a name as `cameras_in` gives it where it is nothing else than that of a camera: "Cam-1" is cam1."""
    return re.sub(r"[ _=-]", "", name.strip().lower())


def _merged_cameras(case: Case, what: str, cameras: AbstractSet[str], fix: str) -> SourceWarning:
    return SourceWarning(
        f"{what} ({', '.join(sorted(cameras)[:4])}), and all rows go to {case.options.camera}",
        "people of several places would be counted as if they stood together",
        f"{fix}; engine_ids in vsd.toml say which camera is meant",
        is_sure=True,
    )


def _classes(case: Case) -> Iterator[SourceWarning]:
    if any(letters(column) not in VAGUE for column in named_like(case.columns.plan.compared, "class")):
        return  # who filters by the class's name need not filter by its number as well
    for column, values in case.columns.values.items():
        held = {letters(value) for value in values}
        if not is_named_like(column, "class") and not (held & PERSON and held & OBJECTS):
            continue
        others = [value for value in values if not _is_person(value)]
        numbers = {value for value in values if value.replace(".0", "").isdecimal()}
        # COCO counts its 80 classes from 0 in most detectors, and from 1 in its own files
        first = "1" if numbers and not values.keys() & {"0", "0.0"} else "0"
        if not others or case.is_settled_by_where(column):
            continue
        words = {word for value in values for word in (letters(value), value.strip().lower())}
        if letters(column.rpartition(".")[2]) in VAGUE and not words & (PERSON | OBJECTS):
            continue
        people = [value for value in values if _is_person(value)]
        unknown = [value for value in values if letters(value) not in OBJECTS]
        wanted = [*people, *[v for v in (first,) if v in values], *sorted(unknown, key=lambda v: -values[v])]
        # words that are neither may name kinds of people, such as staff and customers
        is_sure = bool(words & (PERSON | OBJECTS)) or (bool(numbers) and len(values) > 1)
        n_others = sum(values[value] for value in others)
        yield SourceWarning(
            f"{column[:80]!r} has other values than persons: {', '.join(v[:20] for v in others[:5])} "
            f"({n_others:,} of {sum(values.values()):,} rows)",
            "every row would count as a person",
            f"{where_equal(column, wanted[0])}{'' if people else ' if that is a person'}"
            if wanted
            else "leave these rows out of the export: none of them is a person",
            is_sure=is_sure,
        )


def _marked(case: Case) -> Iterator[SourceWarning]:
    marks = [(column, _YES, _NO) for column in named_like(case.columns.values, "absent")]
    marks += [(column, _NO, _YES) for column in named_like(case.columns.values, "present")]
    for column, out, wanted in marks:
        values = case.columns.values[column]
        n_out = sum(n for value, n in values.items() if value.lower() in out)
        seen = next((value for value in values if value.lower() in wanted), None)
        if n_out and seen is not None and len(values) == 2 and not case.is_settled_by_where(column):
            yield SourceWarning(
                f"{column[:80]!r} marks {n_out:,} of {sum(values.values()):,} rows",
                "what is no person, or nobody sees where the tracker guesses it, would count as one",
                where_equal(column, seen),
                is_sure=True,
            )


def _unseen(case: Case) -> Iterator[SourceWarning]:
    for column in named_like(case.columns.values, "unseen"):
        values = case.columns.values[column]
        n_seen = sum(n for value, n in values.items() if value in ("0", "0.0"))
        n_out = sum(values.values()) - n_seen
        if n_seen and n_out and not case.is_settled_by_where(column):
            yield SourceWarning(
                f"{column[:80]!r} is above 0 in {n_out:,} of {sum(values.values()):,} rows",
                "people whom the tracker does not see would count where it guesses them",
                f'--where "{quoted(column)} = 0"',
                is_sure=True,
            )


def _unit_called(value: str) -> str | None:
    return _UNITS.get(letters(value), unit_in_name(f"x_{value}"))


def _unit_column(case: Case) -> Iterator[SourceWarning]:
    if not any(ours in LENGTHS for ours in case.columns.plan.names):
        return
    for column in named_like(case.columns.values, "unit"):
        units = {_unit_called(value) for value in case.columns.values[column]}
        read = {case.columns.plan.units.get(ours, "m") for ours in case.columns.plan.names if ours in LENGTHS}
        if None in units or units == read:
            continue
        wanted = next(iter(units - read), "m")
        first = case.columns.values[column].most_common(1)[0][0]
        yield SourceWarning(
            f"{column[:80]!r} says {', '.join(v[:20] for v in list(case.columns.values[column])[:3])}, and positions "
            f"are read as {', '.join(sorted(read))}",
            "distances would be too large or too small",
            f"--unit {wanted}"
            if len(units) == 1
            else f"{where_equal(column, first)} --unit {_unit_called(first)}; a command like this for each unit",
            is_sure=True,
        )


def _sums(case: Case) -> Iterator[SourceWarning]:
    tracks = case.sample.track.names
    names = [t for t in tracks if letters(t) in SUMS] if len(tracks) > 2 else []
    if names and len(names) < len(tracks) / 2:
        yield SourceWarning(
            f"{', '.join(name[:20] for name in names[:3])} as the id of a person: some rows seem to be sums",
            "a sum or mean would count as a person",
            "leave such lines out of the export",
        )


def _states(case: Case) -> Iterator[SourceWarning]:
    for column, values in case.columns.values.items():
        gone = [value for value in values if letters(value) in GONE]
        seen = [value for value in values if value not in gone]
        if gone and seen and not case.is_settled_by_where(column):
            n_gone = sum(values[value] for value in gone)
            yield SourceWarning(
                f"{column[:80]!r} says {', '.join(v[:20] for v in gone[:3])} for {n_gone:,} of "
                f"{sum(values.values()):,} rows",
                "people whom the tracker does not see would count where it guesses them",
                where_equal(column, max(seen, key=lambda v: values[v])),
                is_sure=is_named_like(column, "state"),
            )


def _scores(case: Case) -> Iterator[SourceWarning]:
    scored = {column: full_score(case.columns.values[column]) for column in named_like(case.columns.values, "scores")}
    people = [column for column, full in scored.items() if full is not None and scored_class(column) in PERSON]
    for column in [c for c, full in scored.items() if full is not None and scored_class(c) in OBJECTS]:
        half = (scored[column] or 1) / 2
        high = [v for v in case.columns.values[column] if is_number(v) and float(v) > half]
        if people and high and not any(map(case.is_settled_by_where, (column, *people))):
            yield SourceWarning(
                f"{column[:80]!r} holds scores above {half:g}: {', '.join(v[:20] for v in high[:5])}",
                "such rows are hardly people, and each would count as one",
                f'--where "{quoted(people[0])} >= {half:g}"',
                is_sure=True,
            )


def _weak(case: Case) -> Iterator[SourceWarning]:
    for column in named_like(case.columns.values, "confidence"):
        n_of_confidence = {float(v): n for v, n in case.columns.values[column].items() if is_number(v)}
        full = full_score(case.columns.values[column])
        if full is None or sum(n_of_confidence.values()) < 5 * ROWS_MIN:
            continue
        limit = WEAK * full
        share = sum(n for value, n in n_of_confidence.items() if value < limit) / sum(n_of_confidence.values())
        if share > WEAK_SHARE and not case.is_settled_by_where(column):
            yield SourceWarning(
                f"{column[:80]!r} is below {limit:g} in {share:.0%} of the rows",
                "the engine is not sure that these are people, and each would count as one",
                f'--where "{quoted(column)} >= {limit:g}"',
            )


def _nobody(case: Case) -> Iterator[SourceWarning]:
    n_other, n_unknown = (case.sample.n_dropped[reason] for reason in (NOT_A_PERSON, NO_CLASS))
    if case.sample.n or case.sample.n_rejected or n_other + n_unknown < ROWS_MIN:
        return
    objects = [f"{n_other:,} of another class"] * bool(n_other) + [f"{n_unknown:,} without a class"] * bool(n_unknown)
    yield SourceWarning(
        f"{n_other + n_unknown:,} objects were in view, {' and '.join(objects)}, and none is a person",
        "its hours would count as recorded, with nobody in view",
        "if people were there: let the camera or engine classify persons, not only moving objects or faces",
        is_note=not n_unknown,
    )


def _as_map(theirs: Mapping[str, str]) -> str:
    return f"--map {shlex.quote(','.join(f'{ours}={name}' for ours, name in theirs.items()))}"


def _others_in_a_row(case: Case) -> Iterator[SourceWarning]:
    names = case.columns.plan.names
    axes = [names[ours] for ours in ("x_m", "y_m", "u_px", "v_px") if ours in names]
    others = [of_another_person(name, case.columns.ignored) for name in axes]
    if axes and all(others):
        box = dict(zip(("left", "top", "right", "bottom"), (*axes, *map(str, others)), strict=True))
        yield SourceWarning(
            f"{', '.join(o[:40] for o in others if o)} seem to hold another person, or another corner, in the same row",
            "a row is one person: who is in other columns would not be counted",
            f"write one row for each person; {_as_map(box)} if they are the corners of a box",
            is_sure=True,
        )
    ids = [n for n in case.columns.ignored if (t := names.get("track_id")) and of_another_person(t, [n])]
    if "left" in names and ids:
        sides = zip(("x_a_m", "y_a_m", "x_b_m", "y_b_m"), ("left", "top", "right", "bottom"), strict=True)
        places = {ours: names[side] for ours, side in sides if side in names}
        pair = {"track_a": names["track_id"], "track_b": ids[0], **places}
        yield SourceWarning(
            f"{ids[0][:40]!r} is the id of another person in the same row",
            "a row of two people is a pair: its two places are no corners of a box",
            f"--format pairs {_as_map(pair)}" if "right" in names else "map the two places of a pair (--map)",
            is_sure=True,
        )
    for path in case.columns.passed_over:
        yield SourceWarning(
            f"{path[:80]!r} is one entry of a list that has more of them",
            "who is in the other entries would not be counted",
            "write one message for each entry, or read each by a command of its own (--camera, --persons)",
            is_sure=True,
        )
    if unread := case.columns.unread:
        more = f" and {len(unread) - 3} more" if len(unread) > 3 else ""
        yield SourceWarning(
            f"{', '.join(name[-40:] for name in unread[:3])}{more} {'is' if len(unread) == 1 else 'are'} not read",
            "a folder or archive is read as tables: csv, tsv, parquet, feather, arrow, also gzip, bzip2 and zstd",
            "name these files in a command of their own",
        )


def _is_person(value: str) -> bool:
    """Return whether a class is people: a word for them, also with a number behind it, or class 0 of COCO."""
    return letters(value) in PERSON or value.strip().lower() in PERSON or value in ("0", "0.0")


COLUMN_CHECKS: Final = (
    SourceCheck(
        "W221",
        always,
        _cameras_of_files,
        "files whose names tell of several cameras, where nobody said which camera is meant",
    ),
    SourceCheck("W221", has_columns, _cameras, "a column of cameras that is not read"),
    SourceCheck("W221", has_columns, _heights, "heights of two floors in a column that is not read"),
    SourceCheck("W222", has_person_columns, _classes, "rows that are no people"),
    SourceCheck("W222", has_person_columns, _marked, "rows that a tracker marks as not in view, or as no person"),
    SourceCheck(
        "W222", has_person_columns, _unseen, "rows in which the tracker counts how long it has not seen the person"
    ),
    SourceCheck(
        "W220", has_columns, _unit_column, "a column that states another unit than the one positions are read in"
    ),
    SourceCheck("W222", always, _sums, "a line of sums below a table, read as a person"),
    SourceCheck("W222", has_person_columns, _states, "rows of tracks that the tracker has lost, or only predicts"),
    SourceCheck(
        "W222",
        has_person_columns,
        _scores,
        "a column of scores for each class, and another class than person has the highest one",
    ),
    SourceCheck("W222", has_person_columns, _weak, "many rows of which the engine itself is not sure"),
    SourceCheck("W222", always, _nobody, "objects in view, and none of them is a person"),
    SourceCheck(
        "W228", has_columns, _others_in_a_row, "columns of a second person in each row, and files that are not read"
    ),
)
