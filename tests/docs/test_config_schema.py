"""The JSON Schema of vsd.toml is that of the readers, and accepts and refuses what they do."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import generate_reference as reference
import pytest
from jsonschema import Draft202012Validator
from markdown_pages import PAGES
from site_text import site_text

from vsd_analytics.config.first_config import FirstAnswers, render
from vsd_analytics.config.project import load_site
from vsd_analytics.config.schema import SCHEMA_FILE, as_json
from vsd_analytics.errors import ConfigError, VsdError
from vsd_analytics.simulate import demo_project

SCHEMA: dict[str, Any] = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
VALIDATOR = Draft202012Validator(SCHEMA)
_BLOCK = re.compile(r"^( *)```toml\n(.*?)^ *```$", re.M | re.S)

SAMPLE = (
    site_text()
    + """
[mqtt]
host = "localhost"
[mail]
smtp = "mail.example.org"
from = "reports@example.org"
[engine]
precision = 0.9
[exchange]
place = "/mnt/exchange"
[[area]]
id = "queue"
name = "Queue"
polygon = [[0, 0], [4, 0], [4, 4]]
[[fixture]]
id = "shelf-1"
name = "Shelf"
polygon = [[0, 0], [4, 0], [4, 4]]
[doors]
empty_at = "04:00"
[[line]]
id = "door"
name = "Door"
points = [[0, 0], [2, 0]]
[[alarm]]
id = "queue-too-full"
kind = "gathering"
for_s = 60
[[source]]
id = "tills"
files = "till-*.csv"
[calendar]
country = "IT"
[[event]]
name = "Fair"
from = "2026-11-10"
to = "2026-11-12"
[[opening]]
from = "2026-12-01"
hours = { mon-sat = "08:00-20:00" }
by = "Anna"
"""
)


def mistakes(text: str) -> list[str]:
    """Return what the schema finds wrong in a vsd.toml."""
    return [e.message for e in VALIDATOR.iter_errors(as_json(tomllib.loads(text)))]


def said(folder: Path, values: dict[str, Any]) -> tuple[VsdError, ...]:
    """Return what the readers find wrong in a vsd.toml of some values."""
    (folder / "vsd.toml").write_text("\n".join(_lines(values)) + "\n", encoding="utf-8")
    try:
        load_site(folder)
    except ConfigError as error:
        return error.problems
    return ()


def _lines(values: dict[str, Any]) -> Iterator[str]:
    for name, table in values.items():
        for each in table if isinstance(table, list) else [table]:
            yield f"[[{name}]]" if isinstance(table, list) else f"[{name}]"
            yield from (f"{key} = {_toml(value)}" for key, value in each.items())


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items()) + " }"
    return json.dumps(value)


def examples() -> Iterator[tuple[str, str]]:
    """Yield the examples of the pages; those of some tables get the rest of a site."""
    for page in PAGES:
        for i, (indent, block) in enumerate(_BLOCK.findall(page.read_text(encoding="utf-8"))):
            text = re.sub(rf"^{indent}", "", block, flags=re.M)
            if "[project]" in text or "[[plane]]" in text:  # of a plug-in, of a camera: tests/engine/test_planes.py
                continue
            yield f"{page.name} {i}", text if "\n[site]" in f"\n{text}" else site_text() + text


def test_the_schema_is_that_of_the_readers() -> None:
    """Run `make docs` after a change of a setting or of a key that a reader looks at."""
    assert SCHEMA_FILE.read_text(encoding="utf-8") == reference.config_schema()
    Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize(("name", "text"), list(examples()), ids=lambda v: v if len(v) < 40 else "")
def test_every_example_of_the_pages_is_valid(name: str, text: str) -> None:
    assert mistakes(text) == [], name


def test_the_first_file_of_init_that_of_the_demo_and_those_of_tests_are_valid() -> None:
    answers = FirstAnswers(
        "Riverside Store", "Europe/Rome", opening="mon-sat 08:00-21:00", cameras=("Cam 2", "cam-1=Door")
    )
    for text in (render(answers), demo_project._toml(1.0, ()), site_text(), site_text("cam-1", "cam-2"), SAMPLE):
        assert mistakes(text) == []


def test_dates_of_toml_and_texts_are_both_valid() -> None:
    site = 'closed = ["2026-12-25", 2026-12-26]\nday_starts = 05:00:00\n'
    camera = 'homography = "a.txt"\ncalibrated_from = 2026-11-01T00:00:00+01:00\n'
    assert mistakes(site_text(site=site, more=camera)) == []


KEYS = [
    (table, key)
    for table, form in SCHEMA["properties"].items()
    for key in form.get("items", form)["properties"]
]  # fmt: skip


@pytest.mark.parametrize(("table", "key"), KEYS, ids=lambda v: v)
def test_a_value_of_a_wrong_type_is_refused_by_schema_and_reader_alike(table: str, key: str, tmp_path: Path) -> None:
    values = as_json(tomllib.loads(SAMPLE))
    place = values.setdefault(table, {})
    place = place[0] if isinstance(place, list) else place
    place[key] = [[True]]
    found = [e for e in VALIDATOR.iter_errors(values) if key in e.absolute_path]
    assert found
    lines = [p.where.text for p in said(tmp_path, values) if p.where is not None and p.where.text]
    assert any(line.startswith((f"{key} =", f"[{table}]")) for line in lines), lines


@pytest.mark.parametrize("table", [*SCHEMA["properties"], ""])
def test_an_unknown_key_is_refused_by_schema_and_reader_alike(table: str, tmp_path: Path) -> None:
    values = as_json(tomllib.loads(SAMPLE))
    place = values.setdefault(table, {}) if table else values
    place = place[0] if isinstance(place, list) else place
    place["unheard_of"] = {} if not table else 1
    assert [e.validator for e in VALIDATOR.iter_errors(values)] == ["additionalProperties"]
    assert [p.code for p in said(tmp_path, values)] == ["E122"]


NEEDED = [
    (table, key)
    for table, form in SCHEMA["properties"].items()
    for key in form.get("items", form).get("required", [])
]  # fmt: skip


@pytest.mark.parametrize(("table", "key"), [*NEEDED, ("mail", "smtp")], ids=lambda v: v)
def test_a_missing_key_is_refused_by_schema_and_reader_alike(table: str, key: str, tmp_path: Path) -> None:
    values = as_json(tomllib.loads(SAMPLE))
    assert mistakes(SAMPLE) == []
    assert said(tmp_path, values) == ()
    place = values[table][0] if isinstance(values[table], list) else values[table]
    del place[key]
    assert [e.validator for e in VALIDATOR.iter_errors(values)] == ["anyOf" if key == "smtp" else "required"]
    assert [(p.code, f"has no {key}" in p.what) for p in said(tmp_path, values)] == [("E123", True)]


@pytest.mark.parametrize("table", SCHEMA["required"])
def test_a_missing_table_is_refused_by_schema_and_reader_alike(table: str, tmp_path: Path) -> None:
    values = as_json(tomllib.loads(site_text()))
    del values[table]
    assert [e.validator for e in VALIDATOR.iter_errors(values)] == ["required"]
    assert "E123" in {p.code for p in said(tmp_path, values)}


def test_a_value_outside_its_range_is_refused() -> None:
    assert mistakes(site_text() + "[rule]\ntogether_share = 1.5\n") == ["1.5 is greater than the maximum of 1.0"]
    assert mistakes(site_text() + "[report]\nmin_days = 2.5\n") == ["2.5 is not of type 'integer'"]
    assert mistakes(site_text() + '[rule]\ndistance_unit = "yd"\n') == ["'yd' is not one of ['m', 'ft']"]
