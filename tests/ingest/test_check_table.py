"""The table of checks: each entry says when it applies, what it looks for, and its code is explained."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from vsd_analytics.cli.explain import explanations
from vsd_analytics.ingest.checks.check_case import Case, SourceCheck, SourceWarning, always
from vsd_analytics.ingest.checks.check_table import CHECKS, warnings_of
from vsd_analytics.ingest.checks.sample import sample_of
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.site.model import Site


@pytest.fixture
def case(tmp_path: Path) -> Case:
    """Return the case of a source without records and without columns."""
    site = Site(site_id="shop", name="Shop", timezone="UTC", root=tmp_path, cameras=())
    return Case(site, IngestOptions(), sample_of([], is_whole=True), head=None)


def test_every_code_is_explained_and_every_entry_says_what_it_looks_for() -> None:
    assert {check.code for check in CHECKS} <= set(explanations())
    assert len({check.words for check in CHECKS}) == len(CHECKS)
    assert len({check.find for check in CHECKS}) == len(CHECKS)


def test_a_source_without_records_and_columns_raises_no_warning(case: Case) -> None:
    assert warnings_of(case) == ()


def test_a_check_runs_where_it_applies_and_gives_its_code(case: Case) -> None:
    def find(_: Case) -> Iterator[SourceWarning]:
        yield SourceWarning("what", "why", "fix")
        yield SourceWarning("what", "why", "fix", code="W224")

    check = SourceCheck("W220", always, find, "words")
    assert [warning.code for warning in check.warnings(case)] == ["W220", "W224"]
    assert not list(SourceCheck("W220", lambda _: False, find, "words").warnings(case))


def test_columns_of_a_source_without_columns_are_a_mistake_of_the_table(case: Case) -> None:
    with pytest.raises(ValueError, match="no columns"):
        _ = case.columns
