"""Fact files: Parquet whose metadata holds the hashes of its inputs and a digest of the file's own bytes.

The digest is BLAKE2b over the whole file with zeros in the digest's place. So it covers rows, statistics and footer: a
flipped bit in a statistic could make a reader skip rows that are in the file.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

INPUTS = b"vsd.causes"
"""Metadata key of the input hashes. Every file on disk has it, so it keeps its name from before they were "inputs"."""
DIGEST = b"vsd.digest"
_BYTES = 16
_ZEROS = b"0" * 2 * _BYTES


def fact_bytes(rows: pa.Table, *, inputs: Mapping[str, str]) -> bytes:
    """Return the bytes of a fact file.

    Args:
        rows: Its rows.
        inputs: Hash of each kind of input they were computed from.
    """
    noted = {INPUTS: json.dumps(dict(inputs), sort_keys=True).encode(), DIGEST: _ZEROS}
    sink = pa.BufferOutputStream()
    pq.write_table(
        rows.combine_chunks().replace_schema_metadata(noted),
        sink,
        compression="zstd",
        write_page_checksum=True,
        # Texts repeat; numbers seldom do: dictionaries of them cost a sixth of the writing and make files larger.
        use_dictionary=[f.name for f in rows.schema if pa.types.is_string(f.type)],
        column_encoding={f.name: "DELTA_BINARY_PACKED" for f in rows.schema if pa.types.is_integer(f.type)},
    )
    blank: bytes = sink.getvalue().to_pybytes()
    place = _place(blank)
    return blank[:place] + _digest(blank) + blank[place + len(_ZEROS) :]


def is_undamaged(data: bytes) -> bool:
    """Return whether all bytes of a fact file match its digest; False for a file without one."""
    place = _place(data)
    noted = data[place : place + len(_ZEROS)]
    return _digest(data[:place] + _ZEROS + data[place + len(_ZEROS) :]) == noted


def is_undamaged_file(path: Path) -> bool:
    """Return whether a fact file exists, can be read, and matches its digest."""
    try:
        return is_undamaged(path.read_bytes())
    except OSError:
        return False


def noted_inputs(data: bytes) -> dict[str, str]:
    """Return the input hashes in the metadata of an undamaged fact file."""
    noted = (pq.read_metadata(pa.BufferReader(data)).metadata or {}).get(INPUTS, b"{}")
    return {str(k): str(v) for k, v in json.loads(noted).items()}


def _place(data: bytes) -> int:
    """Return the offset of the digest.

    Parquet's footer stores metadata as Thrift strings: after the key come two bytes (field type and length), then the
    value. `rfind`, because column data before the footer may hold the same bytes by chance.
    """
    return data.rfind(DIGEST) + len(DIGEST) + 2


def _digest(data: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=_BYTES).hexdigest().encode()
