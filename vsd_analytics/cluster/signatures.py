"""Signatures at the place between nodes and their site: what has none of the site's secret is not believed.

Whoever can write to the place can add, change, copy, rename and remove files there. A signature is a keyed BLAKE2b hash
over the purpose of a file, its name and its content, so a file that was made, changed or renamed without the key has a
wrong one. The key comes from the secret that a node took over when it joined (`store.day_chain`), whatever days were
forgotten since.

A node *stamps* each file that it hands on with the instant it was made ready. A receipt names the stamp: an old receipt
for the same bytes says nothing of a file that was made later.
"""

from __future__ import annotations

import hashlib
import hmac
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import msgspec

from vsd_analytics.cluster.exchange import NODES, RECEIPTS, NodeNotice, SiteNotice
from vsd_analytics.store.day_chain import DayChain

_BYTES = 16
Notice = TypeVar("Notice", SiteNotice, NodeNotice)


@dataclass(frozen=True, slots=True)
class HandedFile:
    """One file that a node hands on.

    Attributes:
        node: Name of the node.
        kind: Table of its records, or `imports`.
        digest: Hash of its bytes, as in its name in the outbox.
        stamp: When it was made ready there, 16 hexadecimal digits of nanoseconds.
        suffix: End of its name.
    """

    node: str
    kind: str
    digest: str
    stamp: str
    suffix: str

    @classmethod
    def of_outbox(cls, path: Path, *, node: str) -> HandedFile:
        """Return the description of a file that is ready in the outbox."""
        return cls(node, path.parent.name, path.stem, f"{path.stat().st_mtime_ns:016x}", path.suffix)

    @property
    def front(self) -> str:
        """Return its name at the place, up to its signature."""
        return f"{NODES}/{self.node}/{self.kind}/{self.digest}-{self.stamp}-"

    @property
    def receipt(self) -> str:
        """Return the name of its receipt."""
        return f"{RECEIPTS}/{self.node}/{self.digest}-{self.stamp}"


class Signer:
    """Signs and tells signatures, with the key of a site.

    Args:
        chain: The secret of the site.
    """

    def __init__(self, chain: DayChain) -> None:
        self._key = chain.exchange_key()

    def name(self, file: HandedFile, data: bytes) -> str:
        """Return the name of a file at the place, which holds the signature of its content."""
        return f"{file.front}{self._signature(b'part', file.front.encode(), data)}{file.suffix}"

    def receipt(self, file: HandedFile, data: bytes) -> bytes:
        """Return the content of the receipt of a file."""
        return self._signature(b"receipt", file.front.encode(), data).encode() + b"\n"

    def signed(self, notice: Notice) -> Notice:
        """Return a notice with its signature."""
        bare = msgspec.structs.replace(notice, signature="")
        purpose = type(notice).__name__.encode()
        return msgspec.structs.replace(bare, signature=self._signature(purpose, msgspec.json.encode(bare)))

    def has_signed(self, notice: Notice) -> bool:
        """Return whether a notice has its signature."""
        return is_same(self.signed(notice).signature, notice.signature)

    def _signature(self, purpose: bytes, *parts: bytes) -> str:
        digest = hashlib.blake2b(key=self._key, person=purpose, digest_size=_BYTES)
        for part in parts:  # each with its length: no two lists of parts are one text
            digest.update(len(part).to_bytes(8, "big"))
            digest.update(part)
        return digest.hexdigest()


def is_same(one: str | bytes, other: str | bytes) -> bool:
    """Compare two signatures in a time that tells nothing."""
    first, second = (text.encode() if isinstance(text, str) else text for text in (one, other))
    return hmac.compare_digest(first, second)
