"""The card of `vsd check` says of which records each line is."""

from __future__ import annotations

from typing import Any

import pytest

from vsd_analytics.cli.card import print_card
from vsd_analytics.ingest.checks.understanding import SourceProfile


def printed(capsys: pytest.CaptureFixture[str], **changes: Any) -> str:
    without_times: Any = None  # the project is asked for its zone only
    print_card(without_times, SourceProfile(**{"format": "table", "n_records": 50_000, "is_whole": False, **changes}))
    return capsys.readouterr().out


def test_cameras_of_a_long_file_are_counted_in_its_first_records(capsys: pytest.CaptureFixture[str]) -> None:
    assert "cameras   A (50,000), in the first 50,000 records\n" in printed(capsys, cameras={"A": 50_000})
    assert "cameras   A (9)\n" in printed(capsys, cameras={"A": 9}, n_records=9, is_whole=True)


@pytest.mark.parametrize("place", ["floor_m", "pixels"])
def test_an_extent_says_what_it_leaves_out(capsys: pytest.CaptureFixture[str], place: str) -> None:
    said = "(without 1 % at each end, at least one row)"
    extent = {place: (1.3, 5.0, 0.4, 8.0)}
    assert said in printed(capsys, **extent)
    assert said not in printed(capsys, n_records=1, **extent)
