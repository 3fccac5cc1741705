"""The catalogue is in the SQL headers once, and docs/figures.md is made from it."""

from __future__ import annotations

import importlib
from pathlib import Path

import generate_reference as reference
import pytest

from vsd_analytics.errors import SqlError
from vsd_analytics.warehouse import sqlfiles
from vsd_analytics.warehouse.sqlfiles import FIGURE_FIELDS, figure_headers, read_relation

REPOSITORY = Path(__file__).resolve().parent.parent.parent
PAGE = REPOSITORY / "docs" / "figures.md"
ALL = sorted({f.metric for f in figure_headers()}, key=lambda metric: int(metric[1:]))

HEADER = """\
-- name: marts/one
-- One row.
-- grain: a
-- reads: cameras
-- columns:
--   a  what
-- figure: M7 How risky
--   definition   violations over
--                person-hours
--   unit         per person-hour
--   denominator  person-hours
--   needs        20 person-hours
--   uncertainty  an interval
--   by           vsd_analytics.figures.rates.encounter_rate_level
-- assumes: nothing
select 1 as a
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "marts" / "one.sql"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def test_every_figure_is_in_the_headers_once() -> None:
    assert [f.metric for f in figure_headers()] == ALL
    assert ALL[:43] == [f"M{i}" for i in range(43)], "no figure goes, and none gets another id"


def test_the_page_says_what_the_headers_say() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert [line.split("|")[1].strip() for line in text.splitlines() if line.startswith("| M")] == ALL


def test_every_figure_is_made_by_a_function_that_exists_and_says_what_it_does() -> None:
    for figure in figure_headers():
        module, _, name = figure.by.rpartition(".")
        maker = getattr(importlib.import_module(module), name, None)
        assert maker is not None, f"`by` of {figure.metric} in {figure.relation} names no function: {figure.by}"
        assert maker.__doc__, figure.by


def test_a_header_tells_a_figure_over_several_lines(tmp_path: Path) -> None:
    (figure,) = read_relation(written(tmp_path, HEADER)).figures
    assert (figure.metric, figure.name, figure.relation) == ("M7", "How risky", "marts/one")
    assert figure.definition == "violations over person-hours"
    assert figure.by == "vsd_analytics.figures.rates.encounter_rate_level"


@pytest.mark.parametrize("lacking", FIGURE_FIELDS)
def test_a_figure_that_lacks_a_field_is_refused_by_name(tmp_path: Path, lacking: str) -> None:
    kept = [line for line in HEADER.splitlines(keepends=True) if not line.startswith(f"--   {lacking} ")]
    text = "".join(line for line in kept if lacking != "definition" or "                person-hours" not in line)
    with pytest.raises(SqlError, match=f"{lacking} of M7"):
        read_relation(written(tmp_path, text))


@pytest.mark.parametrize("line", ["-- figure: seven\n--   unit  x\n", "-- figure: M7 Risk\n--   colour  red\n"])
def test_a_line_of_a_figure_that_is_not_understood_is_refused(tmp_path: Path, line: str) -> None:
    with pytest.raises(SqlError, match="not understood"):
        read_relation(written(tmp_path, HEADER.replace("-- assumes", f"{line}-- assumes")))


def test_two_relations_that_tell_of_one_figure_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    one = read_relation(written(tmp_path, HEADER))
    monkeypatch.setattr(sqlfiles, "relations", lambda *layers: {"one": one, "other": one})
    with pytest.raises(SqlError, match="both describe M7"):
        figure_headers()


def test_a_page_without_marks_is_refused_and_another_part_is_noticed() -> None:
    with pytest.raises(ValueError, match="marks"):
        reference.with_part("# Figures\n", "| table |")
    text = PAGE.read_text(encoding="utf-8")
    assert reference.with_part(text, "| other |") != text
