"""Files, archives and drawings that were made to do harm; each try says in a few words what came of it."""

import bz2
import contextlib
import gzip
import io
import os
import socket
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path

import pyarrow as pa
from hostile_lab import HEAD, START, Lab, message, zipped


def _fifo(lab: Lab, *parts: str) -> Path:
    path = lab.file("beside.txt", b"x").parent.joinpath(*parts)
    path.parent.mkdir(parents=True, exist_ok=True)
    os.mkfifo(path)
    return path


def _link(lab: Lab, target: str, name: str = "a.csv") -> Path:
    path = lab.file("beside.txt", b"x").parent / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.symlink_to(target)
    return path


def _socket(lab: Lab) -> Path:
    path = lab.file("beside.txt", b"x").parent / "s"
    with contextlib.chdir(path.parent), socket.socket(socket.AF_UNIX) as s:  # the path of a socket must be short
        s.bind("s")
    return path


def _folder_with(lab: Lab, make: Callable[..., Path], *, like: str) -> str:
    start = () if like.startswith("objects_log") else START  # it has times of its own, and reads no --start
    return lab.ingest(make(lab, *like.split("/")).parents[like.count("/")], "--format", _FORMATS[like], *start,
                      "--camera", "cam-1")  # fmt: skip


_FORMATS = {
    "objects_log/a.csv": "smart-social-distancing",
    "gt/gt.txt": "motchallenge",
    "annotations_positions/00000000.json": "wildtrack",
}
PATHS: Mapping[str, Callable[[Lab], str]] = {
    "a named pipe": lambda lab: lab.ingest(_fifo(lab, "a.csv")),
    "/dev/zero": lambda lab: lab.ingest(Path("/dev/zero")),
    "/dev/stdin": lambda lab: lab.ingest(Path("/dev/stdin")),
    "a socket": lambda lab: lab.ingest(_socket(lab)),
    "a link to /dev/zero": lambda lab: lab.ingest(_link(lab, "/dev/zero")),
    "a link to itself": lambda lab: lab.ingest(_link(lab, "a.csv")),
    "a link to nothing": lambda lab: lab.ingest(_link(lab, "nothing.csv")),
    "a link to a recording": lambda lab: lab.ingest(_link(lab, str(lab.file("b.jsonl", message())), "a.jsonl")),
    **{
        f"a pipe for {like} in a folder": lambda lab, like=like: _folder_with(lab, _fifo, like=like)  # type: ignore[misc]
        for like in _FORMATS
    },
    "a path of 10 kB": lambda lab: lab.ingest(Path("x" * 10_000)),
    "a name that is no UTF-8": lambda lab: lab.ingest(lab.file(os.fsdecode(b"\xff.jsonl"), message())),
}


def _tar(*entries: tuple[str, bytes, str]) -> bytes:
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w") as archive:
        for name, data, link in entries:
            info = tarfile.TarInfo(name)
            info.size = len(data)
            if link:
                info.type, info.linkname = tarfile.SYMTYPE, link
            archive.addfile(info, io.BytesIO(data))
    return out.getvalue()


_PERSON = b'[{"personID":1,"positionID":7}]'
_FILE = "annotations_positions/00000000.json"


def _bomb(name: str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, b"[" + b" " * (80 << 20) + b"]")
    return out.getvalue()


def _lying(name: str) -> bytes:
    """Return a zip whose member says that it is small and is not."""
    data = bytearray(_bomb(name))
    for mark, at in ((b"PK\x01\x02", 24), (b"PK\x03\x04", 22)):
        start = data.find(mark) + at
        data[start : start + 4] = struct.pack("<I", 1000)
    return bytes(data)


def _encrypted(name: str) -> bytes:
    data = bytearray(zipped({name: _PERSON}))
    for mark, at in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        data[data.find(mark) + at] |= 1
    return bytes(data)


def _archive(name: str, make: Callable[[], bytes], *more: str) -> Callable[[Lab], str]:
    return lambda lab: lab.ingest(lab.file(name, make()), *START, "--camera", "cam-1", *more)


def _bz2() -> bytes:
    return bz2.compress(HEAD + b" " * (80 << 20))


def _zst() -> bytes:
    data: bytes = pa.Codec("zstd").compress(message() + b" " * (200 << 20), asbytes=True)
    return data


