"""Which import brought each row of a part: noted in the part's metadata, so that the tables need no column for it.

A record belongs to the import that brought it first. Records of a broker, and those that older versions stored, belong
to no import: their owner is "". A part whose rows all belong to none has no note.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

OWNERS = b"vsd.imports"
OWNER = "import_id"
"""Name of the column that holds the owner of a row while a part is made."""


@dataclass(frozen=True, slots=True)
class Brought:
    """What one import owns of a part.

    Attributes:
        n_rows: Number of rows.
        cameras: Their cameras.
    """

    n_rows: int
    cameras: tuple[str, ...]


def owned_by(import_id: str, rows: pa.Table) -> pa.Table:
    """Return rows with the column `OWNER` that says which import brought them; "" = none."""
    of_row = pa.array(np.zeros(rows.num_rows, dtype=np.int32))
    return rows.append_column(OWNER, pa.DictionaryArray.from_arrays(of_row, pa.array([import_id])))


def without_owners(rows: pa.Table) -> tuple[pa.Table, bytes | None]:
    """Return rows without their column `OWNER`, and the note of it for the part's metadata; None = no import's."""
    owner = rows[OWNER].combine_chunks()
    if pa.types.is_dictionary(owner.type) and len(owner.dictionary) > 1:
        owner = owner.dictionary_decode()  # the dictionary may also name imports of other rows
    coded = owner.dictionary_encode()
    ids = coded.dictionary.to_pylist()
    bare = rows.drop_columns([OWNER])
    if ids in ([], [""]):
        return bare, None
    of_row = coded.indices.to_numpy(zero_copy_only=False).astype("<u4")
    owned = {}
    for at, import_id in enumerate(ids):
        cameras = pc.unique(bare["camera_id"].filter(pa.array(of_row == at)))
        owned[import_id] = {"n": int((of_row == at).sum()), "cameras": sorted(cameras.to_pylist())}
    note: dict[str, object] = {"imports": owned}
    if len(ids) > 1:  # rows of one import lie together, so their numbers take almost no space
        note["rows"] = base64.b64encode(pa.compress(of_row.tobytes(), codec="zstd", asbytes=True)).decode()
    return bare, json.dumps(note).encode()


def owners_of(path: Path) -> pa.Array:
    """Return the import id of each row of a part, in the order of its rows; "" = no import's."""
    metadata = pq.read_metadata(path)
    note = (metadata.metadata or {}).get(OWNERS)
    if note is None:
        return pa.array([""] * metadata.num_rows, pa.string())
    owners = json.loads(note)
    ids = pa.array(list(owners["imports"]), pa.string())
    if "rows" not in owners:
        return ids.take(pa.array(np.zeros(metadata.num_rows, dtype=np.int32)))
    packed = base64.b64decode(owners["rows"])
    of_row = pa.decompress(packed, decompressed_size=4 * metadata.num_rows, codec="zstd", asbytes=True)
    return ids.take(pa.array(np.frombuffer(of_row, dtype="<u4")))


def brought_by(path: Path) -> Mapping[str, Brought]:
    """Return what each import owns of a part, by import id, from its metadata alone; {} where all is no import's."""
    note = (pq.read_metadata(path).metadata or {}).get(OWNERS)
    owned = {} if note is None else json.loads(note)["imports"]
    return {i: Brought(each["n"], tuple(each["cameras"])) for i, each in owned.items() if i}
