"""CONTRIBUTING.md is held to the code: its examples are applied, its paths exist; rooms and words have their page."""

from __future__ import annotations

import importlib
import re
import sys
import textwrap
import types
from collections.abc import Iterator
from datetime import date
from pathlib import Path

import duckdb
import generate_reference as reference
import pytest
from markdown_pages import REPOSITORY, blocks
from site_text import site_text

from vsd_analytics import settings
from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Value
from vsd_analytics.ingest.formats import adapters, recognise
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.render.text import text
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
        "vsd_analytics/ingest/formats/acme.py",
        "sql/marts/long_violations.sql",
        "vsd_analytics/figures/catalogue/long_violations.py",
        "vsd_analytics/render/markdown.py",
        "tests/sql/long_violations.toml",
    }
    paths = set(re.findall(r"`((?:vsd_analytics|sql|tests|docs|reports)/[\w./]*)`", TEXT))
    assert len(paths) > 25
    assert {p for p in paths if not (REPOSITORY / p).exists()} == made_by_examples


def test_the_adapter_example_reads_its_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("vsd_analytics.ingest.formats.acme")
    exec(compile(example("adapter"), "acme.py", "exec"), module.__dict__)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(adapters.SPECIFIC, "acme", "vsd_analytics.ingest.formats.acme:Acme")
    path = tmp_path / "hall.txt"
    path.write_text(
        "#acme 1\n2025-11-10T09:00:00Z;2;p1@1.25,3 p2@far,3\nnonsense\n2025-11-10T09:00:01Z;0;\n"
        "2025-11-10T09:00:02Z;2;p1@1.5,3 p2@2,3.5",
        encoding="utf-8",
    )
    options = IngestOptions(camera="cam-1")

    adapter = recognise.find_adapter(Source(path), options)
    (batch,) = adapter.read(Source(path), options)

    assert adapter.name == "acme"
    start_ms = 1_762_765_200_000
    assert batch.table("frames").select(["ts_ms", "n_persons"]).to_pylist() == [
        {"ts_ms": start_ms, "n_persons": 2},
        {"ts_ms": start_ms + 1000, "n_persons": 0},
        {"ts_ms": start_ms + 2000, "n_persons": 2},
    ]
    assert batch.table("observations").select(["camera", "track", "x_m"]).to_pylist() == [
        {"camera": "cam-1", "track": "p1", "x_m": 1.25},
        {"camera": "cam-1", "track": "p1", "x_m": 1.5},
        {"camera": "cam-1", "track": "p2", "x_m": 2.0},
    ]
    assert [(r.line, r.reason) for r in batch.rejected] == [(2, "not-a-number"), (3, "wrong-number-of-fields")]


@pytest.fixture
def with_the_setting() -> Iterator[types.ModuleType]:
    """The settings with the page's example; within the test the whole package is imported anew and reads them."""
    package = "vsd_analytics"
    before = {name: module for name, module in sys.modules.items() if name.split(".")[0] == package}
    source = Path(settings.__file__).read_text(encoding="utf-8")
    opening = "    # fmt: off\n"
    assert source.count(opening) == 1
    changed = types.ModuleType(settings.__name__)
    for name in before:
        del sys.modules[name]
    try:
        sys.modules[settings.__name__] = changed  # dataclasses look their module up
        text = source.replace(opening, opening + textwrap.indent(example("setting"), " " * 4))
        exec(compile(text, "settings.py", "exec"), changed.__dict__)
        yield changed
    finally:
        for name in [n for n in sys.modules if n.split(".")[0] == package]:
            del sys.modules[name]
        sys.modules.update(before)


def test_the_setting_example_is_one_line_of_one_file(with_the_setting: types.ModuleType, tmp_path: Path) -> None:
    """All that reads the table knows the setting: vsd.toml, environment, doctor, manual, SQL, and the reports' id."""
    from vsd_analytics.config.project import load_site
    from vsd_analytics.doctor.checks import settings_in_force
    from vsd_analytics.warehouse.dimensions import params

    assert set(with_the_setting.BY_NAME) - set(settings.BY_NAME) == {"long_violation_s"}
    assert with_the_setting.DEFAULTS.settings_id() != settings.DEFAULTS.settings_id()
    (tmp_path / "vsd.toml").write_text(site_text() + "[rule]\nlong_violation_s = 30\n", encoding="utf-8")
    site = load_site(tmp_path)
    assert site.settings.non_default() == {"long_violation_s": 30.0}
    assert params(site)["long_violation_ms"] == 30_000
    assert load_site(tmp_path, environ={"VSD_LONG_VIOLATION_S": "40"}).settings.long_violation_s == 40.0  # type: ignore[attr-defined]
    assert [s.source for s in settings_in_force(site) if s.name == "long_violation_s"] == [
        f"vsd.toml line {_lines(tmp_path)}"
    ]
    row = "| `long_violation_s` | `60.0` | seconds | 0 to 3,600 | Violations at least this long count as long. |"
    assert row in reference.settings_markdown()


