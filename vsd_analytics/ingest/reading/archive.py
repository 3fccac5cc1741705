"""Files inside a folder, a zip or a tar, read in place and in bounded memory.

Names inside archives only choose and describe members; nothing is ever written under them.
"""

from __future__ import annotations

import io
import os
import re
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Literal

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import Source
from vsd_analytics.ingest.reading.limits import unpacked_max, unpacks_too_far

MAX_HEADER_BYTES = 1024**2

_DAMAGE = (zipfile.BadZipFile, tarfile.TarError, zlib.error, EOFError, OSError, RuntimeError)

Kind = Literal["folder", "zip", "tar"]


@dataclass(frozen=True, slots=True)
class Member:
    """One file of a folder or archive.

    Attributes:
        name: Path inside, with forward slashes; hostile, never a path to write to.
        open: Opens it for reading; a member of a tar can be read only before the next one is asked for.
    """

    name: str
    open: Callable[[], IO[bytes]]


def archive_kind(source: Source) -> Kind | None:
    """Return the kind of container, by its first bytes: "folder", "zip", "tar" (plain, gz or bz2), or None.

    An archive from which not even the first byte can be unpacked is recognised by its name, so that reading it reports
    the damage.
    """
    if source.path.is_dir():
        return "folder"
    head = source.head(512)
    if head[:4] in (b"PK\x03\x04", b"PK\x05\x06"):
        return "zip"
    if head[257:262] == b"ustar" or (
        not head and source.path.name.lower().endswith((".tar", ".tar.gz", ".tgz", ".tar.bz2"))
    ):
        return "tar"
    return None


@contextmanager
def members(source: Source, *, wanted: re.Pattern[str]) -> Iterator[Iterable[Member]]:
    """Open a folder or archive and yield its files whose names match `wanted`.

    Args:
        source: A folder, a zip, or a tar, plain, gz or bz2.
        wanted: Searched in each member's path, which has forward slashes.

    Yields:
        The members: of a folder or zip in order of their names, of a tar in its own order.

    Raises:
        InputError: E205 when the archive is damaged or encrypted, E206 when it would unpack to more than is allowed;
            both also while a member is being read.
    """
    kind = archive_kind(source)
    if kind == "folder":
        yield _folder_members(source, wanted)
    elif kind == "zip":
        with _translated(source.name):
            archive = zipfile.ZipFile(source.path)
        with archive:
            yield _zip_members(source, archive, wanted)
    elif kind == "tar":
        with source.path.open("rb") as packed:
            yield _tar_members(source, packed, wanted)
    else:
        raise InputError(
            f"{source.file_name} is neither a folder nor a zip or tar archive",
            code="E204",
            where=Where(source.name),
            fix="name the folder or the archive the files came in",
        )


def _folder_members(source: Source, wanted: re.Pattern[str]) -> list[Member]:
    root, paths = source.path, []
    for folder, _, files in os.walk(root):
        for file in files:
            path = Path(folder, file)
            name = path.relative_to(root).as_posix()
            if wanted.search(name):
                paths.append(Member(name, Source(path, settings=source.settings).open))
    return sorted(paths, key=lambda m: m.name)


def _zip_members(source: Source, archive: zipfile.ZipFile, wanted: re.Pattern[str]) -> list[Member]:
    def opener(info: zipfile.ZipInfo) -> Callable[[], IO[bytes]]:
        def opened() -> IO[bytes]:
            with _translated(source.name):
                raw = archive.open(info)
            return io.BufferedReader(_Guarded(raw, f"{source.name}/{info.filename}"))

        return opened

    infos = sorted((i for i in archive.infolist() if wanted.search(i.filename)), key=lambda i: i.filename)
    # members may share bytes of the archive, so their sum is compared with its size
    n_packed, n_unpacked = source.size_bytes, sum(info.file_size for info in infos)
    if n_unpacked > unpacked_max(n_packed, source.settings):
        raise unpacks_too_far(source.name, n_bytes=n_packed, settings=source.settings, unpacked_bytes=n_unpacked)
    return [Member(i.filename, opener(i)) for i in infos]


def _tar_members(source: Source, packed: IO[bytes], wanted: re.Pattern[str]) -> Iterator[Member]:
    name, n_packed = source.name, source.size_bytes
    limit = unpacked_max(n_packed, source.settings)
    with _translated(name), tarfile.open(fileobj=packed, mode="r|*", tarinfo=_TarInfo) as archive:
        for info in archive:
            archive.members = []  # type: ignore[attr-defined]  # or tarfile stores every header of the stream
            if info.offset_data + info.size > limit:
                raise unpacks_too_far(name, n_bytes=n_packed, settings=source.settings)
            raw = archive.extractfile(info) if info.isreg() and wanted.search(info.name) else None
            if raw is not None:
                stream = io.BufferedReader(_Guarded(raw, f"{name}/{info.name}"))
                yield Member(info.name, partial(_same, stream))


def _same(stream: IO[bytes]) -> IO[bytes]:
    return stream


class _TarInfo(tarfile.TarInfo):
    """A tar header that refuses long names and extended headers beyond `MAX_HEADER_BYTES`: they are read whole."""

    @classmethod
    def frombuf(cls, buf: bytes | bytearray, encoding: str, errors: str) -> _TarInfo:
        info = super().frombuf(buf, encoding, errors)
        if not (info.isfile() or info.isdir()) and info.size > MAX_HEADER_BYTES:
            raise InputError(
                f"a header of the archive has {info.size:,} bytes; at most {MAX_HEADER_BYTES:,} are read",
                code="E206",
                why="headers hold names, which are short; this looks like an archive made to fill memory",
                fix="unpack it by hand, look at it, and name the files you want",
            )
        return info


class _Guarded(io.RawIOBase):
    """A stream that turns damage into E205; zip and tar never return more of a member than its header says."""

    def __init__(self, raw: IO[bytes], name: str) -> None:
        self._raw, self._name, self._read = raw, name, 0

    def readable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._read

    def readinto(self, buffer) -> int:  # type: ignore[no-untyped-def]
        with _translated(self._name):
            data = self._raw.read(len(buffer))
        self._read += len(data)
        buffer[: len(data)] = data
        return len(data)


@contextmanager
def _translated(name: str) -> Iterator[None]:
    try:
        yield
    except InputError:
        raise
    except _DAMAGE as error:
        raise InputError(
            f"{Path(name).name} is damaged, ends early or is encrypted",
            code="E205",
            where=Where(name),
            why=f"the archive reader says: {error}",
            fix="copy or export the archive again; the records before the damage are stored",
        ) from None
