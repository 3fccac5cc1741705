"""What the last release promised to callers in Python still holds."""

from __future__ import annotations

from pathlib import Path

import pytest

griffe = pytest.importorskip("griffe", reason="griffe is not installed")

from public_contract import RELEASED, package, public_names, stub  # noqa: E402  (needs griffe)


def broken(before: str, after: str) -> list[str]:
    """Return what a caller of the first stub would trip over in the second."""
    old, new = (griffe.visit("vsd_analytics", filepath=Path("vsd.pyi"), code=text) for text in (before, after))
    return [change.explain(griffe.ExplanationStyle.ONE_LINE) for change in griffe.find_breaking_changes(old, new)]


@pytest.fixture(scope="module")
def read() -> griffe.Module:
    return package()


@pytest.fixture(scope="module")
def now(read: griffe.Module) -> str:
    return stub(read)


def test_nothing_that_was_released_is_broken(now: str) -> None:
    """A change that breaks callers needs a new major version, and its line in CHANGELOG.md."""
    assert broken(RELEASED.read_text(encoding="utf-8"), now) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("def week(week: str = 'last')", "def week(week: str)"),
        ("def df() -> pd.DataFrame: ...", ""),
        ("floor_id: str | None = None, cell_m", "cell_m"),
        ("power: float = 0.8, weeks_max: int = 26) -> ExperimentPlan", "weeks_max: int = 26) -> ExperimentPlan"),
    ],
)
def test_a_breaking_change_is_found(now: str, old: str, new: str) -> None:
    assert old in now
    assert broken(now, now.replace(old, new)) != []


def test_the_page_of_the_python_reference_names_every_public_name(read: griffe.Module) -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "python.md").read_text(encoding="utf-8")
    assert [name for name in public_names(read) if f"::: vsd_analytics.{name}\n" not in page] == []
