"""The part of `vsd.toml` that says how good the engine is: `[engine]`."""

from __future__ import annotations

from vsd_analytics.config.reader import TableReader
from vsd_analytics.site.model import EngineError

_SHARES = {"precision": "0.9", "recall": "0.85"}
_SHARE_MIN, _SD_MIN_M, _SD_MAX_M = 0.01, 0.001, 5.0


def read_engine(root: TableReader) -> EngineError | None:
    """Return what `[engine]` states, or None when there is no such table or nothing in it."""
    if root.raw("engine") is None:
        return None
    table = root.inner("engine")
    precision, recall = (
        table.number(key, minimum=_SHARE_MIN, maximum=1, unit="", example=example) for key, example in _SHARES.items()
    )
    sd_m = table.number("distance_sd_m", minimum=_SD_MIN_M, maximum=_SD_MAX_M, unit="metres", example="0.15")
    table.close()
    stated = EngineError(precision, recall, sd_m)
    return None if stated == EngineError() else stated
