"""The current facts in a bucket of an S3-compatible server, for programs on other machines.

```
<prefix>/<fact>/<date>-<hour>-<fingerprint>.parquet    never changed: the name holds the fingerprint of the rows
<prefix>/current.json                                  names the files of one build: replaced whole, by one write
```

A reader reads `current.json` and then the files it names. Files come first, `current.json` after them, and files that
it does not name are removed last: stopped anywhere, a build leaves the old generation or the new one. The write of
`current.json` is conditional on what was read at the beginning, so of two builds at a time one is refused.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from vsd_analytics.errors import StoreError, UsageError
from vsd_analytics.store.published import link_name

CURRENT = "current.json"
_ENVIRONMENT = "check AWS_ENDPOINT_URL, AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and the name of the bucket"
_CONNECT_S = 10
REFUSED = ("PreconditionFailed", "ConditionalRequestConflict", "412", "409")


class Bucket(Protocol):
    """What is needed of a client of S3, such as `boto3.client("s3")`."""

    def put_object(self, **request: Any) -> Any:
        """Write an object whole."""

    def get_object(self, **request: Any) -> Any:
        """Read an object."""

    def list_objects_v2(self, **request: Any) -> Any:
        """List a page of objects."""

    def delete_object(self, **request: Any) -> Any:
        """Remove an object."""


def client(what: str = "--publish") -> Bucket:
    """Return a client with the credentials and the endpoint of the environment (`AWS_...`).

    Args:
        what: What needs it, for messages.

    Raises:
        UsageError: E101, boto3 is not installed, or the environment names no usable endpoint.
    """
    try:
        import boto3
        from botocore.config import Config
    except ImportError as error:
        raise UsageError(f"{what} needs more packages", why=str(error), fix="pip install 'vsd-analytics[s3]'") from None
    try:
        s3: Bucket = boto3.client("s3", config=Config(connect_timeout=_CONNECT_S))
    except Exception as error:
        if not (isinstance(error, ValueError) or is_of_client(error)):
            raise
        raise UsageError(f"{what} cannot use the environment", why=str(error), fix=_ENVIRONMENT) from None
    return s3


def place(url: str) -> tuple[str, str]:
    """Return bucket and prefix of `s3://bucket/prefix`.

    Raises:
        UsageError: E101, it is no such address.
    """
    scheme, _, rest = url.partition("://")
    bucket, _, prefix = rest.partition("/")
    if scheme != "s3" or not bucket or not prefix.strip("/"):
        raise UsageError(f"--publish cannot use {url!r}", fix="--publish s3://BUCKET/FOLDER")
    return bucket, prefix.strip("/")


def publish(files: Mapping[str, Sequence[Path]], url: str, s3: Bucket, *, spared: str | None = None) -> int:
    """Bring a bucket to the current facts; return the number of files written.

    Args:
        files: By fact, its current files (`warehouse.build.current_files`).
        url: `s3://bucket/prefix`.
        s3: The client.
        spared: A folder there whose objects stay; None = none.

    Raises:
        StoreError: E317, another build published meanwhile; E318, the bucket cannot be reached, or refused.
    """
    with refusals(url):
        return _publish(files, url, s3, spared)


def _publish(files: Mapping[str, Sequence[Path]], url: str, s3: Bucket, spared: str | None) -> int:
    bucket, prefix = place(url)
    before = tag(s3, bucket, f"{prefix}/{CURRENT}")
    wanted = {f"{prefix}/{name}/{link_name(path)}": path for name, paths in files.items() for path in paths}
    there = keys(s3, bucket, f"{prefix}/")
    missing = sorted(wanted.keys() - there)
    for key in missing:
        s3.put_object(Bucket=bucket, Key=key, Body=wanted[key].read_bytes())
    relations = {n: sorted(f"{n}/{link_name(p)}" for p in paths) for n, paths in sorted(files.items())}
    text = json.dumps({"version": 1, "facts": relations}, indent=1).encode()
    replace_if_unchanged(s3, bucket, f"{prefix}/{CURRENT}", text, before=before, url=url)
    # another build that ended just before may have removed what is wanted here after the list of what is there was read
    for key in sorted(wanted.keys() - keys(s3, bucket, f"{prefix}/")):
        s3.put_object(Bucket=bucket, Key=key, Body=wanted[key].read_bytes())
    for key in sorted(there - wanted.keys() - {f"{prefix}/{CURRENT}"}):
        if spared is not None and key.startswith(f"{prefix}/{spared}/"):
            continue
        s3.delete_object(Bucket=bucket, Key=key)
    return len(missing)


def replace_if_unchanged(s3: Bucket, bucket: str, key: str, text: bytes, *, before: str | None, url: str) -> None:
    """Write an object if it is still the version that was read before, or still absent.

    Raises:
        StoreError: E317, somebody else wrote it meanwhile.
    """
    condition = {"IfNoneMatch": "*"} if before is None else {"IfMatch": before}
    try:
        s3.put_object(Bucket=bucket, Key=key, Body=text, **condition)
    except Exception as error:
        if code_of(error) not in REFUSED:
            raise
        raise StoreError(
            f"another build published to {url} meanwhile",
            code="E317",
            why="its facts are current there, these are not",
            fix="run the same command again",
        ) from None


@contextlib.contextmanager
def refusals(url: str) -> Iterator[None]:
    """Turn what the client of S3 raises into an error for people."""
    try:
        yield
    except Exception as error:
        if not is_of_client(error):
            raise
        raise StoreError(
            f"{url} cannot be used",
            code="E318",
            why=str(error)[:300],
            fix=f"{_ENVIRONMENT}; then run the same command again",
        ) from None


def is_of_client(error: Exception) -> bool:
    """Tell whether the client of S3 raised an error: no answer, no credentials, or a refusal."""
    modules = {cls.__module__.partition(".")[0] for cls in type(error).__mro__}
    return bool(modules & {"botocore", "boto3", "s3transfer"})


def keys(s3: Bucket, bucket: str, prefix: str) -> set[str]:
    """Return the keys that begin with a prefix."""
    names, more = set[str](), dict[str, str]()
    while True:
        page = s3.list_objects_v2(Bucket=bucket, Prefix=prefix, **more)
        names |= {entry["Key"] for entry in page.get("Contents", ())}
        if not page.get("IsTruncated"):
            return names
        more = {"ContinuationToken": page["NextContinuationToken"]}


def tag(s3: Bucket, bucket: str, key: str) -> str | None:
    """Return the tag of an object's version; None where there is none."""
    try:
        return str(s3.get_object(Bucket=bucket, Key=key)["ETag"])
    except Exception as error:
        if code_of(error) in ("NoSuchKey", "404"):
            return None
        raise


def content(s3: Bucket, bucket: str, key: str, *, most: int | None = None) -> bytes | None:
    """Return the bytes of an object; None where there is none.

    Args:
        s3: The client.
        bucket: Name of the bucket.
        key: Key of the object.
        most: Bytes that it should have at most: one more is read, and the rest is left; None = all.
    """
    try:
        body = s3.get_object(Bucket=bucket, Key=key)["Body"]
        return bytes(body.read() if most is None else body.read(most + 1))
    except Exception as error:
        if code_of(error) in ("NoSuchKey", "404"):
            return None
        raise


def code_of(error: Exception) -> str:
    """Return the code of an error of boto3; "" of another one."""
    answer = getattr(error, "response", None)
    return str(answer.get("Error", {}).get("Code", "")) if isinstance(answer, dict) else ""
