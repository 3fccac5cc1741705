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
from vsd_analytics.ingest.adapter import Source

MAX_BYTES = 2 * 1024**3
MAX_RATIO = 200
FREE_BYTES = 64 * 1024**2
"""Below this size no compression ratio is absurd: small tables of zeros compress a thousandfold."""
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
    """Return what holds several files here, by first bytes: "folder", "zip", "tar" (plain, gz or bz2) or None.

    An archive damaged before its first byte comes out is told by its name, so that reading it can say so.
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
    """Open a folder or archive and hand out its files whose names `wanted` finds something in.

    Args:
        source: A folder, a zip, or a tar, plain, gz or bz2.
        wanted: Searched in each member's path, in which slashes are forward.

    Yields:
        The members: of a folder or zip in order of their names, of a tar as they stand in it.

    Raises:
        InputError: E205 when the archive is damaged or encrypted, E206 when it would unpack to an absurd size; both
            also while a member is being read.
    """
    kind = archive_kind(source)
    if kind == "folder":
        yield _folder_members(source.path, wanted)
    elif kind == "zip":
        with _translated(source.name):
            archive = zipfile.ZipFile(source.path)
        with archive:
            yield _zip_members(source, archive, wanted)
    elif kind == "tar":
        limit = max(FREE_BYTES, min(MAX_BYTES, MAX_RATIO * source.size_bytes))
        with source.path.open("rb") as packed:
            yield _tar_members(source.name, packed, wanted, limit)
    else:
        raise InputError(
            f"{source.path.name} is neither a folder nor a zip or tar archive",
            code="E204",
            where=Where(source.name),
            mend="name the folder or the archive the files came in",
        )


def _folder_members(root: Path, wanted: re.Pattern[str]) -> list[Member]:
    found = []
    for folder, _, files in os.walk(root):
        for file in files:
            path = Path(folder, file)
            name = path.relative_to(root).as_posix()
            if wanted.search(name):
                found.append(Member(name, Source(path).open))
    return sorted(found, key=lambda m: m.name)


def _zip_members(source: Source, archive: zipfile.ZipFile, wanted: re.Pattern[str]) -> list[Member]:
    def opener(info: zipfile.ZipInfo) -> Callable[[], IO[bytes]]:
        def opened() -> IO[bytes]:
            with _translated(source.name):
                raw = archive.open(info)
            return io.BufferedReader(_Guarded(raw, f"{source.name}/{info.filename}", info.file_size))

        return opened

    found = sorted((i for i in archive.infolist() if wanted.search(i.filename)), key=lambda i: i.filename)
    for info in found:
        limit = max(FREE_BYTES, min(MAX_BYTES, MAX_RATIO * info.compress_size))
        if info.file_size > limit:
            raise _too_large(f"{source.name}/{info.filename}", limit)
    return [Member(i.filename, opener(i)) for i in found]


def _tar_members(name: str, packed: IO[bytes], wanted: re.Pattern[str], limit: int) -> Iterator[Member]:
    with _translated(name), tarfile.open(fileobj=packed, mode="r|*", tarinfo=_TarInfo) as archive:
        for info in archive:
            archive.members = []  # type: ignore[attr-defined]  # else every header of the stream is kept
            if info.offset_data + info.size > limit:
                raise _too_large(name, limit)
            raw = archive.extractfile(info) if info.isreg() and wanted.search(info.name) else None
            if raw is not None:
                stream = io.BufferedReader(_Guarded(raw, f"{name}/{info.name}", info.size))
                yield Member(info.name, partial(_same, stream))


def _same(stream: IO[bytes]) -> IO[bytes]:
    return stream


class _TarInfo(tarfile.TarInfo):
    """A tar header that refuses long names and extended headers of absurd size, which would be read whole."""

    @classmethod
    def frombuf(cls, buf: bytes | bytearray, encoding: str, errors: str) -> _TarInfo:
        info = super().frombuf(buf, encoding, errors)
        if not (info.isfile() or info.isdir()) and info.size > MAX_HEADER_BYTES:
            raise _too_large("a header of the archive", MAX_HEADER_BYTES)
        return info


class _Guarded(io.RawIOBase):
    """A stream that ends with E206 beyond its limit and turns damage into E205."""

    def __init__(self, raw: IO[bytes], name: str, limit: int) -> None:
        self._raw, self._name, self._limit, self._read = raw, name, limit, 0

    def readable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._read

    def readinto(self, buffer) -> int:  # type: ignore[no-untyped-def]
        with _translated(self._name):
            data = self._raw.read(len(buffer))
        self._read += len(data)
        if self._read > self._limit:
            raise _too_large(self._name, self._limit)
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
            f"{Path(name).name} is damaged, breaks off early or is encrypted",
            code="E205",
            where=Where(name),
            why=f"the archive reader says: {error}",
            mend="copy or export the archive again; the records before the damage are kept",
        ) from None


def _too_large(name: str, limit: int) -> InputError:
    return InputError(
        f"{Path(name).name} would unpack to more than {limit / 1024**2:,.0f} MiB",
        code="E206",
        where=Where(name),
        why=f"no recording compresses more than {MAX_RATIO}-fold; this looks like an archive made to fill a disk",
        mend="unpack it by hand, look at it, and name the files you want",
    )
