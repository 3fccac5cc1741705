"""vsd_analytics: the output of any visual social distancing engine in, decisions about a space out.

The public API; everything heavy is imported when first used.

Example:
    >>> import vsd_analytics
    >>> sorted(vsd_analytics.__all__)[:3]
    ['Site', 'Store', 'VsdError']
"""

from __future__ import annotations

import importlib
from typing import Any

from vsd_analytics.errors import VsdError
from vsd_analytics.version import VERSION as __version__  # noqa: N811

_PLACES = {
    "Site": "vsd_analytics.site.model",
    "Store": "vsd_analytics.store",
    "Warehouse": "vsd_analytics.warehouse.warehouse",
    "before_after": "vsd_analytics.figures.before_after",
    "burden_map": "vsd_analytics.figures.maps",
    "cell_maps": "vsd_analytics.figures.maps",
    "compare": "vsd_analytics.figures.compare",
    "coverage": "vsd_analytics.figures.operator_counts",
    "episode_figures": "vsd_analytics.figures.episodes",
    "excess_map": "vsd_analytics.figures.maps",
    "exposure_map": "vsd_analytics.figures.maps",
    "find_project": "vsd_analytics.config",
    "forecast": "vsd_analytics.figures.forecast",
    "gatherings": "vsd_analytics.figures.gatherings",
    "groups": "vsd_analytics.figures.groups",
    "heatmap": "vsd_analytics.figures.operator_counts",
    "hotspots": "vsd_analytics.figures.hotspots",
    "hours": "vsd_analytics.figures.operator_counts",
    "ingest": "vsd_analytics.ingest.pipeline",
    "load_site": "vsd_analytics.config",
    "open_warehouse": "vsd_analytics.warehouse.warehouse",
    "person_time": "vsd_analytics.figures.person_time",
    "plan_experiment": "vsd_analytics.figures.experiments",
    "render_html": "vsd_analytics.report.pages.week",
    "risk_map": "vsd_analytics.figures.maps",
    "threshold_sensitivity": "vsd_analytics.figures.sensitivity",
    "trend": "vsd_analytics.figures.trend",
    "unusual": "vsd_analytics.figures.unusual",
    "week_profile": "vsd_analytics.figures.hour_of_week",
    "week_report": "vsd_analytics.report.model.assemble",
}

__all__ = [
    "Site",
    "Store",
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
    "ingest",
    "load_site",
    "open_warehouse",
    "person_time",
    "plan_experiment",
    "render_html",
    "risk_map",
    "threshold_sensitivity",
    "trend",
    "unusual",
    "week_profile",
    "week_report",
]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_PLACES[name]), name)
