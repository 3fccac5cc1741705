"""Watching a folder around the clock: every file that appears in it is ingested once and moved away.

Files in the folder are open, files in `done/` are ingested, files in `failed/` could not be read; a text beside them
says why. A file is moved after its records are durable. A crash in between ingests it again, and the store recognises
its records by their keys. The folder is listed every few seconds, because file notifications get lost when many files
come at once.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from vsd_analytics.errors import InputError, UsageError, VsdError, disk_error
from vsd_analytics.ingest.intake.pipeline import SourceResult, ingest, with_site
from vsd_analytics.ingest.intake.watched_folders import DONE, FAILED, note_watched
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.live.batches import delays_s
from vsd_analytics.live.group_commit import GroupCommitStore
from vsd_analytics.live.inbox import (
    Waiting,
    as_it_is,
    refuse_folder,
    single_watcher,
    to_done,
    to_failed,
    waiting,
)
from vsd_analytics.live.single_instance import is_alive
from vsd_analytics.live.status import CANNOT_STORE, iso_utc, read_json, write_status
from vsd_analytics.site.model import Site
from vsd_analytics.store.durable import make_dirs
from vsd_analytics.store.seals import SEALED

STATUS = Path("status") / "watch.json"
TOGETHER_FILES = 200
TOGETHER_BYTES = 64 << 20
"""At most so many files, or files of so many bytes, are made durable together before they are moved."""
ROUND_FILES = 1_000
"""Files ingested before the next fold and listing."""
FOLD_EVERY_S = 3600.0
RETRY_S = 60.0
BEAT_S = 30.0


@dataclass
class WatchStatus:
    """What a watch has done since its start.

    Attributes:
        folder: The folder.
        started: When it started.
        state: "watching", "cannot store" or "stopped".
        n_done, n_failed: Files moved to `done/` and to `failed/`.
        n_open: Files in the folder at the last listing.
        n_records: Records acknowledged, including those that were stored already.
        n_rejected: Records in quarantine, by reason.
        last_file: Name of the file ingested last.
        last_at: When that was.
        error: What is wrong now; None = nothing.
    """

    folder: Path
    started: datetime
    state: str = "watching"
    n_done: int = 0
    n_failed: int = 0
    n_open: int = 0
    n_records: int = 0
    n_rejected: Counter[str] = field(default_factory=Counter)
    last_file: str | None = None
    last_at: datetime | None = None
    error: str | None = None

    def as_dict(self, *, now: datetime) -> dict[str, Any]:
        """Return the content of `status/watch.json`; instants are ISO 8601 in UTC, unknown is null."""
        return {
            "state": self.state,
            "pid": os.getpid(),
            "at": iso_utc(now),
            "started": iso_utc(self.started),
            "folder": Source(self.folder).name,
            "done": self.n_done,
            "failed": self.n_failed,
            "open": self.n_open,
            "records": self.n_records,
            "rejected": dict(self.n_rejected),
            "last_file": self.last_file,
            "last_at": None if self.last_at is None else iso_utc(self.last_at),
            "error": self.error,
        }


def watch(
    site: Site,
    folder: Path,
    options: IngestOptions,
    *,
    clock: Callable[[], datetime],
    sleep: Callable[[float], object] = time.sleep,
    stop: Callable[[], bool] = lambda: False,
    on_source: Callable[[SourceResult], None] | None = None,
    report: Callable[[str], None] | None = None,
    monotonic: Callable[[], float] = time.monotonic,
) -> WatchStatus:
    """Ingest every file that appears in `folder` until `stop`.

    A file is ingested once its size and time have not changed for `watch_settle_s` seconds, oldest first. Names that
    begin with a dot or end in `.part` or `.tmp`, links and folders are left alone. An error of one file never stops
    the watch. When the disk refuses, the file stays where it is and is tried again.

    Args:
        site: The site the files belong to.
        folder: The folder; `done/` and `failed/` are made in it.
        options: The format options that the user gave for the files.
        clock: The clock; records later than it are quarantined.
        sleep: Waits for so many seconds; may return sooner when `stop` has become true.
        stop: Called between files, and between the batches of a large one, which is then left for the next start.
        on_source: Called when a file is done.
        report: Called with one line for people about what went wrong.
        monotonic: Seconds of a clock that nobody sets.

    Returns:
        The counts of this run.

    Raises:
        InputError: E201, there is no such folder.
        UsageError: E101, the folder is one of the project's own, or `options.camera` is no camera of the site.
        LiveError: E707, another process watches the folder.
        OSError: `done/` and `failed/` cannot be made.
    """
    refuse_folder(site, folder)
    with_site(site, options)
    with single_watcher(folder):
        for name in (DONE, FAILED):
            make_dirs(folder / name)
        note_watched(site.root, folder)
        status = WatchStatus(folder, clock())
        _Watch(site, options, status, clock, stop, on_source, report or (lambda _: None), monotonic).run(sleep)
    return status


def read_watch_status(root: Path) -> dict[str, Any] | None:
    """Return a project's `status/watch.json` with `is_running`; None when there is none or it cannot be read."""
    status = read_json(root / STATUS)
    if status is None:
        return None
    return {**status, "is_running": status.get("state") != "stopped" and is_alive(status.get("pid"))}


