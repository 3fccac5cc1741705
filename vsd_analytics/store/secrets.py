"""The per-day secrets that make track ids pseudonyms; they stand outside the store.

One random key per site day in `<project>/secrets/<YYYY-MM-DD>.key`. While it exists a re-delivered record hashes to
the same track id and is recognised; destroying it makes the link to the engine's ids irreversible.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
from datetime import date
from pathlib import Path

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.store.durable import fsync_dir, make_dirs, sweep_temporaries

KEY_BYTES = 32


class DayKeys:
    """The keys of one project.

    Args:
        folder: `<project>/secrets`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._known: dict[date, bytes] = {}

    def key(self, day: date) -> bytes:
        """Return the key of a site day, made (durably, once) when it does not exist yet.

        Raises:
            StoreError: E303, the key's file does not hold a key.
        """
        if day not in self._known:
            path = self.folder / f"{day.isoformat()}.key"
            if not path.exists():
                self.put(day, secrets.token_bytes(KEY_BYTES))
            key = path.read_bytes()
            if len(key) != KEY_BYTES:
                raise StoreError(
                    "a day's key for pseudonyms is damaged",
                    code="E303",
                    where=Where(str(path)),
                    why=f"a key has {KEY_BYTES} bytes, this file {len(key)}",
                    mend="restore it from a backup; without it records of that day cannot be recognised again",
                )
            self._known[day] = key
        return self._known[day]

    def put(self, day: date, key: bytes) -> None:
        """Store a key for a day unless it has one; two processes agree on whoever came first."""
        make_dirs(self.folder)
        sweep_temporaries(self.folder)
        temporary = self.folder / f".{day.isoformat()}.{os.getpid()}.tmp"
        fd = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(fd, "wb") as f:
            f.write(key)
            f.flush()
            os.fsync(f.fileno())
        with contextlib.suppress(FileExistsError):
            os.link(temporary, self.folder / f"{day.isoformat()}.key")
        temporary.unlink()
        fsync_dir(self.folder)


def pseudonym(key: bytes, *, camera_id: str, engine_track: str) -> str:
    """Return the 16 hexadecimal digits of BLAKE2b(key; camera, 0, engine's track id)."""
    message = camera_id.encode() + b"\0" + engine_track.encode("utf-8", "surrogatepass")
    return hashlib.blake2b(message, key=key, digest_size=8).hexdigest()
