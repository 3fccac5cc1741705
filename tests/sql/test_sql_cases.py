"""Every rule of every relation on a handful of rows: `tests/sql/*.toml`."""

from __future__ import annotations

import pytest
from given_expect import Case, all_relations, cases, run

CASES = list(cases())


@pytest.mark.parametrize("case", CASES, ids=[c.label for c in CASES])
def test_case_gives_the_expected_rows(case: Case) -> None:
    found, expected = run(case)
    assert found == expected


def test_every_relation_has_cases() -> None:
    named, there = {c.relation for c in CASES}, {f"{r.layer}/{r.name}" for r in all_relations()}
    assert sorted(there - named) == [], "write their cases: tests/sql/NAME.toml, as given_expect.py describes"
    assert sorted(named - there) == [], "sql/ has no such relation: correct or delete their cases"
