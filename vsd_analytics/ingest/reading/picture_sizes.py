"""Pixels of positions that an engine gives as shares of the picture."""

from __future__ import annotations

from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.ingest.reading.raw import BadRowError


def size_of(options: IngestOptions, camera: str | None, *, own: tuple[int, int] | None = None) -> tuple[int, int]:
    """Return width and height of a camera's picture in pixels.

    The user's `--size` comes first, then the size in vsd.toml, for which the calibration was made, then the message's.

    Args:
        options: What the user says, completed from vsd.toml.
        camera: The camera as the engine calls it; None = the user's.
        own: What the message itself says.

    Raises:
        BadRowError: Nobody says it.
    """
    name = options.camera if camera is None else camera
    found = options.size_px or options.pictures.get(name or "") or own
    if found is None:
        raise BadRowError("no-size", "positions are shares of the picture, and nobody says how large it is")
    return found
