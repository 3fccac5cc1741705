"""The secret key of each site day that turns track ids into pseudonyms; the keys are outside the store.

There is one random key per site day in `<project>/secrets/<YYYY-MM-DD>.key`. While it exists, a record that is
delivered again gets the same track id and is recognised. Destroying it makes the pseudonyms irreversible.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import re
import secrets
from collections.abc import Iterable, Iterator
from datetime import date
from pathlib import Path

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.store.durable import fsync_dir, make_dirs, publish, remove, sweep_temporaries, temporary

KEY_BYTES = 32
_KEY = re.compile(r"^(\d{4}-\d{2}-\d{2})\.key$")


class DayKeys:
    """The keys of one project.

    Args:
        folder: `<project>/secrets`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._known: dict[date, bytes] = {}

    @property
    def forgotten_path(self) -> Path:
        """Return the path of the list of forgotten days: JSON Lines, `{"day": "2026-10-01"}`."""
        return self.folder / "forgotten.jsonl"

    def days(self) -> list[date]:
        """Return the site days that have a key, in order."""
        if not self.folder.is_dir():
            return []
        matches = (_KEY.match(p.name) for p in self.folder.iterdir())
        return sorted(date.fromisoformat(m[1]) for m in matches if m)

    def forgotten(self) -> frozenset[date]:
        """Return the site days whose keys were destroyed; such a day never gets another key.

        Raises:
            StoreError: E303, the list is damaged.
        """
        try:
            lines = self.forgotten_path.read_text(encoding="utf-8").splitlines()
            return frozenset(date.fromisoformat(json.loads(line)["day"]) for line in lines)
        except FileNotFoundError:
            return frozenset()
        except (ValueError, KeyError, TypeError, RecursionError):
            raise StoreError(
                "the list of days whose keys were destroyed is damaged",
                code="E303",
                where=Where(str(self.forgotten_path)),
                why='each line must be like {"day": "2026-10-01"}',
                fix="restore it from a backup; without it a day could get a second key and count twice",
            ) from None

    def forget(self, days: Iterable[date]) -> None:
        """Destroy the keys of site days for good."""
        with self._alone():
            # the list first: after a crash in between, a day without a key must not get a second one
            sweep_temporaries(self.folder)
            every = sorted(self.forgotten() | set(days))
            publish(self.forgotten_path, "".join(json.dumps({"day": d.isoformat()}) + "\n" for d in every).encode())
            for day in every:
                self._known.pop(day, None)
                remove(self.folder / f"{day.isoformat()}.key")
            fsync_dir(self.folder)

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        """Hold an flock(2) on the folder, so that no key is made for a day that is being forgotten."""
        make_dirs(self.folder)
        fd = os.open(self.folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX)
            yield
        finally:
            os.close(fd)

    def key(self, day: date) -> bytes:
        """Return the key of a site day; make it, durably and once, when it does not exist yet.

        Raises:
            StoreError: E303, the key's file does not hold a key, or the day was forgotten.
        """
        if day not in self._known:
            path = self.folder / f"{day.isoformat()}.key"
            if not self._known:
                sweep_temporaries(self.folder)
            if path.exists():
                fsync_dir(self.folder)  # its maker may have been killed before it synced the folder
            else:
                with self._alone():
                    if day in self.forgotten():
                        raise StoreError(
                            f"the key of {day} was destroyed",
                            code="E303",
                            where=Where(str(self.forgotten_path)),
                            why="with another key, records of that day would not be recognised and would count twice",
                            fix="do not ingest records of that day",
                        )
                    self.put(day, secrets.token_bytes(KEY_BYTES))
            key = path.read_bytes()
            if len(key) != KEY_BYTES:
                raise StoreError(
                    "a day's key for pseudonyms is damaged",
                    code="E303",
                    where=Where(str(path)),
                    why=f"a key has {KEY_BYTES} bytes, this file {len(key)}",
                    fix="restore it from a backup; without it records of that day cannot be recognised again",
                )
            self._known[day] = key
        return self._known[day]

    def put(self, day: date, key: bytes) -> None:
        """Store a key for a day unless it has one; of two processes the first one wins."""
        make_dirs(self.folder)
        path = self.folder / f"{day.isoformat()}.key"
        with temporary(path, mode=0o600) as (name, f):
            f.write(key)
            f.flush()
            os.fsync(f.fileno())
            with contextlib.suppress(FileExistsError):
                os.link(name, path)  # unlike a rename, a link never replaces a key that is there
        fsync_dir(self.folder)


def pseudonym(key: bytes, *, camera_id: str, engine_track: str) -> str:
    """Return the 16 hexadecimal digits of BLAKE2b(key; camera, 0, engine's track id)."""
    message = camera_id.encode() + b"\0" + engine_track.encode("utf-8", "surrogatepass")
    return hashlib.blake2b(message, key=key, digest_size=8).hexdigest()
