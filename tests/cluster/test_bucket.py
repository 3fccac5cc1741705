"""A bucket has the facts of one build, whole, wherever a writer stops; and the same bytes as the project."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from vsd_analytics.cluster.bucket import place, publish
from vsd_analytics.errors import StoreError, UsageError

URL = "s3://figures/shop"


class RefusedError(Exception):
    def __init__(self, code: str) -> None:
        super().__init__(code)
        self.response = {"Error": {"Code": code}}


class Server:
    """A server of S3 in memory, with two objects a page, that stops its client before the n-th call that changes it."""

    def __init__(self) -> None:
        self.objects: dict[str, bytes] = {}
        self.stop_at: int | None = None

    def _changes(self) -> None:
        if self.stop_at == 0:
            raise KeyboardInterrupt
        if self.stop_at is not None:
            self.stop_at -= 1

    def tag(self, key: str) -> str:
        return hashlib.md5(self.objects[key]).hexdigest()

    def put_object(
        self, *, Bucket: str, Key: str, Body: bytes, IfNoneMatch: str | None = None, IfMatch: str | None = None
    ) -> None:
        self._changes()
        if (IfNoneMatch and Key in self.objects) or (IfMatch and self.tag(Key) != IfMatch):
            raise RefusedError("PreconditionFailed")
        self.objects[Key] = Body

    def get_object(self, *, Bucket: str, Key: str) -> dict[str, Any]:
        if Key not in self.objects:
            raise RefusedError("NoSuchKey")
        return {"ETag": self.tag(Key), "Body": self.objects[Key]}

    def list_objects_v2(self, *, Bucket: str, Prefix: str, ContinuationToken: str = "") -> dict[str, Any]:
        keys = sorted(k for k in self.objects if k.startswith(Prefix) and k > ContinuationToken)
        page = [{"Key": k} for k in keys[:2]]
        return {"Contents": page, "IsTruncated": len(keys) > 2, "NextContinuationToken": keys[:2][-1] if keys else ""}

    def delete_object(self, *, Bucket: str, Key: str) -> None:
        self._changes()
        self.objects.pop(Key, None)

    def read(self) -> dict[str, bytes] | None:
        """Return what a reader sees: the files that current.json names, by their names; None before the first build."""
        if "shop/current.json" not in self.objects:
            return None
        named = json.loads(self.objects["shop/current.json"])["facts"]
        return {name: self.objects[f"shop/{name}"] for names in named.values() for name in names}


def generation(root: Path, number: int) -> dict[str, list[Path]]:
    """Return the files of three days of two facts; a day of each differs from generation to generation."""
    files: dict[str, list[Path]] = {}
    for fact in ("hours", "pairs"):
        for day in (1, 2, 3):
            version = number if day == 2 else 0
            path = root / "facts" / fact / "site=shop" / f"date=2026-11-0{day}" / f"00-{version:016x}.parquet"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(f"{fact} {day} {version}".encode())
            files.setdefault(fact, []).append(path)
    return files


def seen(files: dict[str, list[Path]]) -> dict[str, bytes]:
    return {
        f"{fact}/{p.parent.name.removeprefix('date=')}-{p.name}": p.read_bytes()
        for fact, of in files.items()
        for p in of
    }


def test_a_writer_stopped_before_any_change_leaves_one_build_whole_and_the_next_one_finishes(tmp_path: Path) -> None:
    old, new = generation(tmp_path, 1), generation(tmp_path, 2)
    n_stops = 0
    for first in (None, old):
        for turn in range(100):
            server = Server()
            if first is not None:
                publish(first, URL, server)
            server.stop_at = turn
            try:
                publish(new, URL, server)
                break
            except KeyboardInterrupt:
                n_stops += 1
            assert server.read() in (None if first is None else seen(first), seen(new))
            server.stop_at = None
            publish(new, URL, server)
            assert server.read() == seen(new)
            assert server.objects.keys() == {f"shop/{name}" for name in seen(new)} | {"shop/current.json"}
    assert n_stops == 7 + (2 + 1 + 2)  # every file, current.json, and what it no longer names


def test_files_that_are_there_are_not_written_again(tmp_path: Path) -> None:
    server = Server()
    assert publish(generation(tmp_path, 1), URL, server) == 6
    assert publish(generation(tmp_path, 2), URL, server) == 2
    assert publish(generation(tmp_path, 2), URL, server) == 0


@pytest.mark.parametrize("has_first", [True, False])
def test_of_two_builds_at_a_time_the_later_one_is_refused(tmp_path: Path, has_first: bool) -> None:
    server = Server()
    if has_first:
        publish(generation(tmp_path, 1), URL, server)
    put, met = server.put_object, []

    def meanwhile(**request: Any) -> None:
        if request["Key"].endswith("current.json") and not met:
            met.append(1)
            publish(generation(tmp_path, 3), URL, server)
        put(**request)

    server.put_object = meanwhile  # type: ignore[method-assign]
    with pytest.raises(StoreError) as caught:
        publish(generation(tmp_path, 2), URL, server)
    assert caught.value.code == "E317"
    assert server.read() == seen(generation(tmp_path, 3))


def test_a_file_that_an_ending_build_removes_meanwhile_is_written_again(tmp_path: Path) -> None:
    class Ending(Server):
        def put_object(self, *, Bucket: str, Key: str, Body: bytes, **condition: Any) -> None:
            if Key.endswith("current.json"):
                self.objects.pop(victim, None)
            super().put_object(Bucket=Bucket, Key=Key, Body=Body, **condition)

    files, s3 = generation(tmp_path, 1), Ending()
    victim = ""
    publish(files, URL, s3)
    victim = next(k for k in s3.objects if not k.endswith("current.json"))
    publish(files, URL, s3)
    named = json.loads(s3.objects["shop/current.json"])["facts"]
    assert all(f"shop/{file}" in s3.objects for of in named.values() for file in of)


def test_a_bucket_that_cannot_be_reached_is_an_error_for_people() -> None:
    exceptions = pytest.importorskip("botocore.exceptions", reason="boto3 is not installed")

    class Away(Server):
        def get_object(self, *, Bucket: str, Key: str) -> dict[str, Any]:
            raise exceptions.EndpointConnectionError(endpoint_url="http://127.0.0.1:9")

    with pytest.raises(StoreError, match="cannot be used") as caught:
        publish({}, URL, Away())
    assert caught.value.code == "E318"
    assert "127.0.0.1:9" in str(caught.value.why)


@pytest.mark.parametrize("url", ["s3://", "s3://bucket", "s3://bucket/", "gs://bucket/shop", "/srv/shop"])
def test_an_address_without_bucket_and_folder_is_refused(url: str) -> None:
    with pytest.raises(UsageError, match="--publish cannot use"):
        place(url)
