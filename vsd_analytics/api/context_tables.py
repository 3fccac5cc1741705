"""What else happened, by local hour and day: the tables `context` and `context_days`."""

from __future__ import annotations

from datetime import date

from vsd_analytics.api.table import Table
from vsd_analytics.figures.context_values import Grain, context_rows
from vsd_analytics.site.model import Site


def context_table(site: Site, first: date, last: date, *, per: Grain) -> Table:
    """Return `context_rows` as a table for analysts; arguments, columns and errors as there."""
    return Table(context_rows(site, first, last, per=per), title=f"What else happened, {first} to {last}")
