"""The SQL files: one relation each, with a header that is parsed and held to.

```sql
-- name: facts/episodes
-- One row per ...                          (what a row is, one sentence)
-- unit: hour                               (facts only: hour, the default, or day)
-- kept: local_date                         (its rows are kept by day: local_date, site_day or utc_day; see `days`)
-- graph: ...                               (staging only: rows are the connected components of the edges it gives)
-- grain: camera_id, ...
-- reads: pairs, instants
-- params: distance_mm
-- columns:
--   duration_s   seconds; ...
-- figure: M10 Duration of violations          (for each figure of the catalogue that is made from it)
--   definition   ...                         (and so on: `FIGURE_FIELDS`; long ones go on in the next line)
-- assumes: ...                              (what it takes for granted, or decides for the reader)
```
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from vsd_analytics.errors import SqlError, Where
from vsd_analytics.resources import shipped

if TYPE_CHECKING:
    import duckdb

LAYERS = ("staging", "facts", "marts", "audits")
FIGURE_FIELDS = ("definition", "unit", "denominator", "needs", "uncertainty", "by")
_IDENTIFIER = re.compile(r"^[a-z][a-z0-9_]*$")
_FIELD = re.compile(r"^-- (name|unit|kept|graph|grain|reads|params|columns|figure|assumes): ?(.*)$")
_OF_GRAPHS = {"node_a": "node", "node_b": "component"}
_COLUMN = re.compile(r"^--   ([a-z][a-z0-9_]*)(?:\s+(.*))?$")
_GOES_ON = re.compile(r"^-- {4,}(\S.*)$")
_FIGURE = re.compile(r"^(M\d{1,2}) (\S.*)$")


@dataclass(frozen=True, slots=True)
class FigureHeader:
    """A figure of the catalogue, as the header of the relation it is made from tells it.

    Attributes:
        metric: M0 to M29.
        name: What it is called.
        definition: What is computed.
        unit: Of the value.
        denominator: What it is divided by, or counted out of.
        needs: The least data it needs.
        uncertainty: Its interval or test, or why it has none.
        by: The function of Python that gives it, whole dotted name.
        relation: "marts/violations".
    """

    metric: str
    name: str
    definition: str
    unit: str
    denominator: str
    needs: str
    uncertainty: str
    by: str
    relation: str


@dataclass(frozen=True, slots=True)
class Relation:
    """One SQL file.

    Attributes:
        layer: "staging", "facts", "marts" or "audits".
        name: Relation name, the file's stem.
        description: What a row is.
        unit: "hour" or "day" (facts).
        kept: By which day its rows are kept in files: "local_date" or "site_day", columns of a mart; "utc_day" of a
            fact; empty = they are computed when asked for.
        is_graph: The query gives edges; the relation is their connected components (`graphs.components`).
        grain: Columns that identify a row.
        reads: Relations it reads, except `params`.
        params: Columns of `params` it uses.
        columns: Documentation by column, in the order returned.
        figures: Figures of the catalogue that are made from it.
        assumes: What it takes for granted.
        sql: The query.
        path: The file.
    """

    layer: str
    name: str
    description: str
    unit: str
    kept: str
    is_graph: bool
    grain: tuple[str, ...]
    reads: tuple[str, ...]
    params: tuple[str, ...]
    columns: Mapping[str, str]
    figures: tuple[FigureHeader, ...]
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
    figures: list[dict[str, str]] = []
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
            if current == "figure":
                named = _FIGURE.match(fields[current])
                if named is None:
                    raise _not_understood(path, number, line)
                figures.append({"metric": named[1], "name": named[2]})
        elif current == "columns" and (column := _COLUMN.match(line.rstrip())):
            columns[column[1]] = (column[2] or "").strip()
        elif current == "figure" and figures and (told := _COLUMN.match(line.rstrip())) and told[1] in FIGURE_FIELDS:
            figures[-1][told[1]] = (told[2] or "").strip()
        elif current == "figure" and figures and (rest := _GOES_ON.match(line.rstrip())):
            last = next(reversed(figures[-1]))
            figures[-1][last] += f" {rest[1]}"
        elif current == "name":
            description.append(line.removeprefix("--").strip())
        else:
            raise _not_understood(path, number, line)
    layer, _, name = fields.get("name", "").partition("/")
    lacking = [f for f in ("name", "grain", "reads", "assumes") if not fields.get(f)]
    lacking += [what for what, given in (("columns", columns), ("a description", description)) if not given]
    lacking += [f"{k} of {f['metric']}" for f in figures for k in FIGURE_FIELDS if not f.get(k)]
    if lacking:
        raise SqlError(f"the header lacks {', '.join(lacking)}", code="E601", where=Where(str(path), 1))
    if layer != path.parent.name or name != path.stem or not _IDENTIFIER.match(name):
        raise SqlError("the header's name is not the file's place", code="E601", where=Where(str(path), 1))
    return Relation(
        layer,
        name,
        " ".join(description),
        fields.get("unit", "hour"),
        fields.get("kept", ""),
        "graph" in fields,
        _names(fields["grain"]),
        _names(fields["reads"]),
        _names(fields.get("params", "")),
        columns,
        tuple(FigureHeader(**f, relation=f"{layer}/{name}") for f in figures),
        fields.get("assumes", ""),
        text[body_start:].strip().rstrip(";"),
        path,
    )


def _not_understood(path: Path, number: int, line: str) -> SqlError:
    return SqlError("a header line is not understood", code="E601", where=Where(str(path), number, line.rstrip()))


def figure_headers() -> tuple[FigureHeader, ...]:
    """Return the figures of the catalogue in order, as the headers of facts and marts tell them.

    Raises:
        SqlError: E601, a header does not keep its form, or two tell of one figure.
    """
    found = [f for relation in relations("facts", "marts").values() for f in relation.figures]
    ordered = sorted(found, key=lambda f: (int(f.metric[1:]), f.relation))
    for one, other in pairwise(ordered):
        if one.metric == other.metric:
            raise SqlError(f"{one.relation} and {other.relation} both tell of {one.metric}", code="E601")
    return tuple(ordered)


def check_columns(con: duckdb.DuckDBPyConnection, relation: Relation) -> None:
    """Raise SqlError E602 unless the query returns exactly the declared columns, in order."""
    returned = [row[0] for row in con.execute(f"describe {relation.sql}").fetchall()]
    if relation.is_graph:
        returned = [_OF_GRAPHS.get(column, column) for column in returned]
    if returned != list(relation.columns):
        raise SqlError(
            f"{relation.name}: declared columns differ from those returned",
            code="E602",
            where=Where(str(relation.path)),
            why=f"declared {list(relation.columns)}, returned {returned}",
        )


def _names(text: str) -> tuple[str, ...]:
    return tuple(n.strip() for n in text.split(",") if n.strip())
