"""The formats that can be read: those of this package, and those of installed plug-ins.

A plug-in is a package with an entry point in the group `vsd_analytics.adapters`: its name is the format, its value a
class (or function) that makes the adapter, such as `acme = "acme_vsd:Acme"`.
"""

from __future__ import annotations

import difflib
import importlib
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING

from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    from vsd_analytics.ingest.reading.adapter import Adapter

GROUP = "vsd_analytics.adapters"

SPECIFIC = {
    "frames": "vsd_analytics.ingest.formats.frames:Frames",
    "smart-social-distancing": "vsd_analytics.ingest.formats.smart_social_distancing:SmartSocialDistancing",
    "motchallenge": "vsd_analytics.ingest.formats.motchallenge:MotChallenge",
    "wildtrack": "vsd_analytics.ingest.formats.wildtrack:Wildtrack",
    "supervision": "vsd_analytics.ingest.formats.supervision:Supervision",
    "nvidia": "vsd_analytics.ingest.formats.nvidia:Nvidia",
    "axis-scene": "vsd_analytics.ingest.formats.axis_scene:AxisScene",
    "azure-spatial-analysis": "vsd_analytics.ingest.formats.azure_spatial_analysis:AzureSpatialAnalysis",
    "onvif": "vsd_analytics.ingest.formats.onvif:Onvif",
    "otvision": "vsd_analytics.ingest.formats.otvision:OTVision",
    "sociopatterns": "vsd_analytics.ingest.formats.sociopatterns:SocioPatterns",
    "jupedsim": "vsd_analytics.ingest.formats.jupedsim:JuPedSim",
    "kitti": "vsd_analytics.ingest.formats.kitti:Kitti",
    "trajectories": "vsd_analytics.ingest.formats.trajectories:Trajectories",
}
"""Formats of one engine or data set, the most particular first. They look at a file before plug-ins and tables do."""

GENERAL = {
    "json": "vsd_analytics.ingest.formats.json_map:JsonMap",
    "table": "vsd_analytics.ingest.formats.tables:Tables",
    "positions": "vsd_analytics.ingest.formats.tables:positions",
    "pairs": "vsd_analytics.ingest.formats.tables:pairs",
}


@cache
def plug_ins() -> dict[str, EntryPoint]:
    """Return the entry points of installed plug-ins by format; ours cannot be replaced."""
    points = sorted(entry_points(group=GROUP), key=lambda point: (point.name, point.value))
    return {point.name: point for point in points if point.name not in {**SPECIFIC, **GENERAL}}


def formats() -> tuple[str, ...]:
    """Return the values of `--format`, in the order in which they look at a file."""
    return (*SPECIFIC, *plug_ins(), *GENERAL)


def adapter(name: str) -> Adapter:
    """Return the adapter of a format.

    Raises:
        UsageError: E101 there is no such format, E106 its plug-in cannot be loaded.
    """
    ours = {**SPECIFIC, **GENERAL}
    if name in ours:
        module, _, attribute = ours[name].partition(":")
        reader: Adapter = getattr(importlib.import_module(module), attribute)()
        return reader
    if name not in plug_ins():
        near = difflib.get_close_matches(name, formats(), n=1)
        raise UsageError(
            f"no format is called {name!r}",
            why=f"known: {', '.join(formats())}",
            fix=f"--format {near[0] if near else 'positions'}",
        )
    return _load(plug_ins()[name])


def _load(point: EntryPoint) -> Adapter:
    distribution = point.dist.name if point.dist is not None else point.value
    try:
        reader: Adapter = point.load()()
        lacking = [part for part in ("name", "coordinates", "detects", "read") if not hasattr(reader, part)]
        if lacking:
            raise TypeError(f"{point.value} has no {', '.join(lacking)}")
    except Exception as error:  # a plug-in is foreign code: whatever it raises must name it
        raise UsageError(
            f"the plug-in {distribution} of format {point.name} cannot be loaded",
            code="E106",
            why=f"{type(error).__name__}: {error}",
            fix=f"upgrade it, or remove it: pip uninstall {distribution}",
        ) from error
    return reader
