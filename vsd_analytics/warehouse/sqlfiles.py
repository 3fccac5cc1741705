"""Loader of the SQL files: one relation per file, with a header that is parsed and checked.

```sql
-- name: facts/episodes
-- One row per ...                          (what a row is, one sentence; more sentences may follow)
-- unit: hour                               (facts only: hour, the default, or day)
-- stored_by: local_date                    (it has files by local_date, site_day or utc_day; see `day_files`)
-- graph: ...                               (staging only: rows are the connected components of the query's edges)
-- grain: camera_id, ...
-- reads: pairs, instants
-- params: distance_mm
-- columns:
--   duration_s   seconds; ...
-- figure: M10 Duration of violations       (for each figure of the catalogue that is computed from it)
--   definition   ...                       (and so on: `FIGURE_FIELDS`; a long text continues on the next line)
-- steps:
--   halves       ...                       (why a hard step of the query is there; the names are those of its CTEs)
-- assumes: ...                             (what the query takes for granted, or decides for the reader)
```

The header is not part of the fingerprint of facts, the query below it is, comments included. Explain in the header:
a changed comment in a query makes all facts stale and warns of every sealed hour.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from vsd_analytics.errors import SqlError, Where
from vsd_analytics.resources import shipped

if TYPE_CHECKING:
    import duckdb

LAYERS = ("staging", "facts", "marts", "tables", "audits", "exports")
FIGURE_FIELDS = ("definition", "unit", "denominator", "needs", "uncertainty", "by")
_IDENTIFIER = re.compile(r"^[a-z][a-z0-9_]*$")
_FIELD = re.compile(r"^-- (name|unit|stored_by|kept|graph|grain|reads|params|columns|figure|steps|assumes): ?(.*)$")
_CTE = re.compile(r"^(?:with (?:recursive )?)?([a-z][a-z0-9_]*) as (?:materialized )?\($", re.MULTILINE)
_OF_GRAPHS = {"node_a": "node", "node_b": "component"}
_COLUMN = re.compile(r"^--   ([a-z][a-z0-9_]*)(?:\s+(.*))?$")
_CONTINUATION = re.compile(r"^-- {4,}(\S.*)$")
_FIGURE = re.compile(r"^(M\d{1,2}) (\S.*)$")


@dataclass(frozen=True, slots=True)
class FigureHeader:
    """A figure of the catalogue, as described in the header of the relation it is computed from.

    Attributes:
        metric: Its number in the catalogue, such as M7.
        name: Its name in reports and docs.
        definition: What is computed.
        unit: Unit of the value.
        denominator: What it is divided by, or counted out of.
        needs: The least data it needs.
        uncertainty: Its interval or test, or why it has none.
        by: Full dotted name of the Python function that computes it.
        relation: Layer and name of the relation, such as "marts/violations".
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
        layer: "staging", "facts", "marts", "tables", "audits" or "exports".
        name: Relation name, the file's stem.
        description: What a row is.
        unit: "hour" or "day" (facts).
        stored_by: Kind of day of its files: "local_date" or "site_day" (a column of the mart, which has week files), or
            "utc_day" (of a fact, on days with sealed hours); empty = its rows are computed when a query names it.
        is_graph: The query returns edges; the relation is their connected components (`graphs.components`).
        grain: Columns that identify a row.
        reads: Relations it reads, except `params`.
        params: Columns of `params` it uses.
        columns: Documentation by column, in the order returned.
        figures: Figures of the catalogue that are computed from it.
        steps: Why a hard step is there, by name of the query's CTE.
        assumes: What it takes for granted.
        sql: The query.
        path: The file.
    """

    layer: str
    name: str
    description: str
    unit: str
    stored_by: str
    is_graph: bool
    grain: tuple[str, ...]
    reads: tuple[str, ...]
    params: tuple[str, ...]
    columns: Mapping[str, str]
    figures: tuple[FigureHeader, ...]
    steps: Mapping[str, str]
    assumes: str
    sql: str
    path: Path


@cache
def relations(*layers: str) -> Mapping[str, Relation]:
    """Return the relations of some layers by name, each after the relations it reads.

    Args:
        layers: Some of `LAYERS`.

    Raises:
        SqlError: E601, a header is incomplete or relations read each other in a circle.
    """
    paths = [path for layer in layers for path in sorted((shipped("sql") / layer).glob("*.sql"))]
    known = {r.name: r for r in map(_shipped_relation, paths)}
    ordered: dict[str, Relation] = {}

    def add(name: str, path: tuple[str, ...]) -> None:
        if name in path:
            raise SqlError(f"SQL relations read each other in a circle: {' -> '.join((*path, name))}", code="E601")
        if name in ordered or name not in known:
            return
        for needed in () if known[name].layer == "tables" else known[name].reads:  # a table may have its mart's name
            add(needed, (*path, name))
        ordered[name] = known[name]

    for name in known:
        add(name, ())
    return ordered


@cache
def _shipped_relation(path: Path) -> Relation:
    return read_relation(path)


RECORD_RELATIONS = ("located", "pairs")
"""Relations of `sql/staging` that a query may name: where people were, and who was near whom. They have a row for each
record, so they are not stored: they are computed from the records of the range when a query names them."""


@cache
def queried_relations() -> Mapping[str, Relation]:
    """Return the relations that a query may name, by name: `RECORD_RELATIONS`, facts and marts."""
    of_records = relations("staging", "facts")
    return {**{name: of_records[name] for name in RECORD_RELATIONS}, **relations("facts", "marts")}


def reached(names: Iterable[str], goes_on: Callable[[Relation], bool]) -> list[Relation]:
    """Return the facts and marts among some names and what they read, behind relations that `goes_on` is true for."""
    known, queue = relations("facts", "marts"), list(names)
    needed: dict[str, Relation] = {}
    while queue:
        name = queue.pop()
        if name in known and name not in needed:
            needed[name] = known[name]
            queue += known[name].reads if goes_on(known[name]) else ()
    return list(needed.values())


def facts_behind(names: Iterable[str]) -> frozenset[str]:
    """Return the hourly facts whose files are read for some relations: facts among these, and those that marts read.

    Facts that other facts are computed with are not among them; so nothing is written that nobody asked for.
    """
    needed = reached(names, lambda r: r.layer == "marts")
    return frozenset(r.name for r in needed if r.layer == "facts" and r.unit == "hour")


def marts_by_day(names: Iterable[str]) -> list[Relation]:
    """Return the marts with week files that relations read, or are, not those behind others with week files."""
    stored_names = {r.name for r in reached(names, lambda r: r.layer == "marts" and not r.stored_by) if r.stored_by}
    return [r for r in relations("marts").values() if r.name in stored_names]


def read_relation(path: Path) -> Relation:
    """Parse one SQL file.

    Raises:
        SqlError: E601, the header is incomplete or has a line that is not understood.
    """
    text = path.read_text(encoding="utf-8")
    fields: dict[str, str] = {}
    columns: dict[str, str] = {}
    steps: dict[str, str] = {}
    figures: list[dict[str, str]] = []
    description: list[str] = []
    current = ""
    entries: dict[str, str] | None = None  # of the field that the lines belong to, if it has entries
    body_start = 0
    for number, line in enumerate(text.splitlines(keepends=True), start=1):
        if not line.startswith("--"):
            break
        body_start += len(line)
        if match := _FIELD.match(line.rstrip()):
            current = match[1]
            fields[current] = match[2].strip()
            entries = {"columns": columns, "steps": steps}.get(current)
            if current == "figure":
                named = _FIGURE.match(fields[current])
                if named is None:
                    raise _not_understood(path, number, line)
                entries = {"metric": named[1], "name": named[2]}
                figures.append(entries)
        elif entries is not None and (entry := _COLUMN.match(line.rstrip())) and _is_entry(current, entry[1]):
            entries[entry[1]] = (entry[2] or "").strip()
        elif entries and current != "columns" and (rest := _CONTINUATION.match(line.rstrip())):
            entries[next(reversed(entries))] += f" {rest[1]}"
        elif current in ("reads", "params") and (rest := _CONTINUATION.match(line.rstrip())):
            fields[current] += f" {rest[1]}"
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
    sql = text[body_start:].strip().rstrip(";")
    if unknown := steps.keys() - set(_CTE.findall(sql)):
        why = f"the query has no step {', '.join(sorted(unknown))}"
        raise SqlError("the header explains steps that do not exist", code="E601", where=Where(str(path), 1), why=why)
    if layer != path.parent.name or name != path.stem or not _IDENTIFIER.match(name):
        raise SqlError(
            "the name in the header is not that of the file and its folder", code="E601", where=Where(str(path), 1)
        )
    return Relation(
        layer,
        name,
        " ".join(description),
        fields.get("unit", "hour"),
        fields.get("stored_by", fields.get("kept", "")),  # `kept` is the spelling of version 1
        "graph" in fields,
        _names(fields["grain"]),
        _names(fields["reads"]),
        _names(fields.get("params", "")),
        columns,
        tuple(FigureHeader(**f, relation=f"{layer}/{name}") for f in figures),
        steps,
        fields.get("assumes", ""),
        sql,
        path,
    )


def _is_entry(field: str, name: str) -> bool:
    return field != "figure" or name in FIGURE_FIELDS


def _not_understood(path: Path, number: int, line: str) -> SqlError:
    return SqlError("a header line is not understood", code="E601", where=Where(str(path), number, line.rstrip()))


def figure_headers() -> tuple[FigureHeader, ...]:
    """Return the figures of the catalogue in order, from the headers of facts and marts.

    Raises:
        SqlError: E601, a header cannot be parsed, or two headers describe the same figure.
    """
    headers = [f for relation in relations("facts", "marts").values() for f in relation.figures]
    ordered = sorted(headers, key=lambda f: (int(f.metric[1:]), f.relation))
    for one, other in pairwise(ordered):
        if one.metric == other.metric:
            raise SqlError(f"{one.relation} and {other.relation} both describe {one.metric}", code="E601")
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
