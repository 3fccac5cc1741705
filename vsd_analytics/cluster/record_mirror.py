"""The records of a store in a bucket, for projects on other machines that only read.

```
<prefix>/records/<digest>         the bytes of one file of store/ or sealed/: never changed
<prefix>/records/moment.json      names the files of one moment: replaced whole, by one write
```

Parts are immutable and named by their hash, so a reader fetches only those it lacks, compares each with its hash, and
then has the very files of the store. Every command works on them, with the same totals.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping
from datetime import datetime
from pathlib import Path, PurePosixPath

import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.cluster import bucket
from vsd_analytics.errors import StoreError, UsageError, Where
from vsd_analytics.schema import TABLES
from vsd_analytics.site.model import Site
from vsd_analytics.store import durable
from vsd_analytics.store.erasures import Erasure, are_erased, erasures
from vsd_analytics.store.layout import HOUR_MS, segment_paths
from vsd_analytics.store.removal import reading, removing
from vsd_analytics.store.repeats import AGAIN
from vsd_analytics.store.seals import FOLDER as SEALED
from vsd_analytics.store.seals import seal_in

RECORDS = "records"
LIST = f"{RECORDS}/moment.json"
FETCHED = "fetched.json"
"""In the store of a reader: which files it fetched."""
_PART_HOUR = re.compile(r"/date=(?P<day>\d{4}-\d{2}-\d{2})/(?P<hour>\d{2})-")
_TOPS = (*((("store", table)) for table in TABLES), ("store", AGAIN), (SEALED,))


class Moment(msgspec.Struct, frozen=True):
    """The files of a store at one moment.

    Attributes:
        site: Id of the site.
        files: Digest of each file, by its path below the project.
    """

    site: str
    files: dict[str, str]


def publish_records(site: Site, url: str, s3: bucket.Bucket) -> int:
    """Bring a bucket to the records and sealed facts of a store; return the number of files written.

    Args:
        site: The project; its spool is folded already.
        url: `s3://bucket/prefix`.
        s3: The client.

    Raises:
        StoreError: E317, somebody else published meanwhile; E318, the bucket cannot be reached, or refused.
    """
    name, prefix = bucket.place(url)
    with reading(site.root / "store"), bucket.refusals(url):
        before = bucket.tag(s3, name, f"{prefix}/{LIST}")
        files = {path: durable.file_digest(site.root / path) for path in _here(site.root)}
        content = {f"{prefix}/{RECORDS}/{digest}": site.root / path for path, digest in files.items()}
        there = bucket.keys(s3, name, f"{prefix}/{RECORDS}/")
        missing = sorted(content.keys() - there)
        for key in missing:
            s3.put_object(Bucket=name, Key=key, Body=content[key].read_bytes())
        text = msgspec.json.encode(Moment(site.site_id, files))
        bucket.replace_if_unchanged(s3, name, f"{prefix}/{LIST}", text, before=before, url=url)
        for key in sorted(there - content.keys() - {f"{prefix}/{LIST}"}):
            s3.delete_object(Bucket=name, Key=key)
    return len(missing)


def fetch_records(site: Site, url: str, s3: bucket.Bucket) -> tuple[int, int]:
    """Bring a project that only reads to the records of a bucket; return the numbers of files fetched and removed.

    New files come first and old ones go last. Where a newer moment was published meanwhile, a file may be gone: then
    nothing was removed here, and the next call goes on.

    Args:
        site: The project that reads; its store holds nothing, or what it fetched before.
        url: `s3://bucket/prefix`.
        s3: The client.

    Raises:
        UsageError: E101, the project has records of its own.
        StoreError: E322, records in the bucket were erased here on request.
        StoreError: E318, the bucket cannot be read; E319, it is that of another site or is not whole.
    """
    name, prefix = bucket.place(url)
    with bucket.refusals(url):
        moment = _moment(bucket.content(s3, name, f"{prefix}/{LIST}"), site, url)
        _refuse_erased(site, moment, s3, url)
        own_records = _refuse_own_records(site, moment)
        lacking = {path: digest for path, digest in moment.files.items() if own_records.get(path) != digest}
        _note(site, {**own_records, **moment.files})  # first, so that what a stop leaves is known as fetched
        for path, digest in sorted(lacking.items(), key=lambda item: (item[0].endswith(".json"), item[0])):
            data = bucket.content(s3, name, f"{prefix}/{RECORDS}/{digest}")
            if data is None or durable.digest(data) != digest:
                raise _not_whole(url, "a file is gone or damaged: a newer moment may be there")
            durable.publish(site.root / path, data)
    gone = sorted(own_records.keys() - moment.files.keys())
    if gone:
        with removing(site.root / "store"):
            for path in gone:
                durable.remove(site.root / path)
            for folder in sorted({(site.root / path).parent for path in gone}):
                durable.fsync_dir(folder)
    _note(site, moment.files)
    return len(lacking), len(gone)


def _here(root: Path) -> list[str]:
    """Return the files of records and sealed facts below a project, as paths with slashes."""
    paths = (p for top in _TOPS for p in root.joinpath(*top).rglob("*") if p.is_file() and not p.name.startswith("."))
    return sorted(p.relative_to(root).as_posix() for p in paths)


def _moment(data: bytes | None, site: Site, url: str) -> Moment:
    if data is None:
        raise _not_whole(url, "no records are published there; at the site: vsd build --publish URL --records")
    try:
        moment = msgspec.json.decode(data, type=Moment)
    except (msgspec.DecodeError, UnicodeDecodeError):
        raise _not_whole(url, f"{LIST} there is damaged") from None
    if moment.site != site.site_id:
        raise _not_whole(url, f"it holds site {moment.site!r}, and vsd.toml describes {site.site_id!r}")
    if odd := [path for path in moment.files if not _is_inside(path)]:
        raise _not_whole(url, f"it names a file that is no part of a store: {odd[0][:80]!r}")
    return moment


def _is_inside(path: str) -> bool:
    parts = PurePosixPath(path).parts
    is_plain = path == "/".join(parts) and not any(p in ("..", ".", "/") or p.startswith(".") for p in parts)
    return is_plain and any(parts[: len(top)] == top and len(parts) > len(top) for top in _TOPS)


def _refuse_own_records(site: Site, moment: Moment) -> Mapping[str, str]:
    """Return the files that were fetched before and are here; refuse a project that has others.

    A file of the moment is none of its own: the same purge at the site and here leaves the same files.
    """
    path = site.root / "store" / FETCHED
    try:
        noted = msgspec.json.decode(path.read_bytes(), type=dict[str, str])
    except (FileNotFoundError, msgspec.DecodeError, UnicodeDecodeError):
        noted = {}
    here = {name: durable.file_digest(site.root / name) for name in _here(site.root)}
    spooled = [p for table in TABLES for p in segment_paths(site.root / "store", table)]
    if spooled or any(name not in noted and moment.files.get(name) != digest for name, digest in here.items()):
        raise UsageError(
            "this project has records of its own",
            where=Where(str(site.root / "store")),
            why="fetching makes its records those of the bucket",
            fix="fetch into a new folder with a copy of vsd.toml",
        )
    return {name: digest for name, digest in here.items() if digest in (noted.get(name), moment.files.get(name))}


def _refuse_erased(site: Site, moment: Moment, s3: bucket.Bucket, url: str) -> None:
    """Raise StoreError E322 where a bucket holds records, or sealed facts of them, that were erased in this project.

    Looks before anything is fetched, into parts and seals of the times of the erasures alone.
    """
    erased = erasures(site.root / "store")
    name, prefix = bucket.place(url)
    for path, digest in moment.files.items():
        if not any(_may_hold(path, erasure) for erasure in erased):
            continue
        data = bucket.content(s3, name, f"{prefix}/{RECORDS}/{digest}")
        if data is None or durable.digest(data) != digest:
            raise _not_whole(url, "a file is gone or damaged: a newer moment may be there")
        if _holds_erased(path, data, erased):
            raise StoreError(
                f"the records in {url} hold some that were deleted here on request",
                code="E322",
                where=Where(path),
                why="fetched, they would be here again",
                fix="at the site: vsd purge with the same --camera, --range and --reason, then vsd build --publish "
                f"{url} --records; or here, if the erasure was a mistake: vsd purge with them and --lift",
            )


def _may_hold(path: str, erasure: Erasure) -> bool:
    """Tell whether a file is a part or a seal of a time that an erasure touches."""
    which = erasure.which
    if part := _PART_HOUR.search(path):
        first = datetime.fromisoformat(f"{part['day']}T{part['hour']}:00:00+00:00").timestamp() * 1000
        return path.startswith("store/") and first < which.after_ms and which.first_ms < first + HOUR_MS
    return path.startswith("sealed/") and path.endswith(".json")


def _holds_erased(path: str, data: bytes, erased: Collection[Erasure]) -> bool:
    if path.startswith("store/"):
        return bool(are_erased(pq.read_table(pa.BufferReader(data), columns=["camera_id", "ts"]), erased).true_count)
    seal = seal_in(data)
    return seal is not None and any(
        unit.last_ms and which.camera_id in (None, *unit.last_ms)
        for hour, unit in seal.hours.items()
        for which in (erasure.which for erasure in erased)
        if which.first_ms < (hour + 1) * HOUR_MS and hour * HOUR_MS < which.after_ms
    )


def _note(site: Site, files: Mapping[str, str]) -> None:
    durable.publish(site.root / "store" / FETCHED, json.dumps(dict(sorted(files.items()))).encode())


def _not_whole(url: str, why: str) -> StoreError:
    return StoreError(f"the records in {url} cannot be fetched", code="E319", why=why, fix="run the same command again")
