"""The SQL files: one relation each, with a header that is parsed and held to.

```sql
-- name: facts/episodes
-- One row per ...                          (what a row is, one sentence)
-- unit: hour                               (facts only: hour, the default, or day)
-- grain: camera_id, ...
-- reads: pairs, instants
-- params: distance_mm
-- columns:
--   duration_s   seconds; ...
-- assumes: ...                              (what it takes for granted, or decides for the reader)
```
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from vsd_analytics.errors import SqlError, Where
from vsd_analytics.resources import shipped

if TYPE_CHECKING:
    import duckdb

LAYERS = ("staging", "facts", "marts", "audits")
_IDENTIFIER = re.compile(r"^[a-z][a-z0-9_]*$")
_FIELD = re.compile(r"^-- (name|unit|grain|reads|params|columns|assumes): ?(.*)$")
_COLUMN = re.compile(r"^--   ([a-z][a-z0-9_]*)(?:\s+(.*))?$")


@dataclass(frozen=True, slots=True)
class Relation:
    """One SQL file.

    Attributes:
        layer: "staging", "facts", "marts" or "audits".
        name: Relation name, the file's stem.
        description: What a row is.
        unit: "hour" or "day" (facts).
        grain: Columns that identify a row.
        reads: Relations it reads, except `params`.
        params: Columns of `params` it uses.
        columns: Documentation by column, in the order returned.
        assumes: What it takes for granted.
        sql: The query.
        path: The file.
    """

    layer: str
    name: str
    description: str
    unit: str
    grain: tuple[str, ...]
    reads: tuple[str, ...]
    params: tuple[str, ...]
    columns: Mapping[str, str]
    assumes: str
    sql: str
    path: Path


@cache
def relations(*layers: str) -> Mapping[str, Relation]:
    """Return the relations of some layers in an order in which each stands after what it reads.

    Args:
        layers: Some of `LAYERS`.

    Raises:
        SqlError: E601, a header is incomplete or relations read each other in a circle.
    """
    paths = [path for layer in layers for path in sorted((shipped("sql") / layer).glob("*.sql"))]
    found = {r.name: r for r in map(read_relation, paths)}
    ordered: dict[str, Relation] = {}

    def add(name: str, path: tuple[str, ...]) -> None:
        if name in path:
            raise SqlError(f"SQL relations read each other in a circle: {' -> '.join((*path, name))}", code="E601")
        if name in ordered or name not in found:
            return
        for needed in found[name].reads:
            add(needed, (*path, name))
        ordered[name] = found[name]

    for name in found:
        add(name, ())
    return ordered


def read_relation(path: Path) -> Relation:
    """Parse one SQL file; SqlError E601 when its header does not keep the form."""
    text = path.read_text(encoding="utf-8")
    fields: dict[str, str] = {}
    columns: dict[str, str] = {}
    description: list[str] = []
    current = ""
    body_start = 0
    for number, line in enumerate(text.splitlines(keepends=True), start=1):
        if not line.startswith("--"):
            break
        body_start += len(line)
        if match := _FIELD.match(line.rstrip()):
            current = match[1]
            fields[current] = match[2].strip()
        elif current == "columns" and (column := _COLUMN.match(line.rstrip())):
            columns[column[1]] = (column[2] or "").strip()
        elif current == "name":
            description.append(line.removeprefix("--").strip())
        else:
            raise SqlError(
                "a header line is not understood", code="E601", where=Where(str(path), number, line.rstrip())
            )
    layer, _, name = fields.get("name", "").partition("/")
    lacking = [f for f in ("name", "grain", "reads", "assumes") if not fields.get(f)]
    lacking += [what for what, given in (("columns", columns), ("a description", description)) if not given]
    if lacking:
        raise SqlError(f"the header lacks {', '.join(lacking)}", code="E601", where=Where(str(path), 1))
    if layer != path.parent.name or name != path.stem or not _IDENTIFIER.match(name):
        raise SqlError("the header's name is not the file's place", code="E601", where=Where(str(path), 1))
    return Relation(
        layer,
        name,
        " ".join(description),
        fields.get("unit", "hour"),
        _names(fields["grain"]),
        _names(fields["reads"]),
        _names(fields.get("params", "")),
        columns,
        fields.get("assumes", ""),
        text[body_start:].strip().rstrip(";"),
        path,
    )


def check_columns(con: duckdb.DuckDBPyConnection, relation: Relation) -> None:
    """Raise SqlError E602 unless the query returns exactly the declared columns, in order."""
    returned = [row[0] for row in con.execute(f"describe {relation.sql}").fetchall()]
    if returned != list(relation.columns):
        raise SqlError(
            f"{relation.name}: declared columns differ from those returned",
            code="E602",
            where=Where(str(relation.path)),
            why=f"declared {list(relation.columns)}, returned {returned}",
        )


def _names(text: str) -> tuple[str, ...]:
    return tuple(n.strip() for n in text.split(",") if n.strip())
