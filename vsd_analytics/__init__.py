"""vsd_analytics: the output of any visual social distancing engine in, decisions about a space out.

The public API. `open` is the way in for analysts; the functions below it compute single figures on a `Warehouse`.
Everything heavy is imported when first used, and editors and type checkers see every name.

The examples of all docstrings run on a demo project of one week. Their names:

Example:
    >>> import vsd_analytics as vsd
    >>> from datetime import date
    >>> site = vsd.open("vsd-demo")
    >>> week = site.week("2026-W46")
    >>> [floor] = site.site.floors
    >>> warehouse = vsd.open_warehouse(site.site, week.first, week.last)
    >>> warehouse.rows("select count(*) as n_hours from hours")
    [{'n_hours': 168}]
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from vsd_analytics.errors import VsdError
from vsd_analytics.version import VERSION as __version__  # noqa: N811

if TYPE_CHECKING:
    from vsd_analytics.api.days import Days as Days
    from vsd_analytics.api.heatmap import Heatmap as Heatmap
    from vsd_analytics.api.project import OpenProject as OpenProject
    from vsd_analytics.api.project import open_project as open
    from vsd_analytics.api.table import Table as Table
    from vsd_analytics.api.tracks import TrackTable as TrackTable
    from vsd_analytics.config.project import find_project as find_project
    from vsd_analytics.config.project import load_site as load_site
    from vsd_analytics.figures.before_after import before_after as before_after
    from vsd_analytics.figures.compare import compare as compare
    from vsd_analytics.figures.episodes import episode_figures as episode_figures
    from vsd_analytics.figures.experiments import plan_experiment as plan_experiment
    from vsd_analytics.figures.forecast import forecast as forecast
    from vsd_analytics.figures.gatherings import gatherings as gatherings
    from vsd_analytics.figures.groups import groups as groups
    from vsd_analytics.figures.hotspots import hotspots as hotspots
    from vsd_analytics.figures.hour_of_week import week_profile as week_profile
    from vsd_analytics.figures.maps import burden_map as burden_map
    from vsd_analytics.figures.maps import cell_maps as cell_maps
    from vsd_analytics.figures.maps import excess_map as excess_map
    from vsd_analytics.figures.maps import exposure_map as exposure_map
    from vsd_analytics.figures.maps import risk_map as risk_map
    from vsd_analytics.figures.operator_counts import coverage as coverage
    from vsd_analytics.figures.operator_counts import heatmap as heatmap
    from vsd_analytics.figures.operator_counts import hours as hours
    from vsd_analytics.figures.person_time import person_time as person_time
    from vsd_analytics.figures.sensitivity import threshold_sensitivity as threshold_sensitivity
    from vsd_analytics.figures.switchback import plan_switchback as plan_switchback
    from vsd_analytics.figures.switchback import switchback as switchback
    from vsd_analytics.figures.trend import trend as trend
    from vsd_analytics.figures.unusual import unusual as unusual
    from vsd_analytics.report.pages.story import week_report as week_report
    from vsd_analytics.report.pages.week import render_html as render_html
    from vsd_analytics.site.model import Site as Site
    from vsd_analytics.store.store import Store as Store
    from vsd_analytics.warehouse.warehouse import Warehouse as Warehouse
    from vsd_analytics.warehouse.warehouse import open_warehouse as open_warehouse

_PLACES = {
    "Days": "vsd_analytics.api.days",
    "Heatmap": "vsd_analytics.api.heatmap",
    "OpenProject": "vsd_analytics.api.project",
    "Site": "vsd_analytics.site.model",
    "Store": "vsd_analytics.store.store",
    "Table": "vsd_analytics.api.table",
    "TrackTable": "vsd_analytics.api.tracks",
    "Warehouse": "vsd_analytics.warehouse.warehouse",
    "before_after": "vsd_analytics.figures.before_after",
    "burden_map": "vsd_analytics.figures.maps",
    "cell_maps": "vsd_analytics.figures.maps",
    "compare": "vsd_analytics.figures.compare",
    "coverage": "vsd_analytics.figures.operator_counts",
    "episode_figures": "vsd_analytics.figures.episodes",
    "excess_map": "vsd_analytics.figures.maps",
    "exposure_map": "vsd_analytics.figures.maps",
    "find_project": "vsd_analytics.config.project",
    "forecast": "vsd_analytics.figures.forecast",
    "gatherings": "vsd_analytics.figures.gatherings",
    "groups": "vsd_analytics.figures.groups",
    "heatmap": "vsd_analytics.figures.operator_counts",
    "hotspots": "vsd_analytics.figures.hotspots",
    "hours": "vsd_analytics.figures.operator_counts",
    "load_site": "vsd_analytics.config.project",
    "open": "vsd_analytics.api.project",
    "open_warehouse": "vsd_analytics.warehouse.warehouse",
    "person_time": "vsd_analytics.figures.person_time",
    "plan_experiment": "vsd_analytics.figures.experiments",
    "plan_switchback": "vsd_analytics.figures.switchback",
    "render_html": "vsd_analytics.report.pages.week",
    "risk_map": "vsd_analytics.figures.maps",
    "switchback": "vsd_analytics.figures.switchback",
    "threshold_sensitivity": "vsd_analytics.figures.sensitivity",
    "trend": "vsd_analytics.figures.trend",
    "unusual": "vsd_analytics.figures.unusual",
    "week_profile": "vsd_analytics.figures.hour_of_week",
    "week_report": "vsd_analytics.report.pages.story",
}
_NAMES = {"open": "open_project"}
"""Names that differ from those in their module."""

__all__ = [
    "Days",
    "Heatmap",
    "OpenProject",
    "Site",
    "Store",
    "Table",
    "TrackTable",
    "VsdError",
    "Warehouse",
    "__version__",
    "before_after",
    "burden_map",
    "cell_maps",
    "compare",
    "coverage",
    "episode_figures",
    "excess_map",
    "exposure_map",
    "find_project",
    "forecast",
    "gatherings",
    "groups",
    "heatmap",
    "hotspots",
    "hours",
    "load_site",
    "open",
    "open_warehouse",
    "person_time",
    "plan_experiment",
    "plan_switchback",
    "render_html",
    "risk_map",
    "switchback",
    "threshold_sensitivity",
    "trend",
    "unusual",
    "week_profile",
    "week_report",
]

if not TYPE_CHECKING:  # a type checker would believe any name of a module that has `__getattr__`

    def __getattr__(name: str) -> object:
        if name not in _PLACES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(importlib.import_module(_PLACES[name]), _NAMES.get(name, name))


def __dir__() -> list[str]:
    return sorted(__all__)
