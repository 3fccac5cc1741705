"""Every public function has an example, and the examples of all docstrings are right."""

from __future__ import annotations

import doctest
import importlib
import inspect
from collections.abc import Callable
from datetime import date
from functools import cached_property
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
import pytest

import vsd_analytics as vsd

CLASSES = (vsd.OpenProject, vsd.Days, vsd.Table, vsd.Heatmap, vsd.TrackTable)
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def functions() -> dict[str, Callable[..., object]]:
    return {n: getattr(vsd, n) for n in vsd.__all__ if inspect.isfunction(getattr(vsd, n))}


def methods() -> dict[str, object]:
    kinds = (property, cached_property)
    return {
        f"{kind.__name__}.{name}": member
        for kind in CLASSES
        for name, member in vars(kind).items()
        if not name.startswith("_") and (inspect.isfunction(member) or isinstance(member, kinds))
    }


def examples() -> dict[str, doctest.DocTest]:
    named = {"vsd_analytics": importlib.import_module("vsd_analytics"), **functions(), **methods()}
    named |= {kind.__name__: kind for kind in CLASSES}  # type: ignore[dict-item]
    parser, found = doctest.DocTestParser(), {}
    for name, thing in named.items():
        text = inspect.getdoc(thing) or ""
        if ">>>" in text:
            found[name] = parser.get_doctest(text, {}, name, name, 0)
    return found


EXAMPLES = examples()


def test_every_public_function_and_method_is_called_by_an_example() -> None:
    called = "".join(e.source for test in EXAMPLES.values() for e in test.examples)
    assert [name for name in functions() if f"vsd.{name}(" not in called] == []
    assert [name for name in methods() if name not in EXAMPLES] == []


@pytest.fixture(scope="module")
def names(demo_project: Path) -> dict[str, object]:
    site = vsd.open(demo_project)
    week = site.week("2026-W46")
    warehouse = vsd.open_warehouse(site.site, week.first, week.last)
    [floor] = site.site.floors
    return {"vsd": vsd, "pd": pd, "date": date, "site": site, "week": week, "floor": floor, "warehouse": warehouse}


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_example_gives_what_it_says(
    name: str, names: dict[str, object], demo_project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(demo_project.parent)
    monkeypatch.setenv("MPLBACKEND", "agg")
    said: list[str] = []
    test = EXAMPLES[name]
    test.globs = dict(names)
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    runner.run(test, out=said.append)
    plt.close("all")
    assert not runner.failures, "".join(said)
