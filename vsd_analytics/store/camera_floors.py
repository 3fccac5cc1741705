"""The floor of each camera when its records came: `store/floors.json`.

Records name their camera and no floor. A camera whose `floor` is changed in vsd.toml would take its whole past along.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Mapping
from pathlib import Path

import msgspec

from vsd_analytics.store import durable

FILE = "floors.json"


def noted_floors(store: Path) -> dict[str, str]:
    """Return the floor by camera id; empty before any was noted, and where the file is damaged."""
    with contextlib.suppress(OSError, msgspec.DecodeError, UnicodeDecodeError):
        return msgspec.json.decode((store / FILE).read_bytes(), type=dict[str, str])
    return {}


def note_floors(store: Path, floors: Mapping[str, str], *, described: Collection[str]) -> None:
    """Note the floors of cameras whose records are stored. A disk that refuses costs nothing but the note.

    A floor that was noted stays, unless it is not among the `described` floors of vsd.toml: then it was renamed.
    """
    known = noted_floors(store)
    new = {camera_id: floor for camera_id, floor in floors.items() if known.get(camera_id) not in described}
    if new and store.is_dir():
        with contextlib.suppress(OSError):
            data = msgspec.json.encode(dict(sorted({**known, **new}.items())))
            durable.publish(store / FILE, data, is_synced=False)