def _lines(folder: Path) -> int:
    return len((folder / "vsd.toml").read_text(encoding="utf-8").splitlines())


def test_the_figure_example_defines_and_computes_a_figure(tmp_path: Path) -> None:
    path = tmp_path / "marts" / "long_violations.sql"
    path.parent.mkdir()
    path.write_text(example("figure"), encoding="utf-8")

    relation = sqlfiles.read_relation(path)

    assert [f.metric for f in relation.figures] == ["M99"]
    assert "M99" not in {f.metric for f in sqlfiles.figure_headers()}
    assert set(relation.reads) <= set(sqlfiles.relations("marts"))
    assert {"floor_id", "local_date", "duration_s", "is_open"} <= set(sqlfiles.relations("marts")["violations"].columns)
    with duckdb.connect() as con:
        con.execute("create table params as select 30000 as episode_min_ms")
        con.execute(
            "create table violations as select 'ground' as floor_id, * from (values ('mon', 59.9, true), "
            "('mon', 60.0, true), ('tue', 75.0, true), ('tue', 90.0, false)) as v (local_date, duration_s, is_open)"
        )
        sqlfiles.check_columns(con, relation)
        rows = sorted(con.execute(relation.sql).fetchall())
        assert rows == [("ground", "mon", 1, 60), ("ground", "tue", 1, 75)]


def test_the_output_column_example_is_one_line_of_one_file() -> None:
    """The line takes the place of the list that begins alike, and text shows the column."""
    visits = importlib.import_module("vsd_analytics.cli.visits")
    LAYOUTS = visits.LAYOUTS

    path = REPOSITORY / "vsd_analytics/cli/visits.py"
    layout = eval(example("output-column").strip().rstrip(","), vars(visits))
    (shown,) = [s.columns for s in LAYOUTS["visits"] if s.columns[:2] == layout.columns[:2]]
    assert set(layout.columns) - set(shown) == {"n_followed"}
    assert set(shown) < set(layout.columns)
    assert 'TableLayout(("name", "n_visits", ' in path.read_text(encoding="utf-8")
    printed = text(visits_answer(), (layout,))
    assert "followed" in printed[0]
    assert printed[1].split()[:3] == ["Door", "12", "9"]


def test_the_renderer_example_renders_an_answer_it_never_saw() -> None:
    module = types.ModuleType("vsd_analytics.render.markdown")
    exec(compile(example("renderer"), "markdown.py", "exec"), module.__dict__)
    lines = module.markdown(visits_answer()).splitlines()
    assert lines[0] == "| area | name | visits seen | followed | share |"
    assert lines[1] == "| --- | --- | --- | --- | --- |"
    assert lines[2] == "| door | Door | 12 | 9 | \u2013 |"


def visits_answer() -> Answer:
    columns = (
        Column("area_id", "key"),
        Column("name", "fact"),
        Column("n_visits", "count"),
        Column("n_followed", "count", audience="operator"),
        Column("route_share", "share"),
    )
    row = {
        "area_id": "door",
        "name": "Door",
        "n_visits": Value(12),
        "n_followed": Value(9),
        "route_share": Value.missing(Reason("nobody.seen")),
    }
    return Answer("visits", columns, (row,), HoldsFor("shop", "ground", date(2026, 11, 9), date(2026, 11, 15)))


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


def test_the_page_of_the_tests_names_every_folder_of_tests_and_no_other() -> None:
    folder = REPOSITORY / "tests"
    page = (folder / "README.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`(\w+)/`", page.partition("\n## Run")[0])) - {"vsd_analytics", "site"}
    there = {p.relative_to(folder) for p in folder.rglob("*.py")}
    assert {p.parts[0] for p in there if len(p.parts) > 1} <= named
    assert named <= {part for p in there for part in p.parts[:-1]}


def test_every_room_with_code_has_a_folder_of_tests() -> None:
    rooms = {p.name for p in (REPOSITORY / "vsd_analytics").iterdir() if p.is_dir() and any(p.glob("*.py"))}
    without = {room for room in rooms if not list((REPOSITORY / "tests" / room).rglob("test_*.py"))}
    assert without == {"site"}, "site/ has only value types, which tests/config/ reads"


def test_contributing_has_no_block_that_no_test_reads() -> None:
    assert [b.language for b in blocks(PAGE) if b.language == "python"] == []  # examples are indented, within a list


@pytest.mark.parametrize("variable", ["FAST", "SLOW"])
def test_make_check_names_folders_and_files_that_exist(variable: str) -> None:
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    listed = re.search(variable + r" := \$\(addprefix tests/, (.*?)\)\n\n", makefile, re.S)
    assert listed
    names = listed[1].replace("\\\n", " ").split()
    assert len(names) >= 5
    assert [n for n in names if not (REPOSITORY / "tests" / n).exists()] == []
