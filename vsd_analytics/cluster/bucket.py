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

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from vsd_analytics.errors import StoreError, UsageError
from vsd_analytics.store.published import link_name

CURRENT = "current.json"
_REFUSED = ("PreconditionFailed", "ConditionalRequestConflict", "412", "409")


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


def client() -> Bucket:
    """Return a client with the credentials and the endpoint of the environment (`AWS_...`).

    Raises:
        UsageError: E101, boto3 is not installed.
    """
    try:
        import boto3
    except ImportError as error:
        raise UsageError(
            "--publish needs more packages", why=str(error), fix="pip install 'vsd-analytics[s3]'"
        ) from None
    made: Bucket = boto3.client("s3")
    return made


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


def publish(project: Path, files: Mapping[str, Sequence[Path]], url: str, s3: Bucket) -> int:
    """Bring a bucket to the current facts; return the number of files written.

    Args:
        project: The project folder.
        files: By fact, its current files (`warehouse.build.current_files`).
        url: `s3://bucket/prefix`.
        s3: The client.

    Raises:
        StoreError: E317, another build published meanwhile.
    """
    bucket, prefix = place(url)
    before = _tag(s3, bucket, f"{prefix}/{CURRENT}")
    wanted = {f"{prefix}/{name}/{link_name(path)}": path for name, of in files.items() for path in of}
    there = _keys(s3, bucket, f"{prefix}/")
    missing = sorted(wanted.keys() - there)
    for key in missing:
        s3.put_object(Bucket=bucket, Key=key, Body=wanted[key].read_bytes())
    relations = {n: sorted(f"{n}/{link_name(p)}" for p in of) for n, of in sorted(files.items())}
    text = json.dumps({"version": 1, "facts": relations}, indent=1).encode()
    condition = {"IfNoneMatch": "*"} if before is None else {"IfMatch": before}
    try:
        s3.put_object(Bucket=bucket, Key=f"{prefix}/{CURRENT}", Body=text, **condition)
    except Exception as error:
        if _code(error) not in _REFUSED:
            raise
        raise StoreError(
            f"another build published to {url} meanwhile",
            code="E317",
            why="its facts are current there, these are not",
            fix="run the same command again",
        ) from None
    for key in sorted(there - wanted.keys() - {f"{prefix}/{CURRENT}"}):
        s3.delete_object(Bucket=bucket, Key=key)
    return len(missing)


def _keys(s3: Bucket, bucket: str, prefix: str) -> set[str]:
    found, more = set[str](), dict[str, str]()
    while True:
        page = s3.list_objects_v2(Bucket=bucket, Prefix=prefix, **more)
        found |= {entry["Key"] for entry in page.get("Contents", ())}
        if not page.get("IsTruncated"):
            return found
        more = {"ContinuationToken": page["NextContinuationToken"]}


def _tag(s3: Bucket, bucket: str, key: str) -> str | None:
    """Return the tag of an object's version; None where there is none."""
    try:
        return str(s3.get_object(Bucket=bucket, Key=key)["ETag"])
    except Exception as error:
        if _code(error) in ("NoSuchKey", "404"):
            return None
        raise


def _code(error: Exception) -> str:
    """Return the code of an error of boto3; "" of another one."""
    answer = getattr(error, "response", None)
    return str(answer.get("Error", {}).get("Code", "")) if isinstance(answer, dict) else ""
