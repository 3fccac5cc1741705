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

from vsd_analytics.figures.catalogue.form import MAKERS, figure
from vsd_analytics.warehouse.sqlfiles import figure_headers

REPOSITORY = Path(__file__).resolve().parent.parent.parent
PRINT = """
import json, sys
from pathlib import Path
from vsd_analytics.config import load_site
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.report.pages.figure_list import more_figures
from vsd_analytics.report.pages.json_and_csv import to_json
from vsd_analytics.warehouse.sqlfiles import figure_headers
from datetime import date

report = week_report(load_site(Path(sys.argv[1])), date(2026, 11, 9))
rows = [[r.name, r.value, r.likely, r.unit, r.reason] for r in more_figures(report)]
print(json.dumps({
    "figure": json.loads(to_json(report))["figures"]["M99"],
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

    for name in catalogue.FILES_OF_SPACE:  # imported where a place asks for them
        importlib.import_module(f"{catalogue.__name__}.{name}")
    assert set(MAKERS) == {f.metric for f in figure_headers()}, "a header needs an @figure of its id, and the reverse"


def test_every_figure_of_the_headers_has_its_words() -> None:
    words = tomllib.loads((REPOSITORY / "reports/wording/figures.toml").read_text(encoding="utf-8"))
    assert list(words) == sorted((f.metric for f in figure_headers()), key=lambda metric: int(metric[1:]))
    assert [metric for metric, parts in words.items() if "json_unit" not in parts] == []


def test_two_functions_for_one_figure_are_refused() -> None:
    with pytest.raises(ValueError, match="M0 is made by"):
        figure("M0")(MAKERS["M1"])


def test_the_three_files_of_the_example_put_a_figure_on_the_page_and_into_the_json_file(tmp_path: Path) -> None:
    tree = tmp_path / "tree"
    for folder in ("vsd_analytics", "sql", "reports"):
        shutil.copytree(REPOSITORY / folder, tree / folder)  # with compiled modules
    # the pairs of a small world stand for ten seconds
    sql = example("figure").replace("duration_s >= 60", "duration_s >= 10")
    (tree / "sql/marts/long_violations.sql").write_text(sql, encoding="utf-8")
    code = tree / "vsd_analytics/figures/catalogue/long_violations.py"
    code.write_text(example("figure-code"), encoding="utf-8")
    with (tree / "reports/wording/figures.toml").open("a", encoding="utf-8") as words:
        words.write(f"\n{example('figure-words')}")
    site = w.world(tmp_path / "project", w.toml(), w.messages(w.steady({w.QUEUE: 4, w.DOOR: 2})))

    done = subprocess.run(
        [sys.executable, "-c", PRINT, str(site.root)],
        env={**os.environ, "PYTHONPATH": str(tree)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.returncode == 0, done.stderr
    made = json.loads(done.stdout)
    assert (made["figure"]["value"], made["figure"]["state"]) == (7 * 3 * 6, "ok")
    assert [row["n_violations"] for row in made["figure"]["rows"]] == [18] * 7
    assert made["last line"] == ["Violations of a minute or longer", "126", "\u2013", "violations", ""]
    assert made["documented"] == "Long violations"
