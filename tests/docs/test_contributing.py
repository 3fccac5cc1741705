"""CONTRIBUTING.md is held to the code: its examples are applied, its paths exist; rooms and words have their page."""

from __future__ import annotations

import re
import sys
import types
from pathlib import Path

import duckdb
import pytest
from pages import REPOSITORY, blocks

from vsd_analytics import settings
from vsd_analytics.ingest import pipeline
from vsd_analytics.ingest.adapter import IngestOptions, Source
from vsd_analytics.warehouse import sqlfiles

PAGE = REPOSITORY / "CONTRIBUTING.md"
TEXT = PAGE.read_text(encoding="utf-8")


def example(mark: str) -> str:
    """Return the block after the comment `<!-- mark -->`, without the indent of its list."""
    found = re.search(rf"^ *<!-- {mark} -->\n( *)```\w+\n(.*?)^ *```$", TEXT, re.M | re.S)
    assert found, mark
    return re.sub(rf"^{found[1]}", "", found[2], flags=re.M)


def test_every_path_of_the_page_exists_but_those_of_the_examples() -> None:
    made_by_examples = {
        "vsd_analytics/ingest/acme.py",
        "sql/marts/long_violations.sql",
        "vsd_analytics/figures/catalogue/long_violations.py",
        "tests/sql/long_violations.toml",
    }
    paths = set(re.findall(r"`((?:vsd_analytics|sql|tests|docs|reports)/[\w./]*)`", TEXT))
    assert len(paths) > 25
    assert {p for p in paths if not (REPOSITORY / p).exists()} == made_by_examples


def test_the_adapter_example_reads_its_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("vsd_analytics.ingest.acme")
    exec(compile(example("adapter"), "acme.py", "exec"), module.__dict__)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(pipeline, "ADAPTERS", {**pipeline.ADAPTERS, "acme": ("acme", "Acme", {})})
    monkeypatch.setattr(pipeline, "_DETECTED", ("acme", *pipeline._DETECTED))
    path = tmp_path / "hall.txt"
    path.write_text("#acme 1\n0.5;p1;1.25;3\nnonsense\n1.5;p1;1.5;3\n", encoding="utf-8")
    options = IngestOptions(camera="cam-1")

    adapter = pipeline.find_adapter(Source(path), options)
    (batch,) = adapter.read(Source(path), options)

    assert adapter.name == "acme"
    assert batch.table("observations").select(["camera", "ts_ms", "x_m"]).to_pylist() == [
        {"camera": "cam-1", "ts_ms": 500, "x_m": 1.25},
        {"camera": "cam-1", "ts_ms": 1500, "x_m": 1.5},
    ]
    assert [(r.line, r.reason) for r in batch.rejected] == [(3, "not-a-number")]


def test_the_setting_example_is_one_line_of_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    source = Path(settings.__file__).read_text(encoding="utf-8")
    opening = "SETTINGS: tuple[Setting, ...] = (\n"
    assert opening in source
    copy = types.ModuleType("settings_copy")
    monkeypatch.setitem(sys.modules, copy.__name__, copy)  # dataclasses look their module up
    exec(compile(source.replace(opening, opening + example("setting")), "settings.py", "exec"), copy.__dict__)

    assert set(copy.BY_NAME) - set(settings.BY_NAME) == {"long_violation_s"}
    assert copy.Settings().long_violation_s == copy.BY_NAME["long_violation_s"].default == 60.0
    assert copy.Settings().with_values({"long_violation_s": 30.0}).non_default() == {"long_violation_s": 30.0}


def test_the_figure_example_defines_and_computes_a_figure(tmp_path: Path) -> None:
    path = tmp_path / "marts" / "long_violations.sql"
    path.parent.mkdir()
    path.write_text(example("figure"), encoding="utf-8")

    relation = sqlfiles.read_relation(path)

    assert [f.metric for f in relation.figures] == ["M30"]
    assert "M30" not in {f.metric for f in sqlfiles.figure_headers()}
    assert set(relation.reads) <= set(sqlfiles.relations("marts"))
    assert {"floor_id", "local_date", "duration_s", "is_open"} <= set(sqlfiles.relations("marts")["violations"].columns)
    with duckdb.connect() as con:
        con.execute(
            "create table violations as select 'ground' as floor_id, * from (values ('mon', 59.9, true), "
            "('mon', 60.0, true), ('tue', 75.0, true), ('tue', 90.0, false)) as v (local_date, duration_s, is_open)"
        )
        sqlfiles.check_columns(con, relation)
        assert con.execute(relation.sql).fetchall() == [("ground", "mon", 1, 60), ("ground", "tue", 1, 75)]


def test_the_relation_of_params_is_where_the_page_says() -> None:
    assert "params" in (REPOSITORY / "vsd_analytics/warehouse/dimensions.py").read_text(encoding="utf-8")


def test_every_room_has_its_line_in_the_architecture() -> None:
    page = (REPOSITORY / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = page.partition("## The rooms")[2].partition("\nOther folders")[0]
    listed = re.findall(r"^\| `(\w+)/?` \|", table, re.M)
    folders = {p.name for p in (REPOSITORY / "vsd_analytics").iterdir() if p.is_dir() and any(p.glob("*.py"))}
    assert listed[0] == "base"
    assert set(listed[1:]) == folders
    assert len(listed) == len(set(listed))


def test_rooms_are_listed_in_the_order_of_imports() -> None:
    source = (REPOSITORY / "tests" / "test_architecture.py").read_text(encoding="utf-8")
    order = re.findall(r'"(\w+)"', source.partition("ROOMS = (")[2].partition("\n)\n")[0])
    page = (REPOSITORY / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)/?` \|", page.partition("## The rooms")[2].partition("\nOther")[0], re.M) == order


def test_contributing_has_no_block_that_no_test_reads() -> None:
    assert [b.language for b in blocks(PAGE) if b.language == "python"] == []  # examples are indented, within a list


def test_make_check_names_folders_and_files_that_exist() -> None:
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    fast = re.search(r"FAST := \$\(addprefix tests/, (.*?)\)\n\n", makefile, re.S)
    assert fast
    names = fast[1].replace("\\\n", " ").split()
    assert len(names) >= 5
    assert [n for n in names if not (REPOSITORY / "tests" / n).exists()] == []
