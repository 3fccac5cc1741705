"""Finding MOTChallenge sequences: in a file, a sequence folder, or a folder or zip of several."""

from __future__ import annotations

import configparser
import dataclasses
import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO

from vsd_analytics.errors import InputError, UsageError, Where
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.archive import Member, archive_kind, members

MAX_INI_BYTES = 65_536
SEQUENCE_FILES = re.compile(r"(?:^|/)(?:gt/gt\.txt|det/det\.txt|seqinfo\.ini)$")


@dataclass(frozen=True, slots=True)
class Sequence:
    """One sequence of boxes.

    Attributes:
        title: Its name as the source has it.
        camera: Camera its records belong to; None when neither the user nor a folder names one.
        open: Opens the text of boxes.
        is_detections: True for det.txt, whose ninth column never is a class.
        fps: Frames per second of `seqinfo.ini`; None = unknown.
        n_frames: Length of `seqinfo.ini`; 0 = unknown.
    """

    title: str
    camera: str | None
    open: Callable[[], IO[bytes]]
    is_detections: bool
    fps: float | None = None
    n_frames: int = 0


@contextmanager
def sequences(source: Source, options: IngestOptions) -> Iterator[list[Sequence]]:
    """Open a source and yield its sequences, or those that `options.camera` selects."""
    kind = archive_kind(source)
    if kind == "tar":
        raise _no_sequences(source)
    if kind is None:
        yield [_single(source, options)]
        return
    with members(source, wanted=SEQUENCE_FILES) as members_here:
        folders: dict[PurePosixPath, dict[str, Member]] = {}
        for member in members_here:
            path = PurePosixPath(member.name)
            folder = path.parent if path.name == "seqinfo.ini" else path.parent.parent
            folders.setdefault(folder, {})[path.name] = member
        whole = [
            _sequence(source, folder.name or bare_name(source.path.absolute()).removesuffix(".zip"), files)
            for folder, files in folders.items()
            if "gt.txt" in files or "det.txt" in files
        ]
        yield _chosen(source, whole, options)


def _chosen(source: Source, every: list[Sequence], options: IngestOptions) -> list[Sequence]:
    cameras = [s.camera for s in every]
    if not every:
        raise _no_sequences(source)
    if options.camera is None and len(set(cameras)) == len(cameras):
        return every
    if options.camera is not None:
        matching = [s for s in every if options.camera in (s.camera, s.title)] or (every if len(every) == 1 else [])
        if len(matching) == 1:
            return [dataclasses.replace(matching[0], camera=options.camera)]
    raise UsageError(
        f"{source.file_name} holds {len(every)} sequences and it is not clear which are meant",
        where=Where(source.name),
        why=f"--camera is {options.camera or 'not given'}; the sequences are {', '.join(str(c) for c in cameras[:20])}",
        fix="give --camera the name of one of them, or unpack the archive and name one folder",
    )


def _no_sequences(source: Source) -> InputError:
    return InputError(
        f"{source.file_name} holds no gt/gt.txt and no det/det.txt",
        code="E204",
        where=Where(source.name),
        fix="name a sequence folder, or a zip of sequences, as MOTChallenge packs them",
    )


def _sequence(source: Source, title: str, files: dict[str, Member]) -> Sequence:
    fps, n_frames = _seqinfo(source, files["seqinfo.ini"].open) if "seqinfo.ini" in files else (None, 0)
    boxes = files.get("gt.txt") or files["det.txt"]
    return Sequence(title, _camera(title) or "sequence", boxes.open, "gt.txt" not in files, fps, n_frames)


def _single(source: Source, options: IngestOptions) -> Sequence:
    path = source.path.absolute()
    ini = path.parent.parent / "seqinfo.ini"
    in_sequence = path.parent.name in ("gt", "det")
    fps, n_frames = _seqinfo(source, lambda: ini.open("rb")) if in_sequence and ini.is_file() else (None, 0)
    camera = options.camera or (_camera(path.parent.parent.name) if in_sequence else "") or None
    return Sequence(path.name, camera, source.open, bare_name(path) == "det.txt", fps, n_frames)


def _camera(title: str) -> str:
    """Return a camera id made from a sequence name: lower case, with - for all but letters, digits, _ and -."""
    return re.sub(r"[^a-z0-9_-]+", "-", title.lower()).strip("-_")[:63]


def _seqinfo(source: Source, opened: Callable[[], IO[bytes]]) -> tuple[float | None, int]:
    """Return frame rate and number of frames from `seqinfo.ini`; None and 0 where it has no valid number."""
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        with opened() as stream:
            parser.read_string(stream.read(MAX_INI_BYTES).decode("utf-8-sig", "replace"))
        fps = parser.getfloat("Sequence", "frameRate", fallback=None)
        n_frames = parser.getint("Sequence", "seqLength", fallback=0)
    except (configparser.Error, ValueError):
        return None, 0
    is_length = 0 < n_frames <= source.settings.sequence_frames_max
    return fps if fps and math.isfinite(fps) and fps > 0 else None, n_frames if is_length else 0


def bare_name(path: Path) -> str:
    """Return the lower-case file name without a compression suffix."""
    return re.sub(r"\.(?:gz|bz2|zst)$", "", path.name.lower())
