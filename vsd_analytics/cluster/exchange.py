"""The place between nodes and the store of their site: a folder that all of them see, or a bucket.

```
<place>/site.json                                   written by the site: its id, and the days that are forgotten
<place>/nodes/<node>/node.json                      written by the node: when it was here, and what waits there
<place>/nodes/<node>/<table>/<file>.parquet         written by the node, removed by the site
<place>/nodes/<node>/imports/<file>.jsonl           likewise: lines of the node's list of imports
<place>/receipts/<node>/<digest>-<stamp>            written by the site when it has it, removed by the node
```

The name of a file has the hash of its bytes, its stamp and its signature (`cluster.signatures`), so a copy under that
name is the same however often it is sent. Receipts and both notices are signed too. Nothing is read beyond a bound.
Each appears whole: by a rename in a folder, by one conditional write in a bucket.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from datetime import date, datetime
from pathlib import Path
from typing import Protocol

import msgspec

from vsd_analytics.cluster import bucket
from vsd_analytics.errors import DiskError, StoreError, VsdError
from vsd_analytics.site.model import Site
from vsd_analytics.site.routes import ExchangeRoute
from vsd_analytics.store import durable
from vsd_analytics.store.secrets import ClosedDays

SITE = "site.json"
NODES = "nodes"
RECEIPTS = "receipts"
ABOUT_NODE = "node.json"
NOTICE_MAX_BYTES = 1 << 20
"""Longest notice that is read: the days that a site forgot in seventy years take a third."""


class SiteNotice(msgspec.Struct, frozen=True, omit_defaults=True):
    """What the site says to its nodes (`site.json`).

    Attributes:
        site: Id of the site.
        days: Site days whose keys were destroyed.
        before: See `ClosedDays`.
        held: See `ClosedDays`.
        mark: Mark of the site's secret (`DayChain.mark`); "" = it has none.
        signature: `Signer.signed`; "" = the site has no secret, or is of version 1.1.
    """

    site: str
    days: tuple[date, ...] = ()
    before: date | None = None
    held: tuple[date, ...] = ()
    mark: str = ""
    signature: str = ""

    def closed(self) -> ClosedDays:
        """Return the days that get no key."""
        return ClosedDays(frozenset(self.days), self.before, frozenset(self.held))


class NodeNotice(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a node says to the site (`node.json`).

    Attributes:
        node: Its name.
        at: When it was here last (UTC).
        n_waiting: Files that it holds because it has no receipt for them.
        version: Version of this program there.
        signature: `Signer.signed`; "" = the node is of version 1.1.
    """

    node: str
    at: datetime
    n_waiting: int
    version: str
    signature: str = ""


class Exchange(Protocol):
    """A flat set of named files; names have slashes and begin below the place."""

    def names(self, prefix: str) -> list[str]:
        """Return the names that begin with a prefix which ends in a slash, in order."""

    def read(self, name: str, *, most: int) -> bytes | None:
        """Return the bytes of a file, at most one more than `most`; None where there is none."""

    def add(self, name: str, data: bytes) -> None:
        """Write a file whole and durably, unless one of that name is there."""

    def replace(self, name: str, data: bytes) -> None:
        """Write a file whole and durably, also over one of that name."""

    def remove(self, name: str) -> None:
        """Remove a file; it may be gone."""


class FolderExchange:
    """A folder that all machines see, or that a program such as rsync makes equal on them.

    Args:
        root: The folder. It must exist, so that a disk that is not mounted is noticed.
    """

    def __init__(self, root: Path) -> None:
        self.root = root

    def names(self, prefix: str) -> list[str]:
        """Return the names below a folder, without temporary files."""
        self._refuse_absent()
        paths = (p for p in (self.root / prefix).rglob("*") if not p.name.startswith(".") and p.is_file())
        return sorted(str(p.relative_to(self.root)) for p in paths)

    def read(self, name: str, *, most: int) -> bytes | None:
        """Return the bytes of a file, at most one more than `most`; None where there is none."""
        self._refuse_absent()
        try:
            with (self.root / name).open("rb") as file:
                return file.read(most + 1)
        except FileNotFoundError:
            return None

    def add(self, name: str, data: bytes) -> None:
        """Write a file by a rename, unless one of that name is there."""
        if not (self.root / name).exists():
            self.replace(name, data)

    def replace(self, name: str, data: bytes) -> None:
        """Write a file by a rename."""
        self._refuse_absent()
        path = self.root / name
        if path.parent.is_dir():
            durable.sweep_temporaries(path.parent, file_name=path.name)
        durable.publish(path, data)

    def remove(self, name: str) -> None:
        """Remove a file; it may be gone."""
        durable.remove(self.root / name)

    def _refuse_absent(self) -> None:
        if not self.root.is_dir():
            raise unusable(str(self.root), "there is no such folder; a disk may not be mounted")


