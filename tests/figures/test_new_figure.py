"""A figure is three files: those of CONTRIBUTING.md, put into a copy of the code, reach page and JSON file."""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from report import ingested_worlds as w

from vsd_analytics.figures.catalogue.form import ANSWER_MAKERS, answers
from vsd_analytics.figures.catalogue.view import MAPS
from vsd_analytics.warehouse.sqlfiles import figure_headers

REPOSITORY = Path(__file__).resolve().parent.parent.parent
PRINT = """
import json, sys
from pathlib import Path
from vsd_analytics.config.project import load_site
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.report.pages.figure_list import further_figures
from vsd_analytics.report.pages.json_and_csv import figures_json, to_json
from vsd_analytics.warehouse.sqlfiles import figure_headers
from datetime import date

report = week_report(load_site(Path(sys.argv[1])), date(2026, 11, 9))
rows = [[r.name, r.value, r.likely, r.unit, r.reason] for r in further_figures(report)]
print(json.dumps({
    "figure": figures_json(report)["M99"],
    "answer": json.loads(to_json(report))["answers"]["long_violations"]["rows"],
    "last line": rows[-1],
    "documented": [f.name for f in figure_headers()][-1],
}))
"""


def example(mark: str) -> str:
    """Return the block of CONTRIBUTING.md after a comment, without the indent of its list."""
    text = (REPOSITORY / "CONTRIBUTING.md").read_text(encoding="utf-8")
    found = re.search(rf"^ *<!-- {mark} -->\n( *)```\w+\n(.*?)^ *```$", text, re.M | re.S)
    assert found, mark
    return re.sub(rf"^{found[1]}", "", found[2], flags=re.M)


def test_every_figure_of_the_headers_is_made_by_one_function_and_no_other_is() -> None:
    from vsd_analytics.figures import catalogue

    of_some_sites = catalogue.FILES_OF_SPACE | catalogue.FILES_OF_CONTEXT | catalogue.FILES_OF_YEAR
    for name in of_some_sites:  # imported where they are asked for
        importlib.import_module(f"{catalogue.__name__}.{name}")
    made = set(ANSWER_MAKERS) | set(MAPS)
    assert made == {f.metric for f in figure_headers()}, "a header needs an @answers of its id, and the reverse"
    assert not set(ANSWER_MAKERS) & set(MAPS)


def test_every_figure_of_the_headers_has_its_words() -> None:
    words = tomllib.loads((REPOSITORY / "reports/wording/figures.toml").read_text(encoding="utf-8"))
    assert list(words) == sorted((f.metric for f in figure_headers()), key=lambda metric: int(metric[1:]))
    assert [metric for metric, parts in words.items() if "json_unit" not in parts] == []


def test_two_functions_for_one_figure_are_refused() -> None:
    with pytest.raises(ValueError, match="M0 is made by"):
        answers("M0")(ANSWER_MAKERS["M1"])


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the project with the three files of the example, as typed."""
    tree = tmp_path_factory.mktemp("tree")
    for folder in ("vsd_analytics", "sql", "reports", "docs", "tests"):
        shutil.copytree(REPOSITORY / folder, tree / folder, ignore=shutil.ignore_patterns("*.zip", "*.png"))
    for name in ("pyproject.toml", "CONTRIBUTING.md", "README.md", "CHANGELOG.md", "Makefile"):
        shutil.copy(REPOSITORY / name, tree / name)
    (tree / "sql/marts/long_violations.sql").write_text(example("figure"), encoding="utf-8")
    code = tree / "vsd_analytics/figures/catalogue/long_violations.py"
    code.write_text(example("figure-code"), encoding="utf-8")
    with (tree / "reports/wording/figures.toml").open("a", encoding="utf-8") as words:
        words.write(f"\n{example('figure-words')}")
    return tree


def in_tree(tree: Path, *command: str, cwd: Path | None = None) -> str:
    """Run Python on the copy; return what it printed."""
    done = subprocess.run(
        [sys.executable, *command],
        env={**os.environ, "PYTHONPATH": str(tree)},
        cwd=cwd or tree,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_three_files_of_the_example_put_a_figure_on_the_page_and_into_the_json_file(
    tree: Path, tmp_path: Path
) -> None:
    site = w.world(tmp_path / "project", w.toml(), w.messages(w.steady({w.QUEUE: 4, w.DOOR: 2})))
    made = json.loads(in_tree(tree, "-c", PRINT, str(site.root), cwd=tmp_path))
    assert (made["figure"]["value"], made["figure"]["state"]) == (7 * 3 * 6, "ok")
    assert made["answer"][0]["longest_s"]["value"] == pytest.approx(w.CLOSE_S, abs=2)
    assert made["last line"] == ["Long violations", "126", "\u2013", "violations", ""]
    assert made["documented"] == "Long violations"


def test_small_counts_of_the_example_are_hidden_with_what_tells_them(tree: Path, tmp_path: Path) -> None:
    few = w.world(
        tmp_path / "few", w.toml(), w.messages(lambda day, hour: {w.QUEUE: 1} if (day, hour) == (2, 9) else {})
    )
    made = json.loads(in_tree(tree, "-c", PRINT, str(few.root), cwd=tmp_path))
    assert (made["figure"]["value"], made["figure"]["state"]) == (None, "not_enough_data")
    assert made["answer"][0]["longest_s"]["value"] is None


def test_the_example_passes_the_tests_of_the_project_as_typed(tree: Path) -> None:
    in_tree(tree, "docs/generate_reference.py", "docs")
    tests = (
        "tests/sql/test_sql_numbers.py",
        "tests/figures/test_figures_catalogue.py",
        "tests/test_architecture.py::test_what_a_command_prints_has_headings_in_every_language",
    )
    of_figures = "tests/figures/test_new_figure.py::test_every_figure_of_the_headers"
    one = [f"{of_figures}_{name}" for name in ("is_made_by_one_function_and_no_other_is", "has_its_words")]
    in_tree(tree, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests, *one)
