"""The test kit of adapters: passes the example of the documentation, and names what a bad adapter breaks."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from docs.markdown_pages import REPOSITORY, blocks

from vsd_analytics.ingest.reading.adapter import RawBatch
from vsd_analytics.ingest.testing import AdapterSample, prove

EXAMPLE = {b.mark: b.text for b in blocks(REPOSITORY / "docs" / "plugins.md") if b.mark}
DATA = b"#acme 3\n1762761600;7;1.0;2.0\n1762761600;8;2.5;2.0\n1762761601;7;1.1;2.0\n"
SAMPLE = AdapterSample(DATA, n_records=3, first_ms=1762761600000, bad_line=b"1762761601;7;left;2")


@pytest.fixture
def acme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[type[Any]]:
    (tmp_path / "acme_vsd.py").write_text(EXAMPLE["adapter"], encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    import acme_vsd

    yield acme_vsd.Acme
    sys.modules.pop("acme_vsd", None)


def test_the_example_of_the_page_is_short_and_keeps_every_promise(acme: type[Any], tmp_path: Path) -> None:
    assert len(EXAMPLE["adapter"].splitlines()) < 60
    made: dict[str, Any] = {}
    exec(EXAMPLE["test"], made)
    (tmp_path / "kit").mkdir()
    made["test_acme"](tmp_path / "kit")


def greedy(acme: type[Any]) -> type[Any]:
    class Greedy(acme):
        def detects(self, source: Any) -> bool:
            return True

    return Greedy


def hasty(acme: type[Any]) -> type[Any]:
    class Hasty(acme):
        def read(self, source: Any, options: Any) -> Iterator[RawBatch]:
            for batch in super().read(source, options):
                if batch.rejected:
                    raise ValueError("could not convert")
                yield batch

    return Hasty


def forgetful(acme: type[Any]) -> type[Any]:
    class Forgetful(acme):
        def read(self, source: Any, options: Any) -> Iterator[RawBatch]:
            for batch in super().read(source, options):
                yield replace(batch, rejected=())

    return Forgetful


def hoarding(acme: type[Any]) -> type[Any]:
    class Hoarding(acme):
        def read(self, source: Any, options: Any) -> Iterator[RawBatch]:
            import pyarrow as pa

            batches = list(super().read(source, options))
            table = pa.concat_tables(b.table("observations") for b in batches)
            yield RawBatch({"observations": table}, [r for b in batches for r in b.rejected])

    return Hoarding


def odd_columns(acme: type[Any]) -> type[Any]:
    class OddColumns(acme):
        def read(self, source: Any, options: Any) -> Iterator[RawBatch]:
            for batch in super().read(source, options):
                yield replace(batch, tables={"observations": batch.table("observations").drop_columns(["quality"])})

    return OddColumns


def at_any_time(acme: type[Any]) -> type[Any]:
    class AtAnyTime(acme):
        def read(self, source: Any, options: Any) -> Iterator[RawBatch]:
            return super().read(source, replace(options, period_s=None))

    return AtAnyTime


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (greedy, "for its own"),
        (hasty, "could not convert"),
        (forgetful, "must be rejected"),
        (hoarding, "yield at most"),
        (odd_columns, "RAW_SCHEMAS"),
        (at_any_time, "--period would change nothing"),
    ],
)
def test_what_an_adapter_breaks_is_named(
    acme: type[Any], tmp_path: Path, spoil: Callable[[type[Any]], type[Any]], says: str
) -> None:
    (tmp_path / "kit").mkdir()
    with pytest.raises((AssertionError, ValueError), match=says):
        prove(spoil(acme), SAMPLE, tmp_path / "kit")


@pytest.mark.parametrize(("wrong", "says"), [({"n_records": 4}, "the sample has 4"), ({"first_ms": 1}, "not at 1")])
def test_a_sample_that_says_something_else_fails(acme: type[Any], tmp_path: Path, wrong: Any, says: str) -> None:
    (tmp_path / "kit").mkdir()
    with pytest.raises(AssertionError, match=says):
        prove(acme, replace(SAMPLE, **wrong), tmp_path / "kit")
