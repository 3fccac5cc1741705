"""Fact files: Parquet that notes its causes and a digest of its own bytes, so that one flipped bit shows.

The digest is BLAKE2b over the whole file with zeros in the digest's place. It therefore covers rows, statistics and
footer alike: a changed statistic could make a reader skip rows that are all there.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

CAUSES = b"vsd.causes"
DIGEST = b"vsd.digest"
_BYTES = 16
_ZEROS = b"0" * 2 * _BYTES


def fact_bytes(rows: pa.Table, *, causes: Mapping[str, str]) -> bytes:
    """Return the bytes of a fact file.

    Args:
        rows: Its rows.
        causes: Hashes of what they were computed from, by cause.
    """
    noted = {CAUSES: json.dumps(dict(causes), sort_keys=True).encode(), DIGEST: _ZEROS}
    sink = pa.BufferOutputStream()
    pq.write_table(
        rows.combine_chunks().replace_schema_metadata(noted), sink, compression="zstd", write_page_checksum=True
    )
    blank: bytes = sink.getvalue().to_pybytes()
    place = _place(blank)
    return blank[:place] + _digest(blank) + blank[place + len(_ZEROS) :]


def is_undamaged(data: bytes) -> bool:
    """Tell whether all bytes of a fact file are those that were written; without a digest they are not."""
    place = _place(data)
    noted = data[place : place + len(_ZEROS)]
    return _digest(data[:place] + _ZEROS + data[place + len(_ZEROS) :]) == noted


def is_undamaged_file(path: Path) -> bool:
    """Tell whether a fact file is there, can be read, and is undamaged."""
    try:
        return is_undamaged(path.read_bytes())
    except OSError:
        return False


def causes_of(data: bytes) -> dict[str, str]:
    """Return the causes noted in the bytes of an undamaged fact file."""
    noted = (pq.read_metadata(pa.BufferReader(data)).metadata or {}).get(CAUSES, b"{}")
    return {str(k): str(v) for k, v in json.loads(noted).items()}


def _place(data: bytes) -> int:
    """Return where the digest stands: in the footer's list of texts, two bytes (kind and length) after its key."""
    return data.rfind(DIGEST) + len(DIGEST) + 2


def _digest(data: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=_BYTES).hexdigest().encode()