ARCHIVES: Mapping[str, Callable[[Lab], str]] = {
    "zip, a member of 80 MiB of blanks": _archive("a.zip", lambda: _bomb(_FILE), "--format", "wildtrack"),
    "zip, a member that says it is small": _archive("a.zip", lambda: _lying(_FILE), "--format", "wildtrack"),
    "zip, encrypted": _archive("a.zip", lambda: _encrypted(_FILE), "--format", "wildtrack"),
    "zip, member ../../": _archive("a.zip", lambda: zipped({f"../../{_FILE}": _PERSON})),
    "zip, member /": _archive("a.zip", lambda: zipped({f"/{_FILE}": _PERSON})),
    "zip, 5,000 members": _archive(
        "a.zip", lambda: zipped({f"annotations_positions/{k}.json": b"[]" for k in range(5000)})
    ),
    "tar, member ../../": _archive("a.tar", lambda: _tar((_FILE, _PERSON, ""), (f"../../{_FILE}", _PERSON, ""))),
    "tar, a link to /etc/passwd": _archive(
        "a.tar", lambda: _tar((_FILE, _PERSON, ""), (_FILE.replace("0.", "1."), b"", "/etc/passwd"))
    ),
    "tar.gz, 80 MiB of zeros": _archive(
        "a.tar.gz", lambda: gzip.compress(_tar((_FILE, b"\0" * (80 << 20), "")), mtime=0)
    ),
    "csv.bz2, 80 MiB of blanks": _archive("a.csv.bz2", _bz2),
    "jsonl.zst, 200 MiB of blanks": _archive("a.jsonl.zst", _zst),
}


def _png(width: int, height: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0" * 99)) + chunk(b"IEND", b"")


def _plan(name: str, data: bytes) -> Callable[[Lab], str]:
    def tried(lab: Lab) -> str:
        from vsd_analytics.errors import VsdError
        from vsd_analytics.geometry.embedded_pictures import has_paper, plan_image
        from vsd_analytics.geometry.picture_size import picture_size

        path = lab.file(name, data)
        if picture_size(path) is None:
            return "refused E126"
        try:
            has_paper(path)
            plan_image(path)
        except VsdError as error:
            return f"refused {error.code}"
        return "drawn"

    return tried


def _svg(inner: str = "", *, head: str = "", more: str = "") -> bytes:
    return f'{head}<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"{more}>{inner}</svg>'.encode()


_LAUGHS = "<!DOCTYPE svg [<!ENTITY a 'aaaaaaaaaaaaaaaaaaaa'>{}]>".format(
    "".join(f"<!ENTITY {b} '{f'&{a};' * 20}'>" for a, b in zip("abcdefgh", "bcdefghi", strict=True))
)
PICTURES: Mapping[str, Callable[[Lab], str]] = {
    "SVG, a plain drawing": _plan(
        "a.svg", _svg("<rect fill='url(#p)'/><a href='https://example.org'><use href='#r'/></a>")
    ),
    "SVG, script": _plan("a.svg", _svg("<script>alert(1)</script>")),
    "SVG, event handler": _plan("a.svg", _svg(more=" onload='alert(1)'")),
    "SVG, foreignObject": _plan(
        "a.svg", _svg("<foreignObject><p xmlns='http://www.w3.org/1999/xhtml'/></foreignObject>")
    ),
    "SVG, picture from elsewhere": _plan("a.svg", _svg("<image href='https://example.org/a.png'/>")),
    "SVG, style from elsewhere": _plan("a.svg", _svg("<style>@import 'https://example.org/a.css'</style>")),
    "SVG, fill from elsewhere": _plan("a.svg", _svg("<rect style='fill: url( https://example.org/a#b )'/>")),
    "SVG, javascript: link": _plan("a.svg", _svg("<a href=' javascript:alert(1)'><rect/></a>")),
    "SVG, style sheet": _plan("a.svg", _svg(head="<?xml-stylesheet href='https://example.org/a.css'?>")),
    "SVG, entity of another file": _plan(
        "a.svg", _svg("<text>&x;</text>", head="<!DOCTYPE svg [<!ENTITY x SYSTEM 'file:///etc/passwd'>]>")
    ),
    "SVG, entities that grow": _plan("a.svg", _svg("<text>&i;</text>", head=_LAUGHS)),
    "SVG, size without end": _plan("a.svg", b'<svg viewBox="0 0 inf 1e999"/>'),
    "SVG, unknown encoding": _plan("a.svg", b'<?xml version="1.0" encoding="x-no"?><svg viewBox="0 0 9 9"/>'),
    "PNG, 13,000 x 13,000 pixels": _plan("a.png", _png(13_000, 13_000)),
    "PNG, 2,147,483,647 x 2,147,483,647 pixels": _plan("a.png", _png(2**31 - 1, 2**31 - 1)),
    "PNG, cut off": _plan("a.png", _png(3000, 3000)),
}
