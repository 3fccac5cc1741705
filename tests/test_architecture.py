"""Rooms import in one direction, nothing imports in a circle, and names say where a reader is."""

from __future__ import annotations

import ast
import importlib
import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

from vsd_analytics.wording.catalogue import catalogue

PACKAGE = Path(__file__).resolve().parent.parent / "vsd_analytics"

# From the lowest room to the highest: a module imports from its own room and those before it, inside functions too.
ROOMS = (
    *("base", "store", "site", "geometry", "config", "ingest", "stats", "engine", "warehouse", "cluster", "retention"),
    *("figures", "whatif", "wording", "render", "report", "planner", "calibration_page", "site_index", "service"),
    "api",
    *("simulate", "live", "doctor", "cli"),
)
BASE = {"answer", "errors", "owners", "resources", "schema", "settings", "version"}
"""Modules of no room, which every room may import. `__init__` is the public API and names modules of all rooms."""
SAYS_NOTHING = {
    "common",
    "converted",
    "helpers",
    "misc",
    "more",
    "other",
    "shared",
    "stuff",
    "tools",
    "utils",
}
LONGEST = 450
INGEST = {"reading": set(), "formats": {"reading"}, "checks": {"reading"}, "intake": {"reading", "formats", "checks"}}
"""Folders of ingest/, and the other ones that each imports, as its docstring says."""
ENTRANCES = {"vsd_analytics", "vsd_analytics.cli"}
"""Packages whose `__init__` is the door of the program: the public API, and the command line."""
REPORT = "vsd_analytics.report"


def modules() -> Iterator[tuple[str, Path]]:
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


KNOWN = dict(modules())


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def nodes(tree: ast.AST) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(tree))


