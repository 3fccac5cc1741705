"""Uses every part of the API as an analyst would; a type checker reads this file (`test_types.py`)."""

from __future__ import annotations

from datetime import date
from pathlib import Path

import pandas as pd

import vsd_analytics as vsd


def use(folder: Path) -> dict[str, object]:
    """Return what each part gives."""
    site: vsd.OpenProject = vsd.open(folder)
    week: vsd.Days = site.week("2026-W46")
    days: vsd.Days = site.days("2026-11-09", date(2026, 11, 11))
    hours: vsd.Table = week.hours
    frame: pd.DataFrame = hours.df()
    tills = pd.DataFrame({"local_hour": [10, 11], "sales": [5, 7]})
    burden: vsd.Heatmap = week.heatmap("burden")
    return {
        "site": site,
        "week": week,
        "days": days,
        "hours": frame,
        "polars": hours.pl(),
        "arrow": hours.arrow(),
        "areas": week.areas.df(),
        "cells": week.cells.df(),
        "violations": week.violations.df(),
        "coverage": week.coverage.df(),
        "hotspots": week.hotspots.df(),
        "visits": week.visits.df(),
        "flow": week.flow.df(),
        "queues": week.queues.df(),
        "capacity": week.capacity.df(),
        "changes": site.changes.df(),
        "compared": site.compare("2026-11-09..2026-11-10", (date(2026, 11, 11), date(2026, 11, 12))),
        "query": week.sql("select local_hour, sales from hours join tills using (local_hour)", tills=tills),
        "burden": burden,
        "effect": changed.state if (changed := site.change(1)).burden is None else changed.burden.value,
        "weeks": [way.weeks_after for way in site.plan("entrance", effect=-0.3, power=0.9).choices],
    }
