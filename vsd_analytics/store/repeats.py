"""Records that an import brought although they were stored already.

The tables hold a record once, and it belongs to the import that brought it first (`store.owners`). If that import is
taken back, the record must stay as the next import brought it. So a fold notes what other imports brought of the same
record, once for each import, in the layout of the tables:

```
store/again/<table>/site=<site>/date=<YYYY-MM-DD>/<HH>-<digest>.parquet
```

A broker counts as one bringer. Records that belong to no import cannot be taken back, so nothing is noted of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from vsd_analytics.schema import KEYS, SCHEMAS, TableName
from vsd_analytics.store.owners import OWNER, brought_by, owners_of

if TYPE_CHECKING:
    import duckdb

AGAIN = "again"


def key_aliases(table: TableName) -> str:
    """Return the expressions of a table's key with the names that `same_key` compares, for a select list."""
    return ", ".join(f"{k} as key_{i}" for i, k in enumerate(KEYS[table]))


def same_key(table: TableName, one: str = "f", other: str = "s") -> str:
    """Return the condition that two relations with `key_aliases` have the same key; null equals null in a key."""
    return " and ".join(f"{one}.key_{i} is not distinct from {other}.key_{i}" for i in range(len(KEYS[table])))


def brought_again(
    con: duckdb.DuckDBPyConnection, table: TableName, *, stored: Sequence[Path], noted: Sequence[Path]
) -> None:
    """Make the temporary table `again`: rows that an import brought of records which belong to another.

    Of each import the least row of a record is taken, and no row that is noted already.

    Args:
        con: A connection with the temporary tables of a fold: `spooled` (at least all spooled rows whose key comes
            twice or is stored) and `fresh` (those that will be stored), both with the column `owners.OWNER`.
        table: Their table.
        stored: Parts of their hours in the table.
        noted: Parts of their hours in `again`.
    """
    columns, key = ", ".join(SCHEMAS[table].names), ", ".join(KEYS[table])
    con.execute(f"create or replace temp table again as select {columns}, {OWNER} from spooled limit 0")
    bringers = {str(row[0]) for row in con.execute(f"select distinct {OWNER} from spooled").fetchall()}
    owners = (bringers | {import_id for path in stored for import_id in brought_by(path)}) - {""}
    if all(owner == bringer for owner in owners for bringer in bringers):
        return
    keyed = f"(select *, {key_aliases(table)} from spooled) as s"
    con.execute(
        f"insert into again select s.{', s.'.join(SCHEMAS[table].names)}, s.{OWNER} "
        f"from {keyed} join (select {OWNER}, {key_aliases(table)} from fresh) as f on {same_key(table)} "
        f"where f.{OWNER} not in ('', s.{OWNER})"
    )
    if stored:
        con.register("stored_rows", _with_owner(con, keyed, table, stored))
        con.execute(f"insert into again select {columns}, {OWNER} from stored_rows where owner not in ('', {OWNER})")
        con.unregister("stored_rows")
    con.execute(
        f"create or replace temp table again as select distinct on ({key}, {OWNER}) {columns}, {OWNER} from again "
        f"order by {key}, {OWNER}, {columns}"
    )
    if noted:
        rows = _with_owner(con, f"(select *, {key_aliases(table)} from again) as s", table, noted)
        con.register("noted_rows", rows)
        con.execute(
            f"create or replace temp table again as select {columns}, {OWNER} "
            f"from (select *, {key_aliases(table)} from again) as f "
            f"anti join (select {OWNER}, {key_aliases(table)} from noted_rows where {OWNER} = owner) as s "
            f"on f.{OWNER} = s.{OWNER} and {same_key(table)}"
        )
        con.unregister("noted_rows")


def _with_owner(con: duckdb.DuckDBPyConnection, rows: str, table: TableName, parts: Sequence[Path]) -> pa.Table:
    """Return the rows of a relation `s` whose key is in some parts, with the `owner` of the row there."""
    columns = ", ".join(f"s.{name}" for name in SCHEMAS[table].names)
    owned = con.sql(
        f"select {columns}, s.{OWNER}, f.filename, f.file_row_number from {rows} "
        f"join (select {key_aliases(table)}, filename, file_row_number "
        f"from read_parquet($names, filename = true, file_row_number = true)) as f on {same_key(table)}",
        params={"names": [str(path) for path in parts]},
    ).to_arrow_table()
    owner = np.full(owned.num_rows, "", dtype=object)
    files, numbers = owned["filename"].combine_chunks().dictionary_encode(), owned["file_row_number"].to_numpy()
    of_file = files.indices.to_numpy(zero_copy_only=False)
    for at, name in enumerate(files.dictionary.to_pylist()):
        is_here = of_file == at
        owner[is_here] = owners_of(Path(name)).take(pa.array(numbers[is_here])).to_pylist()
    return owned.drop_columns(["filename", "file_row_number"]).append_column("owner", pa.array(owner, pa.string()))
