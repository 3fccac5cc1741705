"""The camera of a file whose name says it: `camera_from_name` of a `[[source]]`."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import replace

from vsd_analytics.config.camera_in_name import cameras_in_name, text_in_name
from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.table_parts import TablePart


def camera_of(source: Source, pattern: str, known: Mapping[str, str], *, rule_id: str | None) -> str:
    """Return the camera that the name of a file says.

    Args:
        source: The file.
        pattern: `camera_from_name`.
        known: Ids of cameras by their names.
        rule_id: The `[[source]]` that has the pattern.

    Raises:
        InputError: E213, it says none of them, or several.
    """
    cameras = cameras_in_name(source.name, pattern, known)
    if len({known[name] for name in cameras}) == 1:
        return cameras[0]
    by = f'[[source]] {rule_id} reads it from camera_from_name = "{pattern}"'
    text = text_in_name(source.name, pattern)
    fix = f"rename the file, or --camera {next(iter(known), 'ID')}"
    if len(cameras) > 1:
        what = f"the name of {source.file_name} says several cameras: {', '.join(sorted(cameras)[:4])}"
    elif text is None:
        what = f"the name of {source.file_name} says no camera"
    else:
        what = f"the name of {source.file_name} says camera {text[:80]!r}, which vsd.toml does not have"
        near = difflib.get_close_matches(text, known, n=1)
        fix = f'engine_ids = ["{text[:80]}"] under its [[camera]] in vsd.toml, or a new [[camera]]'
        fix += f"; did you mean {near[0]}?" if near else ""
    names = ", ".join(list(known)[:20]) or "none"
    raise InputError(what, code="E213", where=Where(source.name), why=f"{by}; known cameras: {names}", fix=fix)


def part_with_camera(part: TablePart, options: IngestOptions) -> TablePart:
    """Return a file of a folder or archive with the column `camera_id` that its name says, where a profile asks for it.

    Raises:
        InputError: E213, as `camera_of`.
    """
    pattern = options.camera_from_name
    if pattern is None:
        return part
    known = {name: name for name in options.clocks}  # these have all names of cameras
    camera = camera_of(part.source, pattern, known, rule_id=options.profile)
    return replace(part, constants={"camera_id": camera, **part.constants})
