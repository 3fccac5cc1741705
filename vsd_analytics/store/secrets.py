"""The secret key of each site day that turns track ids into pseudonyms; the keys are outside the store.

There is one key per site day in `<project>/secrets/<YYYY-MM-DD>.key`. While it exists, a record that is delivered again
gets the same track id and is recognised. Destroying it makes the pseudonyms irreversible. Keys are random; those of a
site with nodes come from one secret that all of them hold (`store.day_chain`).
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.store.day_chain import DayChain, day_after, new_chain, read_chain, write_chain
from vsd_analytics.store.durable import fsync_dir, make_dirs, publish, remove, sweep_temporaries, temporary
from vsd_analytics.store.file_locks import folder_lock

KEY_BYTES = 32
_KEY = re.compile(r"^(\d{4}-\d{2}-\d{2})\.key$")


@dataclass(frozen=True, slots=True)
class ClosedDays:
    """Site days that get no key (again).

    Attributes:
        days: Days whose keys were destroyed.
        before: Days before this one without a key were forgotten with a later day, because a chain has no gaps; None =
            there is no chain.
        held: Days before it that have a key.
    """

    days: frozenset[date] = frozenset()
    before: date | None = None
    held: frozenset[date] = frozenset()

    def __contains__(self, day: object) -> bool:
        return day in self.days or (isinstance(day, date) and self._is_before(day))

    def __bool__(self) -> bool:
        return bool(self.days)

    def _is_before(self, day: date) -> bool:
        return self.before is not None and day < self.before and day not in self.held


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

    def closed(self) -> ClosedDays:
        """Return the days that get no key: forgotten ones, and those that a chain can no longer give.

        Raises:
            StoreError: E303, a file is damaged.
        """
        chain, days = read_chain(self.folder), self.forgotten()
        before = None if chain is None else chain.day
        return ClosedDays(days, before, frozenset(d for d in self.days() if before is not None and d < before))

    def chain(self) -> DayChain:
        """Return the secret that this site shares with its nodes; make it when there is none.

        Days that have a key keep it.
        """
        with self._alone():
            chain = read_chain(self.folder)
            if chain is None:
                forgotten = self.forgotten()
                chain = new_chain(day_after(max(forgotten))) if forgotten else new_chain()
                write_chain(self.folder, chain)
            return chain

    def join(self, chain: DayChain, keys: Mapping[date, bytes], forgotten: Iterable[date]) -> None:
        """Take over the secret of a site: its chain, the keys of days that have one of their own, and forgotten days.

        Raises:
            StoreError: E320, this project has another chain or another key of a day already.
        """
        with self._alone():
            own_chain = read_chain(self.folder)
            here = {d: (self.folder / f"{d.isoformat()}.key").read_bytes() for d in self.days()}
            later = max(chain.day, chain.day if own_chain is None else own_chain.day)
            is_other = own_chain is not None and own_chain.from_day(later) != chain.from_day(later)
            other = [d for d, key in here.items() if key != keys.get(d, chain.key(d))]
            if is_other or other:
                raise StoreError(
                    "this project has other keys than the site already",
                    code="E320",
                    where=Where(str(self.folder)),
                    why="records named by other keys would give one person two pseudonyms",
                    fix="make the node in a new folder: copy vsd.toml there, then vsd node join FILE",
                )
            for day, key in keys.items():
                self.put(day, key)
            write_chain(self.folder, chain.from_day(later))
        if days := set(forgotten):
            self.forget(days)

    def forget(self, days: Iterable[date]) -> None:
        """Destroy the keys of site days for good; a chain then begins after the last of them."""
        with self._alone():
            # the list first: after a crash in between, a day without a key must not get a second one
            sweep_temporaries(self.folder)
            every = sorted(self.forgotten() | set(days))
            publish(self.forgotten_path, "".join(json.dumps({"day": d.isoformat()}) + "\n" for d in every).encode())
            for day in every:
                self._known.pop(day, None)
                remove(self.folder / f"{day.isoformat()}.key")
            if every and (chain := read_chain(self.folder)) is not None and chain.day <= every[-1]:
                write_chain(self.folder, chain.from_day(day_after(every[-1])))
            fsync_dir(self.folder)

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        """Hold an flock(2) on the folder, so that no key is made for a day that is being forgotten."""
        make_dirs(self.folder)
        with folder_lock(self.folder):
            yield

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
                    if day in self.closed():
                        raise StoreError(
                            f"the key of {day} was destroyed",
                            code="E303",
                            where=Where(str(self.forgotten_path)),
                            why="with another key, records of that day would not be recognised and would count twice",
                            fix="do not ingest records of that day",
                        )
                    chain = read_chain(self.folder)
                    derived = None if chain is None else chain.key(day)
                    self.put(day, derived or secrets.token_bytes(KEY_BYTES))
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


class PassingKeys(DayKeys):
    """The keys that a project has, for a look that must write nothing; other days get a key that nobody keeps."""

    def key(self, day: date) -> bytes:
        """Return the key of a site day; a new one, which is not stored, where there is none that can be read."""
        if day not in self._known:
            key = b""
            with contextlib.suppress(OSError):
                key = (self.folder / f"{day.isoformat()}.key").read_bytes()
            if len(key) != KEY_BYTES:
                chain = read_chain(self.folder)
                key = (None if chain is None else chain.key(day)) or secrets.token_bytes(KEY_BYTES)
            self._known[day] = key
        return self._known[day]


def namer(key: bytes, *, camera_id: str) -> Callable[[str], str]:
    """Return a function that names the tracks of a camera by the engine's ids.

    A pseudonym has the 16 hexadecimal digits of BLAKE2b(key; camera, 0, engine's track id).
    """
    begun = hashlib.blake2b(camera_id.encode() + b"\0", key=key, digest_size=8)

    def name(engine_track: str) -> str:
        of_track = begun.copy()
        of_track.update(engine_track.encode("utf-8", "surrogatepass"))
        return of_track.hexdigest()

    return name
