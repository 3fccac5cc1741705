"""A project that fetched the records of a bucket has the files of the store, and prints the same numbers."""

from __future__ import annotations

import io
import shutil
from collections.abc import Callable
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from exchange_world import message
from site_text import site_text
from test_bucket import RefusedError
from test_bucket import Server as WritingServer

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.cluster.bucket import publish
from vsd_analytics.cluster.record_mirror import RECORDS, fetch_records, publish_records
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import StoreError, UsageError
from vsd_analytics.retention.purge import Terms, purge_older
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.build import build

URL = "s3://figures/shop"
START = datetime(2026, 11, 9, 9, tzinfo=UTC)
NOW = "2026-11-20T00:00:00Z"
TERMS = Terms(now=datetime(2026, 11, 20, tzinfo=UTC), is_forced=True)


class ServingBucket(WritingServer):
    """The same server, whose objects can be read."""

    def get_object(self, *, Bucket: str, Key: str) -> dict[str, Any]:
        if Key not in self.objects:
            raise RefusedError("NoSuchKey")
        return {"ETag": self.tag(Key), "Body": io.BytesIO(self.objects[Key])}


Vsd = Callable[..., str]


@pytest.fixture
def vsd(capsys: pytest.CaptureFixture[str]) -> Vsd:
    def call(root: Path, *words: str) -> str:
        code = run(cli, ["-C", str(root), "--now", NOW, *words])
        out, err = capsys.readouterr()
        assert code in (0, 1), err
        return out

    return call


@pytest.fixture
def site(tmp_path: Path, vsd: Vsd) -> Site:
    root = tmp_path / "site"
    root.mkdir()
    (root / "vsd.toml").write_text(site_text())
    lines = [
        message("cam-1", START + timedelta(days=day, seconds=s), [("a", 1000, 1000 + s), ("b", 2000, 1000 + s)])
        for day in range(3)
        for s in range(60)
    ]
    (tmp_path / "f.jsonl").write_text("\n".join(lines))
    vsd(root, "ingest", str(tmp_path / "f.jsonl"))
    return load_site(root, environ={})


@pytest.fixture
def reader(tmp_path: Path, site: Site) -> Site:
    root = tmp_path / "reader"
    root.mkdir()
    shutil.copy(site.root / "vsd.toml", root)
    return load_site(root, environ={})


def numbers(vsd: Vsd, site: Site) -> tuple[str, ...]:
    days = ("--range", "2026-11-09..2026-11-11", "--json")
    query = "select sum(n_frames), count(*) from internal.coverage"
    return (vsd(site.root, "hours", *days), vsd(site.root, "coverage", *days), vsd(site.root, "sql", query, *days[:2]))


def parts(site: Site) -> dict[str, bytes]:
    found = [
        p for top in ("store", "sealed") for p in (site.root / top).rglob("*") if p.suffix in (".parquet", ".json")
    ]
    return {
        str(p.relative_to(site.root)): p.read_bytes() for p in found if p.name not in ("fetched.json", "floors.json")
    }


def test_a_reader_has_the_files_and_the_numbers_of_the_site(site: Site, reader: Site, vsd: Vsd) -> None:
    server = ServingBucket()
    publish_records(site, URL, server)
    assert fetch_records(reader, URL, server)[0] == len(parts(site)) == 6
    assert parts(reader) == parts(site)
    assert numbers(vsd, reader) == numbers(vsd, site)
    assert "180" in numbers(vsd, site)[2], "the frames of three minutes"
    assert fetch_records(reader, URL, server) == (0, 0)


def test_what_was_purged_at_the_site_goes_at_the_reader_and_its_figures_stay(
    site: Site, reader: Site, vsd: Vsd
) -> None:
    server = ServingBucket()
    publish_records(site, URL, server)
    fetch_records(reader, URL, server)
    purge_older(site, before=date(2026, 11, 10), terms=TERMS)
    publish_records(site, URL, server)
    assert fetch_records(reader, URL, server)[1] == 2
    assert parts(reader) == parts(site)
    assert numbers(vsd, reader) == numbers(vsd, site)
    assert len([key for key in server.objects if key.startswith(f"shop/{RECORDS}/")]) == len(parts(site)) + 1


