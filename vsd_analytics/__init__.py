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
    "compare": "vsd_analytics.analysis.compare",
    "coverage": "vsd_analytics.warehouse.figures",
    "episode_figures": "vsd_analytics.analysis.episodes",
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
    "render_html": "vsd_analytics.report.render",
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
    "compare",
    "coverage",
    "episode_figures",
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
    "render_html",
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
