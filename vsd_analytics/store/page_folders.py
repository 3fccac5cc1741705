"""Temporary files in folders of pages, left by a command that was killed while it wrote."""

from __future__ import annotations

import re
from pathlib import Path

from vsd_analytics.store.durable import is_abandoned, remove

_OURS = re.compile(r"\.(?:\d{4}-W\d{2}[a-z0-9_-]*\.[a-z]+|index\.html)\.(?:[0-9a-f]{16}|\d+)\.tmp")


def sweep_pages(folder: Path) -> None:
    """Remove temporary files of pages, JSON files and figures that dead processes left directly in a folder.

    Temporary files of other programs stay, because a report may be written anywhere (`--out`).
    """
    for path in folder.glob(".*.tmp"):
        if _OURS.fullmatch(path.name) and is_abandoned(path):
            remove(path)
