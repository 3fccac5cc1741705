"""A short round of `prove_nodes.py`: nodes and site killed, disks full, links broken; each row stored once."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parent.parent / "faults"))
from crash_points import why_not
from prove_nodes import one_round


def test_rows_are_those_that_were_sent_whatever_was_killed_or_refused_on_their_way(tmp_path: Path) -> None:
    if (reason := why_not()) is not None:
        pytest.skip(reason)
    seen = one_round(1, tmp_path / "world", place=None, n_frames=10, n_steps=14, n_batches=2)
    assert seen["wrong"] == seen["left over"] == 0
    assert seen["rows"] > 30
    assert seen["kills of nodes"] + seen["kills of the site"] >= 2
