"""The part of `vsd.toml` that says how records come from other machines: `[exchange]`."""

from __future__ import annotations

import re
from pathlib import Path

from vsd_analytics.config.reader import ID_PATTERN, TableReader, suggest_id
from vsd_analytics.site.routes import ExchangeRoute

_PLACE = '"/mnt/exchange"'


def read_exchange(root: TableReader) -> ExchangeRoute | None:
    """Return where records are handed on or received, or None when there is no `[exchange]`."""
    if root.raw("exchange") is None:
        return None
    table = root.inner("exchange")
    place = table.text("place", example=_PLACE, required=True)
    node = _node(table)
    table.close()
    if place is None:
        return None
    scheme, separator, rest = place.partition("://")
    is_bucket = scheme == "s3" and bool(rest.partition("/")[0]) and bool(rest.partition("/")[2].strip("/"))
    if not is_bucket and (separator or not Path(place).is_absolute()):
        table.fault(
            "place",
            f"[exchange] place {place!r} is neither an absolute path nor s3://BUCKET/FOLDER",
            fix=f'place = {_PLACE} or "s3://exchange/shop"',
        )
    return ExchangeRoute(place, node)


def _node(table: TableReader) -> str | None:
    name = table.text("node", example='"north"')
    table.raw("node", {"type": "string", "pattern": f"^{ID_PATTERN}$"}, example='"north"')
    if name is not None and not re.fullmatch(ID_PATTERN, name):
        why = "it becomes a folder name: a-z, 0-9, - and _, at most 63, first a letter or digit"
        table.fault(
            "node", f"{name!r} cannot be the name of a node", code="E125", why=why, fix=f'node = "{suggest_id(name)}"'
        )
    return name
