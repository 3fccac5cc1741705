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
    "Site": "vsd_analytics.site",
    "Store": "vsd_analytics.store",
    "Warehouse": "vsd_analytics.warehouse.warehouse",
    "before_after": "vsd_analytics.analysis.before_after",
    "burden_map": "vsd_analytics.analysis.maps",
    "cell_maps": "vsd_analytics.analysis.maps",
    "compare": "vsd_analytics.analysis.compare",
    "coverage": "vsd_analytics.warehouse.figures",
    "episode_figures": "vsd_analytics.analysis.episodes",
    "excess_map": "vsd_analytics.analysis.maps",
    "exposure_map": "vsd_analytics.analysis.maps",
    "find_project": "vsd_analytics.config",
    "forecast": "vsd_analytics.analysis.forecast",
    "gatherings": "vsd_analytics.analysis.gatherings",
    "groups": "vsd_analytics.analysis.groups",
    "heatmap": "vsd_analytics.warehouse.figures",
    "hotspots": "vsd_analytics.analysis.hotspots",
    "hours": "vsd_analytics.warehouse.figures",
    "ingest": "vsd_analytics.ingest.pipeline",
    "load_site": "vsd_analytics.config",
    "open_warehouse": "vsd_analytics.warehouse.warehouse",
    "person_time": "vsd_analytics.analysis.person_time",
    "render_html": "vsd_analytics.report.render",
    "risk_map": "vsd_analytics.analysis.maps",
    "threshold_sensitivity": "vsd_analytics.analysis.sensitivity",
    "trend": "vsd_analytics.analysis.trend",
    "unusual": "vsd_analytics.analysis.unusual",
    "week_profile": "vsd_analytics.analysis.hour_of_week",
    "week_report": "vsd_analytics.report.assemble",
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
