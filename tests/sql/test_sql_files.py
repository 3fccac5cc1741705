"""The SQL files follow their headers, the portable subset, and the style."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from given_expect import all_relations, inputs

from vsd_analytics.errors import SqlError
from vsd_analytics.warehouse.sqlfiles import Relation, check_columns, read_relation, relations

RELATIONS = all_relations()
PORTABLE = [r for r in RELATIONS if r.layer in ("staging", "facts")]
_NOT_PORTABLE = {
    "cast by ::": r"::",
    "qualify": r"\bqualify\b",
    "group by all": r"\bgroup by all\b",
    "date_trunc": r"\bdate_trunc\b",
    "strftime": r"\bstrftime\b",
    "time zones": r"\bat time zone\b",
    "integer division": r"//",
    "asof join": r"\basof\b",
    "decimal literals": r"(?<!percentile_cont\()(?<![\w.])\d+\.\d+",
    "star": r"select\s+\*|\w\.\*",
    "approximations": r"\bapprox_",
    "columns by exclusion": r"\bexclude\b",
}
_CLOCK_OR_CHANCE = r"\b(now|random|uuid|get_current_\w+|today|setseed)\s*\(|\bcurrent_\w+"

by_name = pytest.mark.parametrize("relation", RELATIONS, ids=lambda r: f"{r.layer}/{r.name}")


def _body(relation: Relation) -> str:
    """Return a query without comments and text literals."""
    return re.sub(r"'[^']*'", "''", re.sub(r"--.*", "", relation.sql))


def _ctes(body: str) -> set[str]:
    return set(re.findall(r"(?:\bwith|\),)\s+(?:recursive\s+)?(\w+) as (?:materialized )?\(", body))


@by_name
def test_header_names_every_relation_read(relation: Relation) -> None:
    body = _body(relation)
    read = set(re.findall(r"\b(?:from|join)\s+([a-z_]\w*)", body)) - _ctes(body)
    assert read - {"params"} == set(relation.reads)


@by_name
def test_header_names_every_param_used(relation: Relation) -> None:
    body = _body(relation)
    aliases = {"params", *re.findall(r"\bparams as (\w+)", body)}
    used = {c for a in aliases for c in re.findall(rf"\b{a}\.(\w+)", body)}
    assert used == set(relation.params)
    assert bool(relation.params) == bool(re.search(r"\b(?:from|join) params\b", body))


@by_name
def test_declared_columns_are_returned_in_order_and_explained(relation: Relation) -> None:
    with inputs(*relation.reads) as con:
        check_columns(con, relation)
    assert set(relation.grain) <= set(relation.columns)
    plain = {"camera_id", "floor_id", "local_date"}
    assert [c for c, told in relation.columns.items() if not told and c not in plain] == []


def test_a_wrong_column_is_noticed(tmp_path: Path) -> None:
    folder = tmp_path / "marts"
    folder.mkdir()
    (folder / "one.sql").write_text(
        "-- name: marts/one\n-- One row.\n-- grain: a\n-- reads: cameras\n-- columns:\n--   b  what\n"
        "-- assumes: nothing\nselect camera_id as a from cameras\n"
    )
    with inputs() as con, pytest.raises(SqlError, match="declared columns differ"):
        check_columns(con, read_relation(folder / "one.sql"))


@pytest.mark.parametrize("lacking", ["grain", "reads", "assumes", "columns"])
def test_an_incomplete_header_is_refused_by_name(tmp_path: Path, lacking: str) -> None:
    folder = tmp_path / "marts"
    folder.mkdir()
    header = {
        "grain": "-- grain: a\n",
        "reads": "-- reads: cameras\n",
        "columns": "-- columns:\n--   a  what\n",
        "assumes": "-- assumes: nothing\n",
    }
    text = (
        "-- name: marts/one\n-- One row.\n" + "".join(v for k, v in header.items() if k != lacking) + "select 1 as a\n"
    )
    (folder / "one.sql").write_text(text)
    with pytest.raises(SqlError, match=lacking):
        read_relation(folder / "one.sql")


def _one(tmp_path: Path, *lines: str) -> Path:
    """Write a relation with two steps and some lines more in its header."""
    folder = tmp_path / "marts"
    folder.mkdir()
    header = ["name: marts/one", "One row.", "grain: a", "reads: cameras", "columns:", "  a  what", *lines]
    query = (
        "with first as (\n    select 1 as a\n),\n\nsecond as (\n    select a from first\n)\n\nselect a from second\n"
    )
    path = folder / "one.sql"
    path.write_text("".join(f"-- {line}\n" for line in [*header, "assumes: nothing"]) + query)
    return path


def test_a_header_explains_steps_of_its_query(tmp_path: Path) -> None:
    path = _one(tmp_path, "steps:", "  first   one number", "          of many", "  second  the same")
    assert read_relation(path).steps == {"first": "one number of many", "second": "the same"}


def test_a_step_that_the_query_lacks_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(SqlError, match="steps that do not exist") as caught:
        read_relation(_one(tmp_path, "steps:", "  third  gone"))
    assert "third" in str(caught.value.why)


def test_the_fingerprint_does_not_cover_what_a_header_explains(tmp_path: Path) -> None:
    explained = read_relation(_one(tmp_path, "steps:", "  first  one number"))
    assert "one number" not in explained.sql
    assert explained.sql.startswith("with first as (")


@pytest.mark.parametrize("key", ["stored_by", "kept"])
def test_both_spellings_of_the_day_a_relation_is_stored_by_are_read(tmp_path: Path, key: str) -> None:
    assert read_relation(_one(tmp_path, f"{key}: local_date")).stored_by == "local_date"


@by_name
def test_no_clock_and_no_chance(relation: Relation) -> None:
    assert not re.search(_CLOCK_OR_CHANCE, _body(relation), re.IGNORECASE)


@by_name
def test_one_statement_without_markers(relation: Relation) -> None:
    assert ";" not in _body(relation)
    assert not re.search(r"[{}$?]", _body(relation))


@pytest.mark.parametrize("relation", PORTABLE, ids=lambda r: f"{r.layer}/{r.name}")
@pytest.mark.parametrize("what", _NOT_PORTABLE)
def test_facts_keep_to_the_portable_subset(relation: Relation, what: str) -> None:
    assert not re.search(_NOT_PORTABLE[what], _body(relation), re.IGNORECASE)


@pytest.mark.parametrize("relation", [r for r in RELATIONS if r.layer != "staging"], ids=lambda r: r.name)
def test_delivered_rows_are_ordered(relation: Relation) -> None:
    assert re.search(r"\norder by [^()]*$", relation.sql)


@pytest.mark.parametrize("relation", [r for r in RELATIONS if r.layer == "marts"], ids=lambda r: r.name)
def test_marts_name_their_columns(relation: Relation) -> None:
    assert not re.search(r"select\s+\*|\w\.\*", _body(relation))


def test_names_are_unique_over_layers() -> None:
    names = [r.name for r in RELATIONS if r.layer != "tables"]  # a query names these internal.NAME where both exist
    assert len(names) == len(set(names))


def test_a_relation_comes_after_what_it_reads() -> None:
    order = list(relations("staging", "facts"))
    for relation in relations("staging", "facts").values():
        for read in relation.reads:
            assert read not in order or order.index(read) < order.index(relation.name)


@by_name
def test_the_state_of_a_recording_is_decided_by_one_rule(relation: Relation) -> None:
    """`recording_state`: four files once had it, two by seconds and two by shares."""
    assert not re.search(r"then\s+'(low_data|no_data)'", re.sub(r"--.*", "", relation.sql))
