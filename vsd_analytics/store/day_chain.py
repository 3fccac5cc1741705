"""One secret from which a site and its nodes derive the same key for every site day, and which can forget.

The state of a day gives the key of that day and the state of the next one, both by BLAKE2b with the state as its key.
There is no way back: who holds the state of a day derives the keys of that day and of all later ones, none of earlier
ones. So a day is forgotten when its key file is gone and the chain begins after it (a forward-secure key evolution, as
in Bellare and Yee, "Forward-Security in Private-Key Cryptography", 2003).

`<project>/secrets/chain.json` holds the first day of the chain and its state.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from dataclasses import dataclass
from datetime import date, timedelta
from functools import lru_cache
from pathlib import Path

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.store.durable import publish

FILE = "chain.json"
FIRST_DAY = date(1970, 1, 1)
_FAR_DAY = date(2100, 1, 1)
_STATE_BYTES = 32


@dataclass(frozen=True, slots=True)
class DayChain:
    """The secret of a site from one day on.

    Attributes:
        day: First site day whose key it gives.
        state: Secret of that day, 32 bytes.
    """

    day: date
    state: bytes

    def key(self, day: date) -> bytes | None:
        """Return the key of a site day (32 bytes); None of a day before the first."""
        if day < self.day:
            return None
        return _derived(self.from_day(day).state, b"day key")

    def from_day(self, day: date) -> DayChain:
        """Return the chain that begins on a later day; itself where it begins on that day or after it."""
        return DayChain(max(day, self.day), _state_after(self.state, (day - self.day).days))

    def mark(self) -> str:
        """Return a text that is the same for all machines with this secret, however much of it they have forgotten.

        It comes from the state of a day far ahead, so it tells nothing of the days before.
        """
        return hashlib.blake2b(b"", key=self.from_day(_FAR_DAY).state, person=b"mark", digest_size=8).hexdigest()

    def exchange_key(self) -> bytes:
        """Return the key by which a site and its nodes sign what they put at their place, like `mark` the same for all.

        It comes from a day far ahead, and gives neither the keys of days nor the mark.
        """
        return _derived(self.from_day(_FAR_DAY).state, b"exchange")

    def as_dict(self) -> dict[str, str]:
        """Return what the file holds."""
        return {"day": self.day.isoformat(), "state": self.state.hex()}

    @classmethod
    def of_dict(cls, values: dict[str, str]) -> DayChain:
        """Return the chain of a file's content; ValueError, KeyError or TypeError where it holds none."""
        state = bytes.fromhex(values["state"])
        if len(state) != _STATE_BYTES:
            raise ValueError("the state of a chain has 32 bytes")
        return cls(date.fromisoformat(values["day"]), state)


def new_chain(day: date = FIRST_DAY) -> DayChain:
    """Return a chain with a random secret."""
    return DayChain(day, secrets.token_bytes(_STATE_BYTES))


def read_chain(folder: Path) -> DayChain | None:
    """Return the chain in a folder of secrets; None where there is none, so that each day has a random key.

    Raises:
        StoreError: E303, the file is damaged.
    """
    path = folder / FILE
    try:
        return DayChain.of_dict(json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise StoreError(
            "the secret that gives a site and its nodes their keys is damaged",
            code="E303",
            where=Where(str(path)),
            why="with another one, a person would get two pseudonyms",
            fix="restore it from a backup; on a node: vsd node join FILE again",
        ) from None


def write_chain(folder: Path, chain: DayChain) -> None:
    """Put a chain into a folder of secrets, durably, in place of the one there."""
    publish(folder / FILE, json.dumps(chain.as_dict()).encode(), is_private=True)


def day_after(day: date) -> date:
    """Return the next date."""
    return day + timedelta(days=1)


@lru_cache(maxsize=16)
def _state_after(state: bytes, n_days: int) -> bytes:
    for _ in range(n_days):
        state = _derived(state, b"next day")
    return state


def _derived(state: bytes, purpose: bytes) -> bytes:
    return hashlib.blake2b(b"", key=state, person=purpose, digest_size=_STATE_BYTES).digest()
