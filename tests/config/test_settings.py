"""The table of settings: types, ranges, who reads them, the id; and two keys that are no settings any more."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import pytest
from site_text import site_text

import vsd_analytics
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError
from vsd_analytics.settings import BY_NAME, DEFAULTS, FLOOR_CELL_M, FORMER, OWNER_CELL_M, SETTINGS, Setting, Settings
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.dimensions import params
from vsd_analytics.warehouse.input_fingerprint import dependencies
from vsd_analytics.warehouse.sqlfiles import relations

each = pytest.mark.parametrize("setting", SETTINGS, ids=lambda s: s.name)
UNITS = {
    "_m": "metres", "_s": "seconds", "_h": "person-hours", "_days": "days",
    "_mb": "megabytes", "_gb": "gigabytes", "_bytes": "bytes",
}  # fmt: skip


def load(folder: Path, rule: str, **environ: str) -> Site:
    (folder / "vsd.toml").write_text(site_text() + f"[rule]\n{rule}\n", encoding="utf-8")
    return load_site(folder, environ=environ)


@each
def test_a_default_lies_within_its_range_and_has_the_type_of_its_field(setting: Setting) -> None:
    value, kind = setting.default, Settings.__annotations__[setting.name]
    if isinstance(value, str):
        assert value in setting.choices
        assert kind.startswith("Literal[")
    else:
        assert kind.startswith(type(value).__name__)
    numbers: tuple[Any, ...] = value if isinstance(value, tuple) else (value,)
    if setting.minimum is not None and setting.maximum is not None:
        assert all(setting.minimum <= n <= setting.maximum for n in numbers)
    else:
        assert isinstance(value, (bool, str)) or value == (), "a list of texts has no range"


@each
def test_the_unit_agrees_with_the_suffix_of_the_name(setting: Setting) -> None:
    suffix = "_" + setting.name.rpartition("_")[2]
    assert UNITS.get(suffix, setting.unit) == setting.unit


def test_settings_cannot_be_changed_and_a_changed_copy_leaves_them_alone() -> None:
    changed = DEFAULTS.with_values({"distance_m": 1.5})
    assert (changed.distance_m, DEFAULTS.distance_m) == (1.5, 2.0)
    assert changed.non_default() == {"distance_m": 1.5}
    with pytest.raises(FrozenInstanceError):
        changed.distance_m = 1.0  # type: ignore[misc]
    with pytest.raises(KeyError, match="no such setting: distance_cm"):
        DEFAULTS.with_values({"distance_cm": 200})


def test_the_id_is_the_hash_of_names_and_values_in_order_of_name() -> None:
    changed = DEFAULTS.with_values({"heat_steps": (1.0, 2.0, 3.0, 4.0, 5.0)})
    values = {name: getattr(changed, name) for name in sorted(BY_NAME)}
    assert changed.settings_id() == hashlib.blake2b(json.dumps(values).encode(), digest_size=4).hexdigest()
    assert changed.settings_id() != DEFAULTS.settings_id()


def test_the_relation_params_has_metres_and_seconds_as_whole_thousandths(tmp_path: Path) -> None:
    settings = DEFAULTS.with_values({"distance_m": 1.83, "episode_gap_s": 2.5, "together_share": 1})
    found = params(Site("shop", "Shop", "UTC", tmp_path, settings=settings))
    assert (found["distance_mm"], found["episode_gap_ms"], found["gathering_people"]) == (1830, 2500, 3)
    assert (found["cell_mm"], found["owner_cell_mm"], found["heat_cell_mm"]) == (250, 500, 1000)
    assert found["together_share"] == 1.0
    assert {type(v) for n, v in found.items() if n.endswith("_share")} == {float}
    assert {type(v) for n, v in found.items() if not n.endswith("_share") and n != "people"} == {int}
    assert found["people"] == "all"


def test_the_settings_marked_facts_are_those_that_the_queries_of_facts_read(tmp_path: Path) -> None:
    site = Site("shop", "Shop", "UTC", tmp_path)
    computed, _ = dependencies(relations("facts"))
    read = {p for r in computed.values() for p in r.params}
    changed = {
        s.name: _moved(params(site), params(Site("shop", "Shop", "UTC", tmp_path, settings=_halved(s))))
        for s in SETTINGS
        if s.is_in_sql
    }
    assert {name for name, columns in changed.items() if columns & read} == {
        s.name for s in SETTINGS if s.is_fact and s.is_in_sql
    }
    assert not any(s.is_fact and not s.is_in_sql for s in SETTINGS)


def _halved(setting: Setting) -> Settings:
    if setting.choices:
        return DEFAULTS.with_values({setting.name: setting.choices[1]})
    assert isinstance(setting.default, int | float)
    return DEFAULTS.with_values({setting.name: type(setting.default)(setting.default / 2)})


def _moved(one: dict[str, Any], other: dict[str, Any]) -> set[str]:
    (column,) = {c for c in one if one[c] != other[c]}
    return {column}


def test_sides_of_cells_are_no_settings_and_sql_knows_them(tmp_path: Path) -> None:
    assert not set(FORMER) & set(BY_NAME)
    assert FORMER == {"cell_m": FLOOR_CELL_M, "owner_cell_m": OWNER_CELL_M}


@pytest.mark.parametrize(("name", "value"), [("cell_m", "0.25"), ("owner_cell_m", "0.5")])
def test_a_former_setting_with_its_only_value_is_accepted(tmp_path: Path, name: str, value: str) -> None:
    assert load(tmp_path, f"{name} = {value}").settings == DEFAULTS
    assert load(tmp_path, "", **{f"VSD_{name.upper()}": value}).settings == DEFAULTS


@pytest.mark.parametrize("value", ["0.1", "true", '"0.25"', "[0.25]"])
@pytest.mark.parametrize("name", FORMER)
def test_a_former_setting_with_another_value_is_refused_with_its_line(tmp_path: Path, name: str, value: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, f"{name} = {value}")
    (problem,) = caught.value.problems
    assert problem.where is not None
    assert problem.where.text == f"{name} = {value}"
    assert f"it is always {FORMER[name]:g} metres" in problem.what
    assert problem.fix == f"take the line {name} out"


def test_a_former_setting_of_the_environment_with_another_value_is_refused_by_its_variable(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, "", VSD_CELL_M="1")
    (problem,) = caught.value.problems
    assert problem.where is not None
    assert "VSD_CELL_M" in problem.where.file


@pytest.mark.parametrize(
    ("variable", "meant"),
    [("VSD_DISTANCEM", "VSD_DISTANCE_M"), ("VSD_EPISODE_GAP", "VSD_EPISODE_GAP_S"), ("VSD_CELLM", "VSD_CELL_M")],
)
def test_a_misspelt_setting_of_the_environment_is_refused_with_its_name(
    tmp_path: Path, variable: str, meant: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, "", **{variable: "1"})
    (problem,) = caught.value.problems
    assert caught.value.what == "the environment has 1 mistake"
    assert problem.what == f"no setting is called {variable}"
    assert problem.fix == f"rename it to {meant}, or unset it"


def test_variables_of_other_programs_are_left_alone(tmp_path: Path) -> None:
    load(tmp_path, "", VSD_PROJECT="/srv/shop", VSD_REALDATA="/data", VSD_CHROMIUM="/usr/bin/chromium", DISTANCEM="1")


def test_a_wrong_value_in_the_environment_is_answered_as_a_variable_is_written(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, "", VSD_MIN_DAYS="many")
    (problem,) = caught.value.problems
    assert problem.what == "VSD_MIN_DAYS must be a whole number, not the text 'many'"
    assert problem.fix == f"write it as: VSD_MIN_DAYS={BY_NAME['min_days'].default}"


@each
def test_every_setting_is_read_by_some_code_or_query(setting: Setting) -> None:
    """A setting that nothing reads would be accepted and change nothing."""
    column = next(iter(_moved_columns(setting))) if setting.is_in_sql else None
    assert re.search(rf"\.{setting.name}\b|\"{setting.name}\"", _CODE) or re.search(rf"\.{column}\b", _QUERIES)


def _moved_columns(setting: Setting) -> set[str]:
    site = Site("shop", "Shop", "UTC", Path())
    return _moved(params(site), params(Site("shop", "Shop", "UTC", Path(), settings=_halved(setting))))


_CODE = "".join(
    p.read_text(encoding="utf-8") for p in Path(vsd_analytics.__file__).parent.rglob("*.py") if p.name != "settings.py"
)
_QUERIES = "".join(r.sql for r in relations("staging", "facts", "marts").values())
