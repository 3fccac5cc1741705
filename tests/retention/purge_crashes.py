"""Ends a purge just before any one of its writes, unlinks and folder syncs, and tells what a project holds."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from aged_projects import DAYS, TERMS, day, litter, make_project, messages, vsd, write

from vsd_analytics.config.project import load_site
from vsd_analytics.retention.purge import Terms, forget_keys, purge_older, purge_range
from vsd_analytics.schema import TABLES
from vsd_analytics.store import durable, secrets
from vsd_analytics.store.erasures import RecordScope, erasures, rows_in_scope
from vsd_analytics.store.store import Store

HOUR_MS = 3_600_000


class Crash(BaseException):
    """The process ended here."""


def prepare(folder: Path) -> Path:
    """Return a project with two cameras and the records of a few hours of two UTC days, its facts computed."""
    root = make_project(folder / "prepared")
    found = [m for c in ("cam-1", "cam-2") for m in messages(camera=c, day=DAYS[0], hours=(9, 23))]
    found += [m for c in ("cam-1", "cam-2") for m in messages(camera=c, day=DAYS[1], hours=(0, 9))]
    bad = [m for c in ("cam-1", "cam-2", "yard") for m in messages(camera=c, day=DAYS[0], hours=(10,), shift_m=1e6)]
    vsd(root, "ingest", str(write(root / "f.jsonl", [*found, *bad])), code=1)
    vsd(root, "build")
    return root


def by_age(root: Path) -> None:
    purge_older(load_site(root), before=day(DAYS[1]), terms=TERMS)


FIRST_MS = (day(DAYS[0]).toordinal() - day("1970-01-01").toordinal()) * 24 * HOUR_MS
SCOPE = RecordScope("cam-1", FIRST_MS, FIRST_MS + 24 * HOUR_MS)


def by_range(root: Path, *, terms: Terms = TERMS) -> None:
    which = SCOPE
    purge_range(
        load_site(root), camera_id=which.camera_id, first_ms=which.first_ms, after_ms=which.after_ms, terms=terms
    )


def on_request(root: Path) -> None:
    by_range(root, terms=replace(TERMS, reason="request 7"))


def of_sealed(root: Path) -> None:
    by_range(root)


def of_keys(root: Path) -> None:
    forget_keys(load_site(root), before=day("2026-11-12"), terms=TERMS)


def in_scope(root: Path) -> dict[str, int]:
    store = Store(root / "store", site_id=load_site(root).site_id)
    return {t: sum(rows_in_scope(p.path, SCOPE) for p in store.parts(t)) for t in TABLES}


def bring_back(root: Path, *, start: Path) -> str:
    """Deliver the records of the request once more; return "" when they are all there still, or none of them."""
    lines = messages(camera="cam-1", day=DAYS[0], hours=(9, 23))
    vsd(root, "ingest", str(write(root / "again.jsonl", lines)), code=None)
    n_rows = in_scope(root)
    if erasures(root / "store") or (root / "purge.jsonl").exists():
        return f"erased, and back: {n_rows}" if any(n_rows.values()) else ""
    return "" if n_rows == in_scope(start) else f"not erased, and gone: {n_rows}"


JOBS: dict[str, Callable[[Path], None]] = {
    "age": by_age,
    "range": by_range,
    "sealed": of_sealed,
    "request": on_request,
    "delivered": on_request,
    "sealed request": on_request,
    "keys": of_keys,
}


def start_of(job: str, prepared: Path, folder: Path) -> Path:
    """Return a project ready for a job."""
    root = folder / f"start-{job}"
    shutil.copytree(prepared, root)
    if job.startswith("sealed"):
        by_age(root)
    if job == "keys":
        secrets.DayKeys(root / "secrets").key(day(DAYS[0]))
    return root


@contextmanager
def watched(at: int | None) -> Iterator[list[str]]:
    """Note every call that changes the disk; end the process before the one numbered `at`, a write left half done."""
    calls: list[str] = []

    def watching(name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(path: Path, *arguments: Any, **options: Any) -> Any:
            calls.append(name)
            if at is not None and len(calls) == at + 1:
                if name == "publish" and path.parent.is_dir():
                    (path.parent / f".{path.name}.4194999.tmp").write_bytes(b"half")
                raise Crash
            return real(path, *arguments, **options)

        return call

    with pytest.MonkeyPatch.context() as patched:
        for name in ("publish", "remove", "fsync_dir"):
            real = getattr(durable, name)
            patched.setattr(durable, name, watching(name, real))
            patched.setattr(secrets, name, watching(name, real))
        yield calls


def state(root: Path) -> dict[str, bytes]:
    """Return name and bytes of everything that counts: store, sealed facts, keys, audit."""
    kept = ("store", "sealed", "secrets", "quarantine", "purge.jsonl")
    paths = [p for name in kept for p in [root / name, *(root / name).rglob("*")] if p.is_file()]
    paths = [p for p in paths if p.name != "imports.jsonl"]  # a delivery is noted, whatever came of it
    return {str(p.relative_to(root)): p.read_bytes() for p in paths}


def outcome(job: str, start: Path, root: Path, *, at: int) -> str:
    """Return "" when a crash at a point and the same command again end as without, else what is wrong."""
    shutil.copytree(start, root)
    with watched(at):
        try:
            JOBS[job](root)
        except Crash:
            pass
        else:
            return "the point was not reached"
    came_back = bring_back(root, start=start) if job == "delivered" else ""
    JOBS[job](root)
    again = state(root)
    expected = state(start.parent / f"unharmed-{job}")
    wrong = sorted(k for k in {*again, *expected} if again.get(k) != expected.get(k))
    if job == "delivered":  # the id of its audit line is a hash of all files that it changes
        wrong = [k for k in wrong if k != "purge.jsonl"]
    return ", ".join([*([came_back] if came_back else []), *wrong, *litter(root)])


def points_of(job: str, start: Path) -> int:
    """Return how many points a job has, and leave its unharmed end beside its start."""
    root = start.parent / f"unharmed-{job}"
    shutil.copytree(start, root)
    with watched(None) as calls:
        JOBS[job](root)
    return len(calls)
