"""Answers on places as GeoJSON in floor metres."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from vsd_analytics.answer import Answer, Reason
from vsd_analytics.render.frame import arrow
from vsd_analytics.render.json_form import cell_json
from vsd_analytics.render.significant import rounded
from vsd_analytics.wording.reasons import reason_text, text_or_none

_PLANE: Final = Reason("unit.plane")
Outline = Sequence[Sequence[Sequence[Sequence[float]]]]
"""Polygons: outer ring, then holes; each corner once."""


def geojson(answers: Iterable[Answer], outlines: Mapping[str, Outline], *, key: str) -> dict[str, Any]:
    """Return a GeoJSON FeatureCollection (RFC 7946 but for its plane: floor metres), one feature for each row.

    Properties are the columns of `frame.arrow` and the answer's name; `coordinate_system`, of the collection and of
    each feature, names the plane. Floats have 6 significant digits.

    Args:
        answers: Answers on one floor and the same days.
        outlines: Polygons by the cell of `key`.
        key: Key column that names an outline.
    """
    plane, features = reason_text(_PLANE), []
    lists = list(answers)
    for answer in lists:
        for row in arrow(answer).to_pylist():
            polygons = [[[*ring, ring[0]] for ring in polygon] for polygon in outlines[row[key]]]
            plain = {name: cell_json(cell) for name, cell in row.items()}
            features.append(
                {
                    "type": "Feature",
                    "id": row[key],
                    "properties": rounded({"answer": answer.name, **plain, "coordinate_system": plane}),
                    "geometry": {"type": "MultiPolygon", "coordinates": rounded(polygons)},
                }
            )
    first = lists[0]
    holds = first.holds_for
    return {
        "type": "FeatureCollection",
        "floor_id": holds.floor_id,
        "first": holds.first.isoformat(),
        "last": holds.last.isoformat(),
        "coordinate_system": plane,
        "state": first.state,
        "reason": text_or_none(first.nothing),
        "notes": [reason_text(note) for answer in lists for _, note in answer.notes],
        "features": features,
    }