def is_for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def imports(path: Path, *, with_types: bool = True) -> set[str]:
    """Return the modules of the package that a file imports anywhere, inside functions and, if asked, for types."""
    found: set[str] = set()
    of_file = nodes(parsed(path))
    skipped = {id(n) for node in of_file if is_for_types(node) for n in ast.walk(node)}
    for node in of_file:
        if not with_types and id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            found.update(a.name for a in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{a.name}" for a in node.names}
            found |= {m for m in inner if m in KNOWN} or {node.module}
    return found & KNOWN.keys()


def room(module: str) -> str:
    parts = module.replace(".__main__", ".cli").split(".")  # `python -m vsd_analytics` is the command line
    return parts[1] if len(parts) > 1 and parts[1] in ROOMS else "base"


def test_a_variable_is_named_for_its_content() -> None:
    """Words that say only that there is something; `of=` may be a parameter: a call reads as a sentence then."""
    empty = {"found", "made", "of", "said"}
    stored = {
        f"{name}:{node.lineno} {node.id}"
        for name, path in KNOWN.items()
        for function in nodes(parsed(path))
        if isinstance(function, ast.FunctionDef)
        for node in ast.walk(function)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id in empty
    }
    assert stored == set()


def test_every_module_is_in_a_room() -> None:
    loose = {name for name in KNOWN if room(name) == "base"} - {"vsd_analytics"}
    assert loose == {f"vsd_analytics.{name}" for name in BASE}


def test_rooms_import_in_one_direction() -> None:
    upward = {
        f"{name} imports {target}"
        for name, path in KNOWN.items()
        for target in imports(path)
        if name != "vsd_analytics" and ROOMS.index(room(target)) > ROOMS.index(room(name))
    }
    assert upward == set()


def test_the_report_goes_from_its_model_to_its_pages_and_never_back() -> None:
    """The model holds figures and codes: a story made while it is filled would be a second way to read it."""
    back = {
        f"{name} imports {target}"
        for name, path in KNOWN.items()
        for target in imports(path)
        if name.startswith(f"{REPORT}.model.") and target.startswith((f"{REPORT}.pages", f"{REPORT}.send"))
    }
    assert back == set()


def test_nothing_imports_in_a_circle_not_even_inside_functions() -> None:
    graph = {name: imports(path, with_types=False) for name, path in KNOWN.items() if name != "vsd_analytics"}
    assert circle_in(graph) is None


def test_no_package_is_in_a_circle_with_its_own_modules() -> None:
    """Importing `store.store` runs the package `store` first: that must not import `store.store` in turn."""
    graph = {
        name: {p for target in imports(path, with_types=False) for p in (target, *packages_of(target))}
        for name, path in KNOWN.items()
    }
    assert circle_in({name: targets - ENTRANCES for name, targets in graph.items() if name not in ENTRANCES}) is None


def packages_of(module: str) -> Iterator[str]:
    """Yield the packages that Python runs before a module, the innermost first."""
    while "." in module:
        module = module.rpartition(".")[0]
        yield module


def circle_in(graph: Mapping[str, Collection[str]]) -> str | None:
    """Return the first circle of imports, "a -> b -> a"; None = there is none."""
    done: set[str] = set()

    def visit(name: str, trail: tuple[str, ...]) -> str | None:
        if name in trail:
            return " -> ".join((*trail[trail.index(name) :], name))
        if name in graph and name not in done:
            for target in sorted(set(graph[name]) - {name}):
                if (circle := visit(target, (*trail, name))) is not None:
                    return circle
            done.add(name)
        return None

    return next((circle for name in graph if (circle := visit(name, ())) is not None), None)


def test_a_circle_through_a_package_is_found() -> None:
    assert circle_in({"a.b": {"a"}, "a": {"a.b"}}) == "a.b -> a -> a.b"
    assert circle_in({"a.b": {"a"}, "a": {"c"}, "c": set()}) is None


def test_the_folders_of_ingest_import_as_its_docstring_says() -> None:
    upward = {
        f"{name} imports {target}"
        for name, path in KNOWN.items()
        for target in imports(path)
        if (folder := ingest_folder(name)) and (imported := ingest_folder(target))
        if imported not in INGEST[folder] | {folder}
    }
    assert upward == set()
    kit = {name for name, path in KNOWN.items() if "vsd_analytics.ingest.testing" in imports(path)}
    assert kit == set()


def test_every_module_of_ingest_is_in_a_folder() -> None:
    loose = {name for name in KNOWN if room(name) == "ingest" and ingest_folder(name) is None}
    assert loose == {"vsd_analytics.ingest", "vsd_analytics.ingest.testing"}


def ingest_folder(module: str) -> str | None:
    parts = module.split(".")
    return parts[2] if len(parts) > 2 and parts[1] == "ingest" and parts[2] in INGEST else None


def test_only_the_switch_is_known_outside_the_accelerated_facts() -> None:
    folder = "vsd_analytics.warehouse.accelerated"
    known = {
        f"{name} imports {target}"
        for name, path in KNOWN.items()
        for target in imports(path)
        if target.startswith(folder) and not name.startswith(folder) and target != f"{folder}.switch"
    }
    assert known == set()


def test_lists_of_ids_are_compared_and_not_joined() -> None:
    """DuckDB takes `in (select unnest($ids))` for a join and holds the other side, which may be millions of cells.

    Five million rows of `planner_cells` took 570 MiB and four times as long as with `list_contains($ids, camera_id)`.
    """
    joined = re.compile(r"\bin\s*\(\s*select\s+unnest", re.IGNORECASE)
    texts = {*KNOWN.values(), *(PACKAGE.parent / "sql").rglob("*.sql")}
    assert [path.name for path in sorted(texts) if joined.search(path.read_text(encoding="utf-8"))] == []


def test_no_two_classes_have_one_name() -> None:
    places: defaultdict[str, list[str]] = defaultdict(list)
    for name, path in KNOWN.items():
        for node in nodes(parsed(path)):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(name)
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def compared_texts(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield the strings that code compares something with: ==, in, match, and the keys it looks up by name."""
    for node in nodes(tree):
        compared: list[ast.expr] = []
        match node:
            case ast.Compare():
                compared = [node.left, *node.comparators]
            case ast.MatchValue(value=value):
                compared = [value]
            case ast.Subscript(value=ast.Dict(keys=keys), slice=key):
                compared = [*(k for k in keys if k is not None), key]
        for part in compared:
            for inner in getattr(part, "elts", None) or getattr(part, "keys", None) or [part]:
                if isinstance(inner, ast.Constant) and isinstance(inner.value, str):
                    yield inner.lineno, inner.value


def test_code_compares_codes_and_never_sentences() -> None:
    """A text with a space is for people: a word that changes in it must not change what is computed."""
    prose = [
        f"{path.relative_to(PACKAGE)}:{line} compares {text!r}"
        for _, path in modules()
        for line, text in compared_texts(parsed(path))
        if " " in text.strip()
    ]
    assert prose == []


@pytest.mark.parametrize(
    "source", ['x == "clear fall"', '"a b" in x', 'x in ("a", "b c")', 'x not in {"a b": 1}', '{"a b": 1}[x]']
)
def test_a_compared_sentence_is_found(source: str) -> None:
    assert [text for _, text in compared_texts(ast.parse(source)) if " " in text]


SENTENCELESS = ("figures", "whatif", "stats", "planner", "answer.py")
"""What gives codes and leaves their words to the catalogue."""
SQL = re.compile(r"^\s*(select|from|where|and|inner join|left join|group by|order by|union)\b|\b(select|order by)\b")
HELP = {"_f", "described", "_o", "optional"}
"""Field helps: the documentation of the JSON file, which its schema gives in English."""


def prose(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield the texts with a space that code may hand on: no docstring, error, help, SQL, script or type."""
    skipped: set[int] = set()
    for node in nodes(tree):
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Raise() | ast.Assert():
                skipped |= {id(n) for n in ast.walk(node)}
            case ast.Call(func=ast.Name(id=name)) if name in HELP or name.endswith("Error"):
                skipped |= {id(n) for n in ast.walk(node)}
            case ast.AnnAssign(annotation=annotation):
                skipped |= {id(n) for n in ast.walk(annotation)}
                if isinstance(annotation, ast.Name) and annotation.id == "TypeAlias" and node.value is not None:
                    skipped.add(id(node.value))
    for node in nodes(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in skipped:
            is_prose = len(re.findall(r"[^\W\d_]{2,}", node.value)) > 1 and " " in node.value.strip()
            if is_prose and not SQL.search(node.value) and "'use strict'" not in node.value:
                yield node.lineno, node.value


def test_figures_and_planner_give_codes_and_no_words() -> None:
    """A sentence, the name of a row or a unit is an entry of reports/wording, in every language."""
    files = [
        p
        for name in SENTENCELESS
        for p in ([PACKAGE / name] if name.endswith(".py") else PACKAGE.glob(f"{name}/**/*.py"))
    ]
    found = {f"{path.relative_to(PACKAGE)}:{line} {text!r}" for path in files for line, text in prose(parsed(path))}
    assert found == set()


@pytest.mark.parametrize(
    "source",
    [
        'UNIT = "share of routes"',
        'rows.append({"what": "mean by tracks"})',
        'unit = f"outages of {n} minutes or more"',
        'Figure(unit="people in view, mean")',
        'def f(note="nobody was seen"): ...',
        'x = "violations and people from two areas where nobody waits"',
    ],
)
def test_a_sentence_below_the_page_is_found(source: str) -> None:
    assert list(prose(ast.parse(source)))


@pytest.mark.parametrize(
    "source",
    [
        '"""A docstring."""',
        'raise UsageError("a period is unknown", why="it is empty")',
        'x: int = _f("Hours recorded in both weeks.")',
        'rows("select day from hours")',
        'Reason("unit.M0")',
    ],
)
def test_documentation_errors_and_queries_are_no_sentences(source: str) -> None:
    assert not list(prose(ast.parse(source)))


def test_file_names_say_what_is_in_them() -> None:
    assert [str(p.relative_to(PACKAGE)) for p in KNOWN.values() if SAYS_NOTHING & set(p.stem.split("_"))] == []


def test_no_file_is_longer_than_a_reader_can_hold() -> None:
    long = {name: n for name, path in modules() if (n := len(path.read_text(encoding="utf-8").splitlines())) > LONGEST}
    assert long == {}


MASK = "vsd_analytics.figures.share"
DECISIONS = {"is_small", "held_back", "too_few", "share"}
"""Functions of the mask that no other room of it calls: others ask a `Mask`, a `HiddenWeek`, `audience_answers`."""


def hides_counts(path: Path) -> bool:
    """Tell whether a module decides what is hidden: it compares with `mask_below`, or uses what only the mask may."""
    for node in nodes(parsed(path)):
        is_of_mask = isinstance(node, ast.ImportFrom) and (node.module or "").startswith(MASK)
        if is_of_mask and DECISIONS & {alias.name for alias in node.names}:
            return True
        if isinstance(node, ast.Compare):
            read = {ast.unparse(n).split(".")[-1] for n in ast.walk(node) if isinstance(n, ast.Name | ast.Attribute)}
            if read & {"below", "mask_below"}:
                return True
    return False


def test_masking_is_in_one_folder_only() -> None:
    above = [name for name in KNOWN if ROOMS.index(room(name)) >= ROOMS.index("figures") and not name.startswith(MASK)]
    assert [name for name in above if hides_counts(KNOWN[name])] == []


def test_the_mask_itself_is_where_counts_are_compared() -> None:
    """Else the test above would hold because it sees nothing."""
    assert {name for name, path in KNOWN.items() if hides_counts(path)} >= {f"{MASK}.counts", f"{MASK}.weeks"}


def test_who_reads_the_limit_of_small_counts_makes_a_mask_or_says_it() -> None:
    reading = {
        name
        for name, path in KNOWN.items()
        if not name.startswith(MASK)
        for node in nodes(parsed(path))
        if isinstance(node, ast.Attribute) and node.attr == "mask_below" and "settings" in ast.unparse(node)
    }
    assert reading == {
        "vsd_analytics.figures.panels",  # makes a Mask
        "vsd_analytics.figures.week.density",
        "vsd_analytics.site_index.collect_reports",
        "vsd_analytics.service.answers",  # says it
    }


def test_renderers_know_no_figure() -> None:
    """They render any answer: what a figure is, and how it is counted, is below them."""
    rendering = {name: path for name, path in KNOWN.items() if room(name) == "render"}
    assert rendering
    for name, path in rendering.items():
        assert {room(target) for target in imports(path)} <= {"base", "store", "wording", "render"}, name
        texts = (n.value for n in nodes(parsed(path)) if isinstance(n, ast.Constant) and isinstance(n.value, str))
        assert [text for text in texts if re.search(r"\bM\d{1,2}\b", text)] == [], name


def computes(path: Path) -> list[str]:
    """Return what of a module is arithmetic on figures, or writes a table of its own: products, quotients, csv."""
    found = [
        ast.unparse(n) for n in nodes(parsed(path)) if isinstance(n, ast.BinOp) and isinstance(n.op, ast.Mult | ast.Div)
    ]
    found += [name for name in imports(path) if name == "csv"]
    calls = (n.func for n in nodes(parsed(path)) if isinstance(n, ast.Call))
    return found + [ast.unparse(f) for f in calls if isinstance(f, ast.Attribute) and f.attr == "position"]


def test_commands_that_print_answers_compute_nothing() -> None:
    """They choose the columns that are shown, and pass everything else on."""
    printing = {
        name: path for name, path in KNOWN.items() if room(name) == "cli" and "LAYOUTS" in path.read_text("utf-8")
    }
    assert len(printing) > 8
    assert {name: found for name, path in printing.items() if (found := computes(path))} == {}


OUTPUTS = ("report", "planner", "calibration_page", "site_index", "service", "api", "live", "doctor", "cli")
COMPUTE_OUTSIDE_FIGURES = {
    "vsd_analytics.api.asked_days": "hands on whole tables of sql/tables",
    "vsd_analytics.live.companions": "one rule on the people of this second, of whom nothing is stored yet",
    "vsd_analytics.planner.cell_counts": "packs counts by hour and cell, which the page's script adds up",
    "vsd_analytics.planner.script": "gives the script the factors of its intervals",
    "vsd_analytics.report.draw.funnel_chart": "draws a limit at every width: a curve has no rows",
    "vsd_analytics.report.pages.duckdb_file": "copies the calendar, and counts the rows that it wrote",
    "vsd_analytics.site_index.site_comparison": "reads the JSON files of other sites, which no warehouse has",
}
"""Modules of the outputs that call statistics or query facts, and why they may."""
SELECT = re.compile(r"^\s*(with\s+\w+\s+as\b.*)?select\b.*\bfrom\s+\w", re.IGNORECASE | re.DOTALL)


def makes_figures(tree: ast.AST) -> list[str]:
    """Return the functions of `stats/` that a module imports, and the queries of its own; types may be imported."""
    found = [
        f"{node.module}.{alias.name}"
        for node in nodes(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("vsd_analytics.stats")
        for alias in node.names
        if not alias.name[0].isupper()
    ]
    texts = (text for n in nodes(tree) if (text := _text(n)))
    return found + [text for text in texts if SELECT.search(text)]


def _text(node: ast.AST) -> str:
    """Return a text, an f-string with x for what is filled in; empty for all else."""
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(part) or "x" for part in node.values)
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def test_no_figure_is_computed_outside_figures() -> None:
    """Outputs render answers. A name on the list that computes nothing any more leaves it."""
    computing = {name for name, path in KNOWN.items() if room(name) in OUTPUTS and makes_figures(parsed(path))}
    assert computing == set(COMPUTE_OUTSIDE_FIGURES)


@pytest.mark.parametrize(
    "source",
    [
        "from vsd_analytics.stats.rates import violation_rate",
        "from vsd_analytics.stats import rates",
        "warehouse.rows('select sum(n) as n from hours')",
        "QUERY = 'with used as (select 1) select * from used'",
        "f'select {column} from hours'",
    ],
)
def test_a_figure_of_an_output_is_found(source: str) -> None:
    assert makes_figures(ast.parse(source))


def test_types_of_statistics_and_prose_are_no_figures() -> None:
    assert not makes_figures(ast.parse("from vsd_analytics.stats.usual import Position\nx = 'with joints'"))


def test_no_page_or_message_compares_a_day_with_its_usual_range() -> None:
    """Where a day lies is a property of the day: a page and a topic once compared different numbers with it."""
    above = [path for name, path in KNOWN.items() if ROOMS.index(room(name)) > ROOMS.index("figures")]
    told = [ast.unparse(n.func) for path in above for n in nodes(parsed(path)) if isinstance(n, ast.Call)]
    assert [call for call in told if call.endswith("usual.position")] == []


@pytest.mark.parametrize("language", ["en", "it"])
def test_what_a_command_prints_has_headings_in_every_language(language: str) -> None:
    """A column that no command prints may do without: its heading is its name in words."""
    modules = [importlib.import_module(name) for name in KNOWN if name.startswith("vsd_analytics.cli.")]
    layouts = {name: layout for module in modules for name, layout in getattr(module, "LAYOUTS", {}).items()}
    assert len(layouts) > 15
    wanted = {f"reason.answer.{name}" for name in layouts}
    wanted |= {f"reason.column.{column}" for layout in layouts.values() for shown in layout for column in shown.columns}
    assert wanted - catalogue(language).keys() == set()