class _StopError(Exception):
    """The watch was asked to stop in the middle of a file."""


@dataclass
class _Watch:
    """One run of `watch`."""

    site: Site
    options: IngestOptions
    status: WatchStatus
    clock: Callable[[], datetime]
    stop: Callable[[], bool]
    on_source: Callable[[SourceResult], None] | None
    report: Callable[[str], None]
    monotonic: Callable[[], float]

    def __post_init__(self) -> None:
        settings = self.site.settings
        self.store = GroupCommitStore(self.site.acknowledged, site_id=self.site.site_id, ballast_mb=settings.ballast_mb)
        self.pending: list[tuple[Waiting, SourceResult]] = []  # ingested, not yet durable
        self.seen: dict[Waiting, float] = {}  # files and when each was first seen as it is
        self.held: dict[Waiting, float] = {}  # files that cannot be read or moved now, and when to try again
        self.is_folded = False  # what an earlier run left in the spool is folded first
        self.folded_s = self.beaten_s = self.monotonic()
        self.delays = delays_s(first_s=1.0, most_s=60.0)

    def run(self, sleep: Callable[[float], object]) -> None:
        """List the folder, ingest, fold and wait, until asked to stop."""
        self.beat()
        while not self.stop():
            wait_s = float(self.site.settings.watch_scan_s)
            before = self.status.as_dict(now=self.status.started)
            try:
                is_more = self.round()
                self.fold()
                self.healthy()
                wait_s = 0.0 if is_more else wait_s
            except _StopError:
                break
            except (OSError, VsdError) as error:
                wait_s = self.refused(error)
            if before != self.status.as_dict(now=self.status.started) or self.monotonic() - self.beaten_s > BEAT_S:
                self.beat()
            if wait_s and not self.stop():
                sleep(wait_s)
        try:
            self.fold()
        except (OSError, VsdError) as error:
            self.refused(error)
        self.status.state = "stopped"
        self.beat()

    def round(self) -> bool:
        """Ingest the files that no longer change; return whether more of them wait."""
        now_s = self.monotonic()
        self.held = {file: until_s for file, until_s in self.held.items() if until_s > now_s}
        waiting_files, self.status.n_open = waiting(self.status.folder, known=self.held)
        self.status.n_open += len(self.held)
        self.seen = {file: self.seen.get(file, now_s) for file in waiting_files}
        settle_s = float(self.site.settings.watch_settle_s)
        settled = [file for file in waiting_files if now_s - self.seen[file] >= settle_s]
        for files in _together(settled[:ROUND_FILES]):
            self.take(files)
            self.commit()
            if self.monotonic() - self.folded_s > FOLD_EVERY_S:
                self.fold()
            if self.monotonic() - self.beaten_s > BEAT_S:
                self.beat()
        return len(settled) > ROUND_FILES

    def take(self, files: Sequence[Waiting]) -> None:
        """Ingest files; their records are durable, and they are moved, with the next `commit`."""
        left = iter(files)

        def done(result: SourceResult) -> None:
            self.pending.append((next(left), result))
            self.check_stop()

        self.check_stop()
        ingest(
            self.site,
            [self.status.folder / file.name for file in files],
            self.options,
            now=self.clock(),
            is_folding=False,
            store=self.store,
            on_bytes=self.check_stop,
            on_source=done,
        )

    def commit(self) -> None:
        """Make the ingested records durable, then move their files; those that cannot be read or moved now stay.

        A file is moved only after its records are durable: a crash in between ingests it again, and its records are
        recognised.
        """
        pending, self.pending = self.pending, []
        self.is_folded = False
        self.store.commit()
        for file, result in pending:
            self.status.last_file, self.status.last_at = Source(Path(file.name)).name, self.clock()
            self.status.n_records += sum(result.n_records.values())
            self.status.n_rejected.update(result.n_rejected)
            if self.on_source is not None:
                self.on_source(result)
            if result.error is not None and not _is_of_the_file(result.error):
                self.hold(file, f"{result.source}: {result.error.what}")
                continue
            try:
                if as_it_is(self.status.folder, file.name) == file:
                    self.move(file, result)
            except FileNotFoundError:
                continue
            except OSError as refused:
                self.hold(file, f"{result.source} is ingested and cannot be moved: {refused.strerror or refused}")

    def move(self, file: Waiting, result: SourceResult) -> None:
        """Move a file to `done/`, or to `failed/` with what was wrong beside it."""
        if result.error is None:
            to_done(self.status.folder, file)
            self.status.n_done += 1
        else:
            to_failed(self.status.folder, file, result)
            self.status.n_failed += 1
            self.report(f"{result.source}: {result.error.what} (moved to {FAILED}/)")
        self.status.n_open -= 1

    def hold(self, file: Waiting, words: str) -> None:
        """Leave a file where it is and look at it again in a while."""
        self.held[file] = self.monotonic() + RETRY_S
        if self.status.error != words:
            self.status.error = words
            self.report(words)

    def check_stop(self, _n_bytes: int = 0) -> None:
        """Stop between two files, or two batches of a large one."""
        if self.stop():
            raise _StopError

    def fold(self) -> None:
        """Fold what was ingested since the last time."""
        if self.pending:
            self.commit()
        if not self.is_folded:
            n_sealed = self.store.fold().n_sealed
            self.status.n_rejected.update({SEALED: n_sealed} if n_sealed else {})
            self.is_folded = True
        self.folded_s = self.monotonic()

    def refused(self, error: OSError | VsdError) -> float:
        """Note that the disk or the store refused; return how long to wait."""
        self.pending.clear()  # their files are still there
        self.store.forget()
        cause = disk_error(error) or error
        words = cause.what if isinstance(cause, VsdError) else (cause.strerror or str(cause))
        if isinstance(cause, VsdError) and cause.where is not None:
            words += f": {cause.where.file}"
        if self.status.error != words:
            self.report(f"{words}; files stay where they are and are tried again")
        self.status.state, self.status.error = CANNOT_STORE, words
        return next(self.delays)

    def healthy(self) -> None:
        """Note that a round ended without an error."""
        if self.status.state == CANNOT_STORE:
            self.report("records can be stored again")
            self.delays = delays_s(first_s=1.0, most_s=60.0)
        self.status.state = "watching"
        if not self.held:
            self.status.error = None

    def beat(self) -> None:
        """Write the status."""
        self.beaten_s = self.monotonic()
        write_status(self.site.root, self.status.as_dict(now=self.clock()), file=STATUS)


def _together(files: Sequence[Waiting]) -> Iterator[list[Waiting]]:
    """Yield the files in groups that one commit makes durable: `TOGETHER_FILES` files or about `TOGETHER_BYTES`."""
    lot: list[Waiting] = []
    for file in files:
        lot.append(file)
        if len(lot) >= TOGETHER_FILES or sum(f.size_bytes for f in lot) >= TOGETHER_BYTES:
            yield lot
            lot = []
    if lot:
        yield lot


def _is_of_the_file(error: VsdError) -> bool:
    """Return whether the content of a file is wrong, and not its reading (E120, E201) or the store."""
    return isinstance(error, InputError | UsageError) and error.code not in ("E120", "E201")
