"""The listener's heartbeat: one JSON object, as a file of the project and as a retained MQTT message."""

from __future__ import annotations

import contextlib
import json
import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from vsd_analytics.live.batches import Numbering
from vsd_analytics.live.folding import Folded, peak_mb
from vsd_analytics.store.durable import publish

FILE = Path("status") / "listen.json"
LISTENING: Final = "listening"
CANNOT_STORE: Final = "cannot store"
CLOCKS_DISAGREE: Final = "clocks disagree"


@dataclass
class CameraStatus:
    """The messages of one camera since the start.

    Attributes:
        last_ms: Instant of its newest message (UTC milliseconds).
        n_frames: Messages stored, re-deliveries included.
        numbering: Its sequence numbers.
    """

    last_ms: int = 0
    n_frames: int = 0
    numbering: Numbering = field(default_factory=Numbering)


@dataclass
class Status:
    """What a listener has done since its start, and its state.

    Attributes:
        started: When it started.
        state: "starting", "listening", "waiting for the broker", "cannot store", "clocks disagree", or "stopped".
        connected_since: Since when there is a connection; None = there is none.
        n_connections: Connections made.
        n_received: Messages received, re-deliveries included.
        n_redelivered: Messages the broker marked as sent before.
        n_qos0: Messages that came without a guarantee of delivery.
        n_stored: Records durable in the spool, by table.
        n_acknowledged: Messages acknowledged to the broker.
        n_rejected: Records put into quarantine, by reason.
        n_dropped: Records and fields left out on purpose, by reason.
        cameras: By camera id.
        newest_ms: Newest instant acknowledged.
        spool_rows, spool_segments: Records and files not yet folded.
        n_folds: Folds done.
        n_doubles: Records that folds recognised as stored before.
        fold: The last one.
        fold_at: When it ended.
        error: What is wrong now; None = nothing.
        http: Returns the state of the HTTP server; None = there is none.
        alarms: Returns the state of the alarms; None = there are no rules.
        engine: Returns the state of the cameras' pictures; None = no pictures are looked at.
    """

    started: datetime
    state: str = "starting"
    connected_since: datetime | None = None
    n_connections: int = 0
    n_received: int = 0
    n_redelivered: int = 0
    n_qos0: int = 0
    n_stored: Counter[str] = field(default_factory=Counter)
    n_acknowledged: int = 0
    n_rejected: Counter[str] = field(default_factory=Counter)
    n_dropped: Counter[str] = field(default_factory=Counter)
    cameras: dict[str, CameraStatus] = field(default_factory=dict)
    newest_ms: int | None = None
    spool_rows: int = 0
    spool_segments: int = 0
    n_folds: int = 0
    n_doubles: int = 0
    fold: Folded | None = None
    fold_at: datetime | None = None
    error: str | None = None
    http: Callable[[], dict[str, Any]] | None = None
    alarms: Callable[[], dict[str, Any]] | None = None
    engine: Callable[[], dict[str, Any]] | None = None

    def camera(self, camera_id: str) -> CameraStatus:
        """Return a camera's entry, made when it is new."""
        return self.cameras.setdefault(camera_id, CameraStatus())

    def as_dict(self, *, now: datetime) -> dict[str, Any]:
        """Return the heartbeat; instants are ISO 8601 in UTC, what is unknown is null.

        Args:
            now: The clock; `lag_s` is the seconds from the newest instant acknowledged to it.
        """
        fold = None
        if self.fold is not None and self.fold_at is not None:
            fold = {
                "at": iso_utc(self.fold_at),
                "took_s": round(self.fold.took_s, 3),
                "new": self.fold.n_new,
                "doubles": self.fold.n_known + self.fold.n_second,
                "peak_mb": self.fold.peak_mb,
                "error": self.fold.error,
            }
        return {
            "state": self.state,
            "pid": os.getpid(),
            "at": iso_utc(now),
            "started": iso_utc(self.started),
            "connected_since": None if self.connected_since is None else iso_utc(self.connected_since),
            "connections": self.n_connections,
            "received": self.n_received,
            "redelivered": self.n_redelivered,
            "qos0": self.n_qos0,
            "acknowledged": self.n_acknowledged,
            "stored": dict(self.n_stored),
            "doubles": self.n_doubles if self.n_folds else None,
            "rejected": dict(self.n_rejected),
            "dropped": dict(self.n_dropped),
            "lag_s": None if self.newest_ms is None else round(now.timestamp() - self.newest_ms / 1000, 3),
            "cameras": {
                name: {
                    "last": iso_utc(datetime.fromtimestamp(c.last_ms / 1000, tz=UTC)),
                    "messages": c.n_frames,
                    "last_seq": c.numbering.highest,
                    "missing": c.numbering.n_missing if c.numbering.highest is not None else None,
                }
                for name, c in sorted(self.cameras.items())
            },
            "spool": {"rows": self.spool_rows, "files": self.spool_segments},
            "folds": self.n_folds,
            "fold": fold,
            "peak_mb": peak_mb(),
            "http": None if self.http is None else self.http(),
            "alarms": None if self.alarms is None else self.alarms(),
            "engine": None if self.engine is None else self.engine(),
            "error": self.error,
        }


def offline(started: datetime) -> bytes:
    """Return the last will: the message that the broker publishes when the listener's connection breaks."""
    return json.dumps({"state": "offline", "pid": os.getpid(), "started": iso_utc(started)}).encode()


def write_status(root: Path, status: dict[str, Any], *, file: Path = FILE) -> None:
    """Write a heartbeat to `<project>/status/listen.json`; a reader sees all of the old one or of the new one.

    It is no record, so it need not survive a power cut, and a disk that refuses it stops nothing. A full disk has no
    room for a second file: what is wrong is then written into the blocks of the old one, which would say that all is
    well.

    Args:
        root: The project folder.
        status: The content.
        file: What it is written to instead.
    """
    try:
        publish(root / file, _as_bytes(status, indent=1), is_synced=False)
    except OSError as refused:
        why = str(refused.strerror or refused)
        if status.get("state") == LISTENING:
            status = {**status, "state": CANNOT_STORE}
        status = {**status, "error": status.get("error") or f"the disk refused the status: {why}"}
        with contextlib.suppress(OSError):
            _write_in_place(root / file, _as_bytes(status))


def _as_bytes(status: dict[str, Any], *, indent: int | None = None) -> bytes:
    return json.dumps(status, ensure_ascii=False, indent=indent).encode("utf-8", "replace")


def _write_in_place(path: Path, data: bytes) -> None:
    """Write a file's content again within the blocks it has; a content that needs more stays unwritten."""
    with path.open("r+b", buffering=0) as opened:
        about = os.fstat(opened.fileno())
        if len(data) <= about.st_blocks * 512:
            opened.write(data.ljust(about.st_size))  # in one call, and spaces to its old end: a reader finds no half
            opened.truncate(len(data))


def read_status(root: Path) -> dict[str, Any] | None:
    """Return the heartbeat of a project, or None when no listener ever ran or the file cannot be read."""
    return read_json(root / FILE)


def read_json(path: Path) -> dict[str, Any] | None:
    """Return the JSON object of a file, or None when it does not exist or cannot be read."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


def iso_utc(instant: datetime) -> str:
    """Return an instant as ISO 8601 text in UTC with milliseconds."""
    return instant.astimezone(UTC).isoformat(timespec="milliseconds")