class BucketExchange:
    """A folder of a bucket of an S3-compatible server.

    Args:
        url: `s3://BUCKET/FOLDER`.
        s3: The client.
    """

    def __init__(self, url: str, s3: bucket.Bucket) -> None:
        self._url, self._s3 = url, s3
        self._bucket, self._prefix = bucket.place(url)

    def names(self, prefix: str) -> list[str]:
        """Return the names that begin with a prefix."""
        with self._refusals():
            keys = bucket.keys(self._s3, self._bucket, self._key(prefix))
        return sorted(key.removeprefix(f"{self._prefix}/") for key in keys)

    def read(self, name: str, *, most: int) -> bytes | None:
        """Return the bytes of an object, at most one more than `most`; None where there is none."""
        with self._refusals():
            return bucket.content(self._s3, self._bucket, self._key(name), most=most)

    def add(self, name: str, data: bytes) -> None:
        """Write an object by one conditional write: of two writers at a time the first one wins."""
        with self._refusals():
            try:
                self._s3.put_object(Bucket=self._bucket, Key=self._key(name), Body=data, IfNoneMatch="*")
            except Exception as error:
                if bucket.code_of(error) not in bucket.REFUSED:
                    raise

    def replace(self, name: str, data: bytes) -> None:
        """Write an object whole."""
        with self._refusals():
            self._s3.put_object(Bucket=self._bucket, Key=self._key(name), Body=data)

    def remove(self, name: str) -> None:
        """Remove an object; it may be gone."""
        with self._refusals():
            self._s3.delete_object(Bucket=self._bucket, Key=self._key(name))

    def _key(self, name: str) -> str:
        return f"{self._prefix}/{name}"

    @contextlib.contextmanager
    def _refusals(self) -> Iterator[None]:
        """Turn what the client of S3 raises into an error for people."""
        try:
            yield
        except Exception as error:
            if not bucket.is_of_client(error):
                raise
            raise unusable(self._url, str(error)[:300]) from None


def exchange_of(route: ExchangeRoute) -> Exchange:
    """Return the place that `[exchange]` names.

    Raises:
        UsageError: E101, it is a bucket and boto3 is not installed.
    """
    if route.place.startswith("s3://"):
        return BucketExchange(route.place, bucket.client("[exchange]"))
    return FolderExchange(Path(route.place))


def site_notice(exchange: Exchange, site: Site) -> SiteNotice | None:
    """Return what a site says at a place; None before it said anything.

    Raises:
        StoreError: E319, the place is that of another site, or cannot be read.
    """
    data = exchange.read(SITE, most=NOTICE_MAX_BYTES)
    if data is None:
        return None
    place = "" if site.exchange is None else site.exchange.place
    try:
        notice = msgspec.json.decode(data, type=SiteNotice)
    except (msgspec.DecodeError, UnicodeDecodeError):
        raise unusable(place, f"{SITE} there is damaged; vsd node receive writes it again") from None
    if notice.site != site.site_id:
        raise unusable(place, f"it is that of site {notice.site!r}, and vsd.toml describes {site.site_id!r}")
    return notice


def unusable(place: str, why: str) -> StoreError:
    """Return the error of an exchange that cannot be used now."""
    return StoreError(
        f"the exchange {place} cannot be used",
        code="E319",
        why=why,
        fix="check place under [exchange] in vsd.toml, the mount or the network, then: vsd doctor; nothing is lost",
    )


@contextlib.contextmanager
def reaching(place: str) -> Iterator[None]:
    """Turn what a file system says of a place into an error for people (E319; E304 to E306 of a disk stay)."""
    try:
        yield
    except (VsdError, DiskError):
        raise
    except OSError as error:
        raise unusable(place, error.strerror or str(error)) from None