def test_a_fetch_that_stops_anywhere_is_ended_by_the_next(site: Site, reader: Site) -> None:
    server = ServingBucket()
    publish_records(site, URL, server)
    whole = server.objects
    for n in range(1, 8):
        server.objects = {key: b"damaged" if i >= n else data for i, (key, data) in enumerate(sorted(whole.items()))}
        server.objects[f"shop/{RECORDS}/moment.json"] = whole[f"shop/{RECORDS}/moment.json"]
        if n < 6:
            with pytest.raises(StoreError, match="cannot be fetched") as caught:
                fetch_records(reader, URL, server)
            assert caught.value.code == "E319"
    server.objects = whole
    fetch_records(reader, URL, server)
    assert parts(reader) == parts(site)


def test_a_project_with_records_of_its_own_fetches_nothing(site: Site, reader: Site, vsd: Vsd, tmp_path: Path) -> None:
    server = ServingBucket()
    publish_records(site, URL, server)
    fetch_records(reader, URL, server)
    (tmp_path / "own.jsonl").write_text(message("cam-1", START + timedelta(days=5), [("a", 1, 1)]))
    vsd(reader.root, "ingest", str(tmp_path / "own.jsonl"))
    before = parts(reader)
    with pytest.raises(UsageError, match="records of its own"):
        fetch_records(reader, URL, server)
    assert parts(reader) == before


ERASED_MINUTE = ("--camera", "cam-1", "--range", "2026-11-09T10:00..2026-11-09T10:01", "--reason", "request 7")


@pytest.mark.parametrize("are_sealed", [False, True])
def test_a_bucket_does_not_bring_back_what_its_reader_erased(
    site: Site, reader: Site, vsd: Vsd, are_sealed: bool
) -> None:
    """Nor sealed facts of it; once the site has erased it as well, it is fetched from again."""
    hour = ("--range", "2026-11-09T10:00..2026-11-09T11:00", "--force") if are_sealed else ()
    server = ServingBucket()
    publish_records(site, URL, server)
    fetch_records(reader, URL, server)
    vsd(reader.root, "purge", *ERASED_MINUTE, *hour)
    if are_sealed:
        purge_older(site, before=date(2026, 11, 10), terms=TERMS)
        publish_records(site, URL, server)
    erased = parts(reader)
    with pytest.raises(StoreError, match="deleted here on request") as caught:
        fetch_records(reader, URL, server)
    assert caught.value.code == "E322"
    assert parts(reader) == erased
    vsd(site.root, "purge", *ERASED_MINUTE, *hour)
    publish_records(site, URL, server)
    fetch_records(reader, URL, server)
    del erased["store/erasures.json"]
    assert {k: v for k, v in parts(reader).items() if k != "store/erasures.json"} == {
        k: v for k, v in parts(site).items() if k != "store/erasures.json"
    }


@pytest.mark.parametrize(
    "path",
    ["../x.parquet", "/etc/x", "vsd.toml", "store/../../x", "store/frames/../../x", "secrets/2026-11-09.key", "store"],
)
def test_a_bucket_cannot_write_outside_of_records(site: Site, reader: Site, path: str) -> None:
    server = ServingBucket()
    server.objects[f"shop/{RECORDS}/moment.json"] = f'{{"site":"shop","files":{{"{path}":"00"}}}}'.encode()
    with pytest.raises(StoreError, match="cannot be fetched"):
        fetch_records(reader, URL, server)
    assert sorted(p.name for p in reader.root.rglob("*")) == ["vsd.toml"]


def test_facts_published_with_records_spare_them_and_without_remove_them(site: Site) -> None:
    server = ServingBucket()
    publish_records(site, URL, server)
    build(site)
    n = len(server.objects)
    publish({}, URL, server, spared=RECORDS)
    assert len(server.objects) == n + 1
    publish({}, URL, server)
    assert sorted(server.objects) == ["shop/current.json"]
