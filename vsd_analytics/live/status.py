"""The listener's heartbeat: one JSON object, as a file of the project and as a retained MQTT message."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from vsd_analytics.live.batches import Numbering
from vsd_analytics.live.folding import Folded
from vsd_analytics.store.durable import make_dirs

FILE = Path("status") / "listen.json"


def peak_mb() -> float:
    """Return the peak resident memory of this process, in megabytes (10^6 bytes)."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak * (1 if sys.platform == "darwin" else 1024) / 1e6, 1)


@dataclass
class Camera:
    """What came from one camera since the start.

    Attributes:
        last_ms: Instant of its newest message (UTC milliseconds).
        n_frames: Messages stored, re-deliveries included.
        numbering: Its running numbers.
    """

    last_ms: int = 0
    n_frames: int = 0
    numbering: Numbering = field(default_factory=Numbering)


@dataclass
class Status:
    """What a listener has done since its start, and how it is.

    Attributes:
        started: When it started.
        state: "starting", "listening", "waiting for the broker", "cannot store", or "stopped".
        connected_since: Since when there is a connection; None = there is none.
        n_connections: Connections made.
        n_received: Messages received, re-deliveries included.
        n_redelivered: Messages the broker marked as sent before.
        n_qos0: Messages that came without a guarantee of delivery.
        n_stored: Records durable in the spool, by table.
        n_acknowledged: Messages acknowledged to the broker.
        n_rejected: Records in quarantine, by reason.
        n_dropped: Records and fields left out on purpose, by reason.
        cameras: By camera id.
        newest_ms: Newest instant acknowledged.
        spool_rows, spool_segments: Records and files not yet folded.
        n_folds: Folds done.
        n_doubles: Records that folds recognised as stored before.
        fold: The last one.
        fold_at: When it ended.
        error: What is wrong now; None = nothing.
        alarms: Tells how the alarms are; None = there are no rules.
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
    cameras: dict[str, Camera] = field(default_factory=dict)
    newest_ms: int | None = None
    spool_rows: int = 0
    spool_segments: int = 0
    n_folds: int = 0
    n_doubles: int = 0
    fold: Folded | None = None
    fold_at: datetime | None = None
    error: str | None = None
    alarms: Callable[[], dict[str, Any]] | None = None

    def camera(self, camera_id: str) -> Camera:
        """Return a camera's entry, made when it is new."""
        return self.cameras.setdefault(camera_id, Camera())

    def as_dict(self, *, now: datetime) -> dict[str, Any]:
        """Return the heartbeat; instants are ISO 8601 in UTC, what is unknown is null.

        Args:
            now: The clock; `lag_s` is the seconds from the newest instant acknowledged to it.
        """
        fold = None
        if self.fold is not None and self.fold_at is not None:
            fold = {
                "at": _iso(self.fold_at),
                "took_s": round(self.fold.took_s, 3),
                "new": self.fold.n_new,
                "doubles": self.fold.n_known + self.fold.n_second,
                "peak_mb": self.fold.peak_mb,
                "error": self.fold.error,
            }
        return {
            "state": self.state,
            "pid": os.getpid(),
            "at": _iso(now),
            "started": _iso(self.started),
            "connected_since": None if self.connected_since is None else _iso(self.connected_since),
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
                    "last": _iso(datetime.fromtimestamp(c.last_ms / 1000, tz=UTC)),
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
            "alarms": None if self.alarms is None else self.alarms(),
            "error": self.error,
        }


def offline(started: datetime) -> bytes:
    """Return the last will: what the broker says when a listener vanishes."""
    return json.dumps({"state": "offline", "pid": os.getpid(), "started": _iso(started)}).encode()


def write_status(root: Path, told: dict[str, Any]) -> None:
    """Put a heartbeat into `<project>/status/listen.json`: a reader sees the old one or the new one, whole.

    It is no record, so it need not survive a power cut; a disk that refuses it stops nothing.
    """
    path = root / FILE
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    with contextlib.suppress(OSError):
        make_dirs(path.parent)
        temporary.write_text(json.dumps(told, ensure_ascii=False, indent=1), encoding="utf-8")
        temporary.rename(path)


def read_status(root: Path) -> dict[str, Any] | None:
    """Return the heartbeat of a project, or None when no listener ever ran or the file cannot be read."""
    try:
        told = json.loads((root / FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return told if isinstance(told, dict) else None


def is_alive(pid: object) -> bool:
    """Tell whether a process with this id runs."""
    if not isinstance(pid, int) or pid <= 0:
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _iso(instant: datetime) -> str:
    return instant.astimezone(UTC).isoformat(timespec="milliseconds")
