"""Which shapes of files a project has imported before, so that `vsd ingest` shows its card for new ones only."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

from vsd_analytics.errors import VsdError
from vsd_analytics.store.durable import make_dirs, publish

FILE = Path("status") / "shapes.json"
MOST = 1_000


def known_shapes(root: Path) -> list[str]:
    """Return the shapes (`SourceCard.shape`) imported into a project, the oldest first; [] when they cannot be read."""
    try:
        found = json.loads((root / FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    return [shape for shape in found if isinstance(shape, str)] if isinstance(found, list) else []


def note_shape(root: Path, shape: str) -> None:
    """Remember a shape; where that cannot be written, its card is shown once more."""
    shapes = [known for known in known_shapes(root) if known != shape]
    with contextlib.suppress(OSError, VsdError):
        make_dirs((root / FILE).parent)
        publish(root / FILE, json.dumps([*shapes, shape][-MOST:]).encode())
