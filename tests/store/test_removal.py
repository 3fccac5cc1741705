"""Records taken out of a store: exactly those, whatever happens on the way, and as if they had never come."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stored_rows import HOUR, NINE, frame, litter_of, pair, part_names, person, stored, table

from vsd_analytics.errors import StoreError
from vsd_analytics.store import durable
from vsd_analytics.store.erasures import RecordScope, rows_in_scope
from vsd_analytics.store.removal import (
    AUDIT,
    LOCK,
    Intent,
    complete,
    pending,
    reading,
    remove_records,
    removing,
)
from vsd_analytics.store.store import Store

CAMERAS = ("cam-1", "cam-2")


class Crash(BaseException):
    """The process ended here."""


def fill(project: Path, rows: list[dict[str, Any]]) -> Store:
    store = Store(project / "store", site_id="shop")
    store.append("observations", table("observations", rows))
    store.append(
        "frames", table("frames", [frame(ts, camera=c) for ts, c in {(r["ts"], r["camera_id"]) for r in rows}])
    )
    store.fold()
    return store


def two_cameras() -> list[dict[str, Any]]:
    return [person(NINE + h * HOUR + 1000 * k, f"t{k}", camera=c) for c in CAMERAS for h in range(3) for k in range(10)]


def purge(store: Store, which: RecordScope) -> None:
    """Remove as `retention.purge_range` does, without its facts."""
    with removing(store.root):
        rewrite = {}
        for name in ("frames", "observations", "pairs"):
            parts = store.parts(name)
            hit = [str(p.path.relative_to(store.root.parent)) for p in parts if rows_in_scope(p.path, which)]
            if hit:
                rewrite[name] = tuple(hit)
        if rewrite:
            remove_records(store.root, Intent(site_id="shop", entry={"why": "test"}, which=which, rewrite=rewrite))


def contents(project: Path) -> dict[str, list[str]]:
    return {name: sorted(map(str, rows)) for name, rows in stored(project / "store").items()}


def meant(row: dict[str, Any], which: RecordScope) -> bool:
    ms = round(row["ts"].timestamp() * 1000)
    return which.camera_id in (None, row["camera_id"]) and which.first_ms <= ms < which.after_ms


row_sets = st.lists(
    st.tuples(st.sampled_from(CAMERAS), st.integers(0, 3 * HOUR - 1), st.sampled_from("abc")), min_size=1, max_size=40
)


@settings(max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rows=row_sets, camera=st.sampled_from([None, *CAMERAS]), edges=st.tuples(*[st.integers(0, 3 * HOUR)] * 2))
def test_exactly_what_is_meant_goes_and_comes_back(
    tmp_path_factory: pytest.TempPathFactory, rows: list[Any], camera: str | None, edges: tuple[int, int]
) -> None:
    project = tmp_path_factory.mktemp("p")
    people = [person(NINE + at, track, camera=c) for c, at, track in rows]
    which = RecordScope(camera, NINE + min(edges), NINE + max(edges))
    store = fill(project, people)
    before = contents(project)
    expected = {n: sorted(str(r) for r in found if not meant(r, which)) for n, found in stored(store.root).items()}
    purge(store, which)
    assert contents(project) == expected
    assert store.damaged() == []
    fill(project, people)
    assert contents(project) == before


def test_a_part_without_survivors_and_its_empty_folder_are_gone(tmp_path: Path) -> None:
    store = fill(tmp_path, [person()])
    purge(store, RecordScope("cam-1", NINE, NINE + 1))
    assert part_names(store.root) == []
    assert list((store.root / "observations" / "site=shop").iterdir()) == []


def test_records_of_other_cameras_and_the_engines_of_a_part_stay(tmp_path: Path) -> None:
    store = Store(tmp_path / "store", site_id="shop")
    rows = [person(camera="cam-1"), person(camera="cam-2")]
    store.append("observations", table("observations", rows), engines=["acme 2.1"])
    store.append("pairs", table("pairs", [pair()]))
    store.fold()
    purge(store, RecordScope("cam-1", NINE, NINE + 1))
    from vsd_analytics.store.part_files import engines_of

    (left,) = store.parts("observations")
    assert engines_of(left.path) == ["acme 2.1"]
    assert [r["camera_id"] for r in stored(store.root)["observations"]] == ["cam-2"]
    assert stored(store.root)["pairs"] == []


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    project = tmp_path_factory.mktemp("prepared")
    fill(project, two_cameras())
    return project


WHICH = RecordScope("cam-1", NINE + 5000, NINE + 2 * HOUR + 5000)


@pytest.fixture(scope="module")
def unharmed(prepared: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, list[str]], list[str], bytes]:
    project = tmp_path_factory.mktemp("unharmed") / "p"
    shutil.copytree(prepared, project)
    purge(Store(project / "store", site_id="shop"), WHICH)
    return contents(project), part_names(project / "store"), (project / AUDIT).read_bytes()


def crash_at(monkeypatch: pytest.MonkeyPatch, point: int) -> None:
    """End the process just before the `point`th publish, unlink or folder sync; a publish leaves half a file."""
    left = [point]

    def dying(real: Callable[..., Any], is_publish: bool) -> Callable[..., Any]:
        def call(path: Path, *arguments: Any, **options: Any) -> Any:
            left[0] -= 1
            if left[0] == -1:
                if is_publish and path.parent.is_dir():
                    (path.parent / f".{path.name}.4194999.tmp").write_bytes(b"half")
                raise Crash
            return real(path, *arguments, **options)

        return call

    for name in ("publish", "remove", "fsync_dir"):
        monkeypatch.setattr(durable, name, dying(getattr(durable, name), name == "publish"))


def every_point(prepared: Path, folder: Path) -> int:
    """Return how many points a removal has."""
    with pytest.MonkeyPatch.context() as patched:
        calls = [0]
        for name in ("publish", "remove", "fsync_dir"):
            real = getattr(durable, name)

            def counted(*a: Any, real: Any = real, **o: Any) -> Any:
                calls[0] += 1
                return real(*a, **o)

            patched.setattr(durable, name, counted)
        shutil.copytree(prepared, folder)
        purge(Store(folder / "store", site_id="shop"), WHICH)
    return calls[0]


def test_a_crash_at_any_point_and_whoever_comes_next_end_the_same(
    prepared: Path, unharmed: tuple[dict[str, list[str]], list[str], bytes], tmp_path: Path
) -> None:
    n_points = every_point(prepared, tmp_path / "counted")
    assert n_points >= 20
    for point in range(n_points):
        project = tmp_path / str(point)
        shutil.copytree(prepared, project)
        store = Store(project / "store", site_id="shop")
        with pytest.MonkeyPatch.context() as patched:
            crash_at(patched, point)
            with pytest.raises(Crash):
                purge(store, WHICH)
        comes_next: tuple[Callable[[Store], Any], ...] = (Store.fold, look, lambda s: complete(s.root))
        was_promised = bool(pending(store.root))
        comes_next[point % 3](store)
        if was_promised:
            assert contents(project) == unharmed[0], point
        purge(store, WHICH)  # the same command again
        store.fold()
        assert contents(project) == unharmed[0], point
        assert part_names(store.root) == unharmed[1], point
        assert (project / AUDIT).read_bytes() == unharmed[2], point
        assert litter_of(project) == [], point


def look(store: Store) -> None:
    with reading(store.root):
        pass


def test_an_audit_line_cut_off_by_a_crash_is_written_whole(tmp_path: Path) -> None:
    store = fill(tmp_path, two_cameras())
    (tmp_path / AUDIT).write_bytes(b'{"id":"0","why":"earlier"}\n{"id":"5')
    purge(store, WHICH)
    lines = (tmp_path / AUDIT).read_text().splitlines()
    assert len(lines) == 2
    assert lines[0] == '{"id":"0","why":"earlier"}'
    assert '"why":"test"' in lines[1]
    assert (tmp_path / AUDIT).stat().st_mode & 0o777 == 0o600


def test_rows_that_came_after_the_promise_are_not_taken(prepared: Path, tmp_path: Path) -> None:
    """The wrong ingest is purged, the machine stops, the right one is ingested: its records stay."""
    shutil.copytree(prepared, tmp_path / "p")
    store = Store(tmp_path / "p" / "store", site_id="shop")
    with pytest.MonkeyPatch.context() as patched:
        crash_at(patched, 4)
        with pytest.raises(Crash):
            purge(store, WHICH)
    assert pending(store.root)
    right = person(NINE + 6000, "right", camera="cam-1")
    store.append("observations", table("observations", [right]))
    store.fold()
    assert [r["track_id"] for r in stored(store.root)["observations"] if meant(r, WHICH)] == ["right"]


def test_a_damaged_intent_is_refused(tmp_path: Path) -> None:
    store = fill(tmp_path, [person()])
    (store.root / "purge").mkdir()
    (store.root / "purge" / "0123456789abcdef.json").write_bytes(b"{}")
    with pytest.raises(StoreError) as caught:
        store.fold()
    assert caught.value.code == "E302"


PART = "store/observations/site=shop/date=2026-11-09/09-0123456789abcdef.parquet"
EVERY = {"camera_id": None, "first_ms": 0, "after_ms": 1}


@pytest.mark.parametrize(
    "said",
    [
        {"unlink": ["../victim"]},
        {"unlink": ["store/../../victim"]},
        {"unlink": ["/tmp/victim"]},
        {"unlink": ["vsd.toml"]},
        {"unlink": ["store/observations/site=../date=2026-11-09/09-0123456789abcdef.parquet"]},
        {"unlink": [PART + "\n"]},
        {"unlink": ["sealed/camera_hours/site=shop/date=2026-11-09/09-0123456789abcdef.parquet"]},
        {"which": EVERY, "rewrite": {"observations": ["../victim"]}},
        {"which": {**EVERY, "after_ms": 2**60}, "rewrite": {"observations": [PART]}},
        {"which": EVERY, "rewrite": {"victims": [PART]}},
        {"which": EVERY, "unseal": [10**12]},
        {"site_id": "../../victim"},
        {"forget": ["2026-99-99"]},
        {"forget": ["../victim"]},
        {"quarantined": ["x"]},
        {"entry": "DEEP"},
    ],
)
def test_an_intent_that_no_purge_writes_is_refused_and_removes_nothing(tmp_path: Path, said: dict[str, Any]) -> None:
    """Such as one that came with a project somebody else made; its hash is right."""
    victim = tmp_path / "victim"
    victim.write_text("precious")
    store = fill(tmp_path / "p", [person()])
    data = json.dumps({"site_id": "shop", "entry": {}, **said}).encode()
    data = data.replace(b'"DEEP"', b'{"a":' * 100_000 + b"1" + b"}" * 100_000)
    durable.publish(store.root / "purge" / f"{durable.digest(data)}.json", data)
    before = contents(tmp_path / "p")
    with pytest.raises(StoreError) as caught:
        store.fold()
    assert caught.value.code == "E302"
    assert victim.read_text() == "precious"
    assert contents(tmp_path / "p") == before


def test_an_intent_does_not_follow_a_link_out_of_the_store(tmp_path: Path) -> None:
    store = fill(tmp_path / "p", [person()])
    elsewhere = tmp_path / "elsewhere" / Path(PART).name
    elsewhere.parent.mkdir()
    elsewhere.write_text("precious")
    (store.root / "pairs" / "site=shop").mkdir(parents=True)
    (store.root / "pairs" / "site=shop" / "date=2026-11-09").symlink_to(elsewhere.parent)
    intent = Intent(site_id="shop", entry={}, unlink=(PART.replace("observations", "pairs"),))
    with removing(store.root), pytest.raises(StoreError) as caught:
        remove_records(store.root, intent)
    assert "is a link" in str(caught.value.why)
    assert elsewhere.read_text() == "precious"


def test_a_store_that_is_a_link_itself_is_purged(tmp_path: Path) -> None:
    fill(tmp_path / "disk", [person()])
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "store").symlink_to(tmp_path / "disk" / "store")
    purge(Store(tmp_path / "p" / "store", site_id="shop"), RecordScope("cam-1", NINE, NINE + 1))
    assert contents(tmp_path / "disk")["observations"] == []


def test_a_removal_waits_for_readers_and_gives_up_in_time(tmp_path: Path) -> None:
    store = fill(tmp_path, [person()])
    told: list[str] = []
    with (
        reading(store.root),
        pytest.raises(StoreError) as caught,
        removing(store.root, wait_s=0.05, on_wait=lambda: told.append("waiting")),
    ):
        pass
    assert (caught.value.code, told) == ("E311", ["waiting"])
    with removing(store.root), pytest.raises(StoreError) as caught, reading(store.root, wait_s=0.05):
        pass
    assert caught.value.code == "E311"
    with reading(store.root), reading(store.root, wait_s=0.0):
        pass


def test_a_removal_that_waited_goes_on(tmp_path: Path) -> None:
    store = fill(tmp_path, [person()])
    fd = os.open(store.root / LOCK, os.O_RDWR | os.O_CREAT)
    fcntl.flock(fd, fcntl.LOCK_SH)
    threading.Timer(0.1, lambda: os.close(fd)).start()
    with removing(store.root, wait_s=10):
        pass


def test_reading_where_there_is_no_store_makes_none(tmp_path: Path) -> None:
    with reading(tmp_path / "store"):
        pass
    assert list(tmp_path.iterdir()) == []
