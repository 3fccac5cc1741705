"""Doubts about columns: cameras, classes, ids, people that are not read (W221, W222, W225, W228)."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
from collections.abc import Set as AbstractSet
from typing import Final

import numpy as np

from vsd_analytics.ingest.cell_values import is_number
from vsd_analytics.ingest.doubt_case import ROWS_MIN, Case, Doubt, quoted
from vsd_analytics.ingest.reasons import NO_CLASS, NOT_A_PERSON
from vsd_analytics.ingest.telling_names import (
    GONE,
    OBJECTS,
    PERSON,
    SUMS,
    VAGUE,
    cameras_in,
    ids_like,
    is_named_like,
    letters,
    named_like,
    of_another_person,
)

WEAK: Final = 0.3
"""Confidence below which detectors hardly ever show a box."""
WEAK_SHARE: Final = 0.5
_YES, _NO = frozenset({"1", "1.0", "true", "yes"}), frozenset({"0", "0.0", "false", "no"})


def _cameras_of_files(case: Case) -> Iterator[Doubt]:
    """W221: files whose names tell of several cameras, where nobody said which camera is meant."""
    camera = case.options.camera
    is_named = case.head is not None and "camera_id" in case.head.plan.theirs
    if not case.options.is_only_camera or is_named or not case.sample.n:
        return
    if not (case.sample.rows["camera"] == camera).all():
        return
    if (n := len(case.differing_cameras)) > 1:
        fix = "a [[camera]] for each, and a [[source]] with camera_from_name; or one command for each, with --camera ID"
        yield _merged_cameras(case, f"the names of these files tell of {n} cameras", case.differing_cameras, fix)
        return
    known = cameras_in(name for c in case.site.cameras for name in (c.camera_id, c.name, *c.engine_ids))
    own = cameras_in(name.rpartition("/")[2] for name in [case.file])
    if known and own and not own & known:
        yield Doubt(
            "W221",
            f"the name of the file tells of {', '.join(sorted(own))}, and all rows go to {camera}",
            "people of another place would be counted there",
            "--camera says which camera it is; engine_ids in vsd.toml hold its other names",
            is_note=True,
        )


def _cameras(case: Case) -> Iterator[Doubt]:
    """W221: a column of cameras that is not read."""
    if case.head is None or "camera_id" in case.head.plan.theirs:
        return
    if len(parts := cameras_in(case.head.parts)) > 1:
        yield _merged_cameras(
            case,
            f"the names of its files tell of {len(parts)} cameras",
            parts,
            "a [[source]] with camera_from_name, or name them one by one, each with --camera",
        )
    for column in named_like(case.head.values, "file"):
        if len(found := cameras_in(case.head.values[column])) > 1 and not case.is_settled_by_where(column):
            what = f"{column[:80]!r} names {len(found)} cameras"
            yield _merged_cameras(case, what, found, f"--map camera_id={column}")
    for column in named_like(case.head.values, "storey"):
        values = case.head.values[column]
        if 1 < len(values) <= 20 and not case.is_settled_by_where(column):
            yield Doubt(
                "W221",
                f"{column[:80]!r} names {len(values)} floors ({', '.join(v[:20] for v, _ in values.most_common(4))}), "
                f"and all rows go to {case.options.camera}",
                "people above each other would be counted as if they stood together",
                f'--where "{quoted(column)} = ..." with --camera, one command for each floor',
                is_sure=True,
            )
    for column in named_like(case.head.values, "camera"):
        values = case.head.values[column]
        if len(values) < 2 or case.is_settled_by_where(column):
            continue
        if len(values) > 50 and len(values) > sum(values.values()) / 10:  # such as the picture's file name
            continue
        shown = ", ".join(value[:20] for value, _ in values.most_common(4))
        yield Doubt(
            "W221",
            f"{column[:80]!r} names {len(values)} cameras ({shown}), and all rows go to {case.options.camera}",
            "people of several places would be counted as if they stood together",
            f"--map camera_id={column} (and engine_ids in vsd.toml), or --where \"{quoted(column)} = '...'\"",
            is_sure=True,
        )


def _merged_cameras(case: Case, what: str, found: AbstractSet[str], fix: str) -> Doubt:
    return Doubt(
        "W221",
        f"{what} ({', '.join(sorted(found)[:4])}), and all rows go to {case.options.camera}",
        "people of several places would be counted as if they stood together",
        f"{fix}; engine_ids in vsd.toml say which camera is meant",
        is_sure=True,
    )


def _classes(case: Case) -> Iterator[Doubt]:
    """W222: rows that are no people."""
    if case.head is None or case.sample.is_pairs:
        return
    if any(letters(column) not in VAGUE for column in named_like(case.head.plan.compared, "class")):
        return  # who filters by the class's name need not filter by its number as well
    for column in named_like(case.head.values, "class"):
        values = case.head.values[column]
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
        wanted = people[0] if people else first if numbers else "person"
        # words that are neither may name kinds of people, such as staff and customers
        is_sure = bool(words & (PERSON | OBJECTS)) or (bool(numbers) and len(values) > 1)
        n_others = sum(values[value] for value in others)
        yield Doubt(
            "W222",
            f"{column[:80]!r} has other values than persons: {', '.join(v[:20] for v in others[:5])} "
            f"({n_others:,} of {sum(values.values()):,} rows)",
            "every row would count as a person",
            f'--where "{quoted(column)} = {wanted if wanted.isdecimal() else repr(wanted)}"'
            f"{' if that number is a person' if numbers and not people else ''}",
            is_sure=is_sure,
        )


def _marked(case: Case) -> Iterator[Doubt]:
    """W222: rows that a tracker marks as not in view, or as no person."""
    if case.head is None or case.sample.is_pairs:
        return
    marks = [(column, _YES, _NO) for column in named_like(case.head.values, "absent")]
    marks += [(column, _NO, _YES) for column in named_like(case.head.values, "present")]
    for column, out, wanted in marks:
        values = case.head.values[column]
        n_out = sum(n for value, n in values.items() if value.lower() in out)
        seen = next((value for value in values if value.lower() in wanted), None)
        if n_out and seen is not None and len(values) == 2 and not case.is_settled_by_where(column):
            yield Doubt(
                "W222",
                f"{column[:80]!r} marks {n_out:,} of {sum(values.values()):,} rows",
                "what is no person, or nobody sees where the tracker guesses it, would count as one",
                f'--where "{quoted(column)} = {seen if seen.isdecimal() else repr(seen)}"',
                is_sure=True,
            )


def _sums(case: Case) -> Iterator[Doubt]:
    """W222: a line of sums below a table, read as a person."""
    tracks = case.sample.rows["track"].dropna().unique()
    names = [str(t) for t in tracks if letters(str(t)) in SUMS] if len(tracks) > 2 else []
    if names and len(names) < len(tracks) / 2:
        yield Doubt(
            "W222",
            f"{', '.join(name[:20] for name in names[:3])} as the id of a person: some rows seem to be sums",
            "a sum or mean would count as a person",
            "leave such lines out of the export",
        )


def _states(case: Case) -> Iterator[Doubt]:
    """W222: rows of tracks that the tracker has lost, or only predicts."""
    if case.head is None or case.sample.is_pairs:
        return
    for column in named_like(case.head.values, "state"):
        values = case.head.values[column]
        gone = [value for value in values if letters(value) in GONE]
        seen = [value for value in values if value not in gone]
        if gone and seen and not case.is_settled_by_where(column):
            n_gone = sum(values[value] for value in gone)
            yield Doubt(
                "W222",
                f"{column[:80]!r} says {', '.join(v[:20] for v in gone[:3])} for {n_gone:,} of "
                f"{sum(values.values()):,} rows",
                "people whom the tracker does not see would count where it guesses them",
                f'--where "{quoted(column)} = {max(seen, key=lambda v: values[v])!r}"',
                is_sure=True,
            )


def _weak(case: Case) -> Iterator[Doubt]:
    """W222: many rows of which the engine itself is not sure."""
    if case.head is None or case.sample.is_pairs:
        return
    for column in named_like(case.head.values, "confidence"):
        found = {float(v): n for v, n in case.head.values[column].items() if is_number(v)}
        if not found or min(found) < 0 or max(found) > 100 or sum(found.values()) < 5 * ROWS_MIN:
            continue
        limit = WEAK * (100 if max(found) > 1.5 else 1)
        share = sum(n for value, n in found.items() if value < limit) / sum(found.values())
        if share > WEAK_SHARE and not case.is_settled_by_where(column):
            yield Doubt(
                "W222",
                f"{column[:80]!r} is below {limit:g} in {share:.0%} of the rows",
                "the engine is not sure that these are people, and each would count as one",
                f'--where "{quoted(column)} >= {limit:g}"',
            )


def _confidences(case: Case) -> Iterator[Doubt]:
    """W222: a limit of confidence in shares, where the column has percents."""
    if case.head is None:
        return
    for compared in case.head.plan.where:
        column = compared.column
        if not is_named_like(column, "confidence") or not isinstance(compared.value, float):
            continue
        found = [float(v) for v in case.head.filtered.get(column, ()) if is_number(v)]
        if found and 0 < compared.value <= 1 and np.median(found) > 1.5:
            yield Doubt(
                "W222",
                f"--where compares {column[:80]!r} with {compared.value:g}, and it is {min(found):g} to {max(found):g}",
                "it holds percents, so the filter leaves out hardly any row",
                f"compare it with {compared.value * 100:g}",
                is_sure=True,
            )


def _nobody(case: Case) -> Iterator[Doubt]:
    """W222: objects in view, and none of them is a person."""
    n_other, n_unknown = (case.sample.n_dropped[reason] for reason in (NOT_A_PERSON, NO_CLASS))
    if case.sample.n or n_other + n_unknown < ROWS_MIN:
        return
    found = [f"{n_other:,} of another class"] * bool(n_other) + [f"{n_unknown:,} without a class"] * bool(n_unknown)
    yield Doubt(
        "W222",
        f"{n_other + n_unknown:,} objects were in view, {' and '.join(found)}, and none is a person",
        "its hours would count as recorded, with nobody in view",
        "if people were there: let the camera or engine classify persons, not only moving objects or faces",
        is_note=not n_unknown,
    )


def _others_in_a_row(case: Case) -> Iterator[Doubt]:
    """W228: columns of a second person in each row, and files that are not read."""
    if case.head is None:
        return
    names = case.head.plan.names
    axes = [names[ours] for ours in ("x_m", "y_m", "u_px", "v_px") if ours in names]
    others = [of_another_person(name, case.head.ignored) for name in axes]
    if axes and all(others):
        yield Doubt(
            "W228",
            f"{', '.join(o[:40] for o in others if o)} seem to hold another person, or another corner, in the same row",
            "a row is one person: who is in other columns would not be counted",
            "write one row for each person; a box: --map left=...,top=...,right=...,bottom=...",
            is_sure=True,
        )
    ids = [n for n in case.head.ignored if (t := names.get("track_id")) and of_another_person(t, [n])]
    if "left" in names and ids:
        yield Doubt(
            "W228",
            f"{ids[0][:40]!r} is the id of another person in the same row",
            "a row of two people is a pair: its two places are no corners of a box",
            "--format pairs --map track_a=...,track_b=...,x_a_m=...,y_a_m=...,x_b_m=...,y_b_m=...",
            is_sure=True,
        )
    for path in case.head.passed_over:
        yield Doubt(
            "W228",
            f"{path[:80]!r} is one entry of a list that has more of them",
            "who is in the other entries would not be counted",
            "write one message for each entry, or read each by a command of its own (--camera, --persons)",
            is_sure=True,
        )
    if unread := case.head.unread:
        more = f" and {len(unread) - 3} more" if len(unread) > 3 else ""
        yield Doubt(
            "W228",
            f"{', '.join(name[-40:] for name in unread[:3])}{more} {'is' if len(unread) == 1 else 'are'} not read",
            "a folder or archive is read as tables: csv, tsv, parquet, feather, arrow, also gzip, bzip2 and zstd",
            "name these files in a command of their own",
        )


def _is_person(value: str) -> bool:
    """Return whether a class is people: a word for them, also with a number behind it, or class 0 of COCO."""
    return letters(value) in PERSON or value.strip().lower() in PERSON or value in ("0", "0.0")


def _ids(case: Case) -> Iterator[Doubt]:
    """W225: no ids, or ids that do not last."""
    sample = case.sample
    if sample.is_pairs or not sample.n:
        return
    why = "a violation needs the same two people for 3 seconds; records, person-hours and maps are not concerned"
    like = [] if case.head is None else ids_like(case.head.ignored)
    named = f"--map {shlex.quote('track_id=' + (like[0] if like else '...'))}"
    if case.head is not None and not sample.has_ids:
        what = "there are no track ids: violations cannot be counted"
        fix = named if like else "export the tracker's ids, and map them: --map track_id=..."
        yield Doubt("W225", what, why, fix, is_note=not like)
        return
    if sample.has_ids:
        n_without = int((sample.rows["track_no"] < 0).sum())
        if n_without > sample.n / 2:
            what = f"{n_without:,} of {sample.n:,} rows have no track id"
            yield Doubt("W225", what, why, "export the tracker's ids for everybody in view", is_note=True)
        n_records = sample.rows.loc[sample.rows["track_no"] >= 0, "track_no"].value_counts()
        n_frames = sample.rows["ts_ms"].nunique()
        if len(n_records) >= 2 * ROWS_MIN and n_frames >= 3 and float((n_records == 1).mean()) > 0.9:
            what = f"{len(n_records):,} track ids, and nearly each has one record: they do not last"
            yield Doubt("W225", what, why, f"map the id of the track, not of the detection or row: {named}")


COLUMN_LOOKS: Final[tuple[Callable[[Case], Iterator[Doubt]], ...]] = (
    _cameras_of_files,
    _cameras,
    _classes,
    _marked,
    _sums,
    _states,
    _weak,
    _confidences,
    _nobody,
    _others_in_a_row,
    _ids,
)
