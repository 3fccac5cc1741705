"""Reasons: one code, one sentence; every code in the package has its sentence and the values it names."""

from __future__ import annotations

import ast
import copy
import pickle
import string
from pathlib import Path

import pytest

import vsd_analytics
from vsd_analytics.answer import Reason
from vsd_analytics.wording.catalogue import catalogue
from vsd_analytics.wording.reasons import read_reason, reason_text

PACKAGE = Path(vsd_analytics.__file__).parent


def made() -> list[tuple[str, str, set[str | None]]]:
    """Return file, code and names of values of every `Reason("...")` in the package."""
    found = []
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if "Reason(" in text else ():
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Reason":
                codes = [c.value for c in ast.walk(node.args[0]) if isinstance(c, ast.Constant)]
                if isinstance(node.args[0], ast.Constant | ast.IfExp):
                    found += [(path.name, str(c), {k.arg for k in node.keywords}) for c in codes if "." in str(c)]
    return found


def test_every_code_has_a_sentence_and_the_values_it_names() -> None:
    found = made()
    assert len(found) > 100
    for where, code, values in found:
        entry = catalogue()[f"reason.{code}"]
        needed = {name for _, name, _, _ in string.Formatter().parse(str(entry)) if name}
        assert None in values or needed <= values, (where, code)


def test_a_reason_is_a_value() -> None:
    one = Reason("level.days", least=5, has=2)
    assert one == Reason("level.days", has=2, least=5)
    assert len({one, Reason("level.days", has=2, least=5), Reason("level.days", has=3, least=5)}) == 2
    assert copy.deepcopy(one) == pickle.loads(pickle.dumps(one)) == one
    with pytest.raises(AttributeError, match="read-only"):
        one.code = "x"


def test_nested_reasons_and_lists_are_one_sentence() -> None:
    few = Reason("hidden.few", least=5)
    assert (
        reason_text(Reason("hidden.week_before", reason=few))
        == "fewer than 5 violations were counted in the week before"
    )
    both = Reason("joined", reasons=(Reason("of", name="people", reason=few), Reason("trend.closed")))
    assert reason_text(both) == "people: fewer than 5 violations were counted; closed all week"


def test_a_sentence_of_a_json_report_keeps_its_text() -> None:
    assert (read_reason("held {back}").code, reason_text(read_reason("held {back}"))) == ("text", "held {back}")
    assert reason_text(None) == ""
