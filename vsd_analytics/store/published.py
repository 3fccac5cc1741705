"""One set of current fact files under names of their own, for programs that read Parquet by a glob.

```
published/current -> <generation>                                  swapped by one rename
published/<generation>/<relation>/<file>.parquet -> ../../../facts/...   links; nothing is copied
```

A generation never changes after it appears. Its files have the fingerprint of their rows in their names, so a reader
who lists `current` before a swap and opens after it finds the same rows under a name, or no such file: never two files
of a day, never rows of two generations. Links, because a second name of a file would give purged rows a second life.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from vsd_analytics.store.durable import fsync_dir, make_dirs
from vsd_analytics.store.file_locks import folder_lock

FOLDER: Final = "published"
CURRENT: Final = "current"
UP: Final = Path("..", "..", "..")
"""From the folder of a relation to the project."""


def publish_links(project: Path, files: Mapping[str, Sequence[Path]]) -> bool:
    """Make a generation of links and swap `published/current` to it; return whether it is current now.

    The caller holds the locks against removal of records and of facts. A stop at any moment leaves the old generation
    or the new one. Not swapped when a file is missing, which means that a later build replaced it already.

    Args:
        project: The project folder.
        files: By relation, its files below the project folder; no two have one name.

    Raises:
        OSError: The disk is full or read-only; the old generation stays.
    """
    links = {f"{name}/{link_name(path)}": path.relative_to(project) for name, paths in files.items() for path in paths}
    if not all((project / path).exists() for path in links.values()):
        return False
    text = "\n".join(f"{link} {path}" for link, path in sorted(links.items()))
    generation = hashlib.blake2b(text.encode(), digest_size=8).hexdigest()
    with _alone(project):
        folder = project / FOLDER
        if _generation(project) != generation:
            if not (folder / generation).is_dir():
                _write(folder, generation, sorted(files), links)
            _swap(folder, generation)
    return True


def published_files(project: Path) -> frozenset[Path]:
    """Return the files that the current generation names, below the project; they stay until others are published."""
    links = (project / FOLDER / (_generation(project) or "-")).glob("*/*.parquet")
    return frozenset(Path(*Path(os.readlink(link)).parts[len(UP.parts) :]) for link in links)


def sweep_generations(project: Path) -> None:
    """Remove all generations but the current one, and what a stopped program left; nobody reads facts now."""
    folder, current = project / FOLDER, _generation(project)
    if not folder.is_dir():
        return
    with _alone(project):
        for path in folder.iterdir():
            if path.name not in (CURRENT, current):
                _remove(path)


def withdraw(project: Path) -> None:
    """Publish nothing any more, `current` first: before records are removed, so that no name leads to their facts."""
    folder = project / FOLDER
    if not folder.is_dir():
        return
    with _alone(project):
        if os.path.lexists(folder / CURRENT):
            _remove(folder / CURRENT)
        fsync_dir(folder)
        for path in folder.iterdir():
            _remove(path)


def _remove(path: Path) -> None:
    """Remove a link or a folder. A program that copied the project may have put folders in the place of links."""
    if path.is_symlink() or not path.is_dir():
        path.unlink()
    else:
        shutil.rmtree(path)


def link_name(path: Path) -> str:
    """Return the name of a link: date, hour and fingerprint, so that one name always has the same rows."""
    return f"{path.parent.name.removeprefix('date=')}-{path.name}"


def _generation(project: Path) -> str | None:
    try:
        return os.readlink(project / FOLDER / CURRENT)
    except OSError:
        return None


@contextlib.contextmanager
def _alone(project: Path) -> Iterator[None]:
    """Hold the lock of the folder: two builds publish one after the other."""
    make_dirs(project / FOLDER)
    with folder_lock(project / FOLDER):
        yield


def _write(folder: Path, generation: str, relations: Sequence[str], links: Mapping[str, Path]) -> None:
    """Write the links under a temporary name, durably: a power cut must not leave a generation with fewer files."""
    temporary = folder / f".{generation}.{secrets.token_hex(8)}.tmp"
    for name in relations:
        (temporary / name).mkdir(parents=True, mode=0o700)
    for link, path in links.items():
        (temporary / link).symlink_to(UP / path)
    for part in (*(temporary / name for name in relations), temporary):
        fsync_dir(part)
    temporary.rename(folder / generation)


def _swap(folder: Path, generation: str) -> None:
    temporary = folder / f".{CURRENT}.{secrets.token_hex(8)}.tmp"
    temporary.symlink_to(generation)
    if (folder / CURRENT).is_dir() and not (folder / CURRENT).is_symlink():
        _remove(folder / CURRENT)  # a copy: a link cannot be renamed over a folder
    temporary.rename(folder / CURRENT)
    fsync_dir(folder)
