"""Any file or folder of people: which reader it takes."""

from __future__ import annotations

from pathlib import Path

from vsd_analytics.engine.doubles import without_doubles
from vsd_analytics.engine.people import People
from vsd_analytics.errors import InputError, Where
from vsd_analytics.owners import is_there


def read_each_once(path: Path, *, size_px: tuple[int, int] | None = None) -> People:
    """Read the people a detector found, with one skeleton for each person (`without_doubles`).

    Takes and raises what `read_people` does.
    """
    return without_doubles(read_people(path, size_px=size_px))


def read_people(path: Path, *, size_px: tuple[int, int] | None = None) -> People:
    """Read the people a detector found, whatever it wrote them as.

    Args:
        path: A folder of JSON files (OpenPose, Monoloco) or of text files (ultralytics), a JSON file, or a CSV table of
            boxes.
        size_px: Width and height of the picture; needed for ultralytics only, which writes shares of it.

    Raises:
        InputError: There is no such file (E201), or nothing in it can be used (E202, E203, E205).
    """
    if not is_there(path):
        raise InputError(f"there is no file {path}", code="E201", where=Where(str(path)), fix="check the path")
    if path.is_dir():
        if any(path.glob("*.txt")) and not any(path.glob("*.json")):
            from vsd_analytics.engine.ultralytics_labels import read_labels

            return read_labels(path, size_px=size_px)
        from vsd_analytics.engine.monoloco_files import is_monoloco, read_monoloco

        if is_monoloco(path):
            return read_monoloco(path).people
        from vsd_analytics.engine.joint_files import read_joint_folder

        return read_joint_folder(path)
    if path.suffix.lower() in {".json", ".jsonl"}:
        from vsd_analytics.engine.joint_files import read_joint_file

        return read_joint_file(path)
    from vsd_analytics.engine.box_table import read_boxes

    return read_boxes(path)
