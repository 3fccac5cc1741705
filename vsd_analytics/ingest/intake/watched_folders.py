"""The folders that a project watches, and the files in them that were read: these hold people's positions, too.

`status/watched.json` lists every folder that was ever watched, so that a purge finds what was read in all of them.
"""

from __future__ import annotations

import json
import stat
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Final

from vsd_analytics.store.durable import make_dirs, publish

INBOX: Final = "inbox"
"""The watched folder of the units of systemd, below the project."""
DONE: Final = "done"
FAILED: Final = "failed"
LOCK: Final = ".vsd-watch.lock"
"""File that a watch leaves in its folder: without it, an `inbox/` is somebody else's."""
_LIST: Final = Path("status") / "watched.json"


def note_watched(root: Path, folder: Path) -> None:
    """Add a folder to the list of a project's watched folders.

    Args:
        root: The project's folder.
        folder: The folder that is watched.
    """
    known = watched_folders(root)
    if folder.resolve() not in known:
        make_dirs(root / _LIST.parent)
        publish(root / _LIST, json.dumps(sorted(map(str, [*known, folder.resolve()]))).encode())


def watched_folders(root: Path) -> tuple[Path, ...]:
    """Return the folders that a project watches or watched, whole paths, sorted."""
    try:
        listed = json.loads((root / _LIST).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        listed = []
    folders = {Path(str(folder)) for folder in listed} if isinstance(listed, list) else set()
    if (root / INBOX / LOCK).exists():
        folders.add((root / INBOX).resolve())
    return tuple(sorted(folders))


def files_read_before(root: Path, instant: datetime) -> Iterator[Path]:
    """Yield the files that a watch moved to `done/` or `failed/` before an instant, and the texts beside them.

    The time is that of the move: a file system notes it, and nobody sets it. A `done` that is a link is left alone: who
    may write to a watched folder must not choose what a purge deletes.

    Args:
        root: The project's folder.
        instant: Aware instant.
    """
    for folder in watched_folders(root):
        for place in (folder / DONE, folder / FAILED):
            if place.is_symlink():
                continue
            try:
                paths = sorted(place.iterdir())
            except (FileNotFoundError, NotADirectoryError):
                continue
            for path in paths:
                about = path.lstat()
                if stat.S_ISREG(about.st_mode) and about.st_ctime < instant.timestamp():
                    yield path
