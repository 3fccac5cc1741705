"""Situations of one instant: where people are, who is close to whom, and which of them form a gathering or a contact.

Places and distances follow the rules of the reports (`sql/staging/located.sql`, `sql/staging/pairs.sql`). Floor
millimetres win over pixels. Pixels go through the calibration in force. An engine that sends pairs for a frame sends
all of them. Close means strictly closer than `distance_m`.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from vsd_analytics.geometry.homography import to_floor
from vsd_analytics.settings import FLOOR_CELL_M, OWNER_CELL_M
from vsd_analytics.site.model import Area, Camera, Site
from vsd_analytics.warehouse.dimensions import area_cells
from vsd_analytics.warehouse.owner_spans import calibration_spans, owner_spans

_CROWD = 200
"""With more people than this, close ones are found with a k-d tree instead of a table of all distances."""

Floats = NDArray[np.float64]
Floats4 = tuple[float, float, float, float]
Name = tuple[Any, ...]
"""Distinguishes the people of one instant: by track id, else by place."""


class Sighting(NamedTuple):
    """A situation as one instant shows it.

    Attributes:
        tracks: Track ids of the people in it.
        n_people: Number of people in it, with and without a track id.
        x_mm, y_mm: Mean of their places, None when none is known.
        nearest_mm: Least distance between two of them.
    """

    tracks: frozenset[str]
    n_people: int
    x_mm: float | None
    y_mm: float | None
    nearest_mm: int


class Edge(NamedTuple):
    """Two people closer than `distance_m`: their numbers in the frame, and how far apart."""

    a: int
    b: int
    distance_mm: int


@dataclass(frozen=True, slots=True)
class PeopleGraph:
    """The people of one camera and instant as a graph whose edges join people close to each other.

    Attributes:
        tracks: Track id of each person, None without one.
        places: Floor millimetres of each person, None when unknown.
        edges: Pairs closer than `distance_m`.
        observed: Track ids of people with a record of their own, not only pairs.
    """

    tracks: Sequence[str | None]
    places: Sequence[tuple[float, float] | None]
    edges: Sequence[Edge]
    observed: Sequence[str]


@dataclass(slots=True)
class Instant:
    """Records of one camera and instant, collected until they are handled; the same record twice counts once.

    Attributes:
        has_engine_pairs: The engine measured the pairs of this frame itself.
        persons: Track id and place by name.
        pairs: Names, track ids, places and distance of both, by key.
    """

    has_engine_pairs: bool
    persons: dict[Name, tuple[str | None, float, float]]
    pairs: dict[Name, tuple[Name, Name, str | None, str | None, Floats4, int]]

    def add_person(self, name: Name, track: str | None, x_mm: float, y_mm: float) -> None:
        """Add a person record; of two with one name the lesser place counts, so their order changes nothing."""
        person = self.persons.get(name)
        if person is None or (math.isnan(x_mm), x_mm, y_mm) < (math.isnan(person[1]), *person[1:]):
            self.persons[name] = (track, x_mm, y_mm)


def people_graph(instant: Instant, *, distance_mm: int) -> PeopleGraph:
    """Return the people of an instant and the pairs of them closer than `distance_mm`.

    Args:
        instant: All its records; an unknown coordinate is NaN.
        distance_mm: Strictly closer than this is close.
    """
    persons = sorted(instant.persons.items(), key=lambda item: _order(item[0]))
    observed = [track for _, (track, _, _) in persons if track is not None]
    if instant.has_engine_pairs or instant.pairs:
        return _engine_graph(instant, dict(persons), observed, distance_mm)
    tracks = [track for _, (track, _, _) in persons]
    xy = np.array([(x, y) for _, (_, x, y) in persons], dtype=np.float64).reshape(-1, 2)
    places = [None if math.isnan(x) or math.isnan(y) else (x, y) for _, (_, x, y) in persons]
    return PeopleGraph(tracks, places, close_pairs(xy, distance_mm=distance_mm), observed)


def _order(name: Name) -> tuple[Any, ...]:
    return tuple((part is None, 0 if part is None else part) for part in name)


def _engine_graph(
    instant: Instant, persons: Mapping[Name, tuple[str | None, float, float]], observed: Sequence[str], distance_mm: int
) -> PeopleGraph:
    """Return the graph of the pairs that the engine sent; people known only from pairs are part of it."""
    number: dict[Name, int] = {}
    tracks: list[str | None] = []
    places: list[tuple[float, float] | None] = []

    def person(name: Name, track: str | None, x: float, y: float) -> int:
        if name not in number:
            number[name] = len(tracks)
            tracks.append(track)
            places.append(None)
        i = number[name]
        if places[i] is None and not (math.isnan(x) or math.isnan(y)):
            places[i] = (x, y)
        return i

    for name, (track, x, y) in persons.items():
        person(name, track, x, y)
    nearest: dict[tuple[int, int], int] = {}
    for _, (name_a, name_b, track_a, track_b, at, distance) in sorted(
        instant.pairs.items(), key=lambda item: _order(item[0])
    ):
        a, b = person(name_a, track_a, at[0], at[1]), person(name_b, track_b, at[2], at[3])
        if distance < distance_mm:
            nearest[a, b] = min(distance, nearest.get((a, b), distance))
    return PeopleGraph(tracks, places, [Edge(a, b, d) for (a, b), d in nearest.items()], observed)


def close_pairs(xy: Floats, *, distance_mm: int) -> list[Edge]:
    """Return the pairs strictly closer than `distance_mm`, by number, with their distance in whole mm rounded down.

    Args:
        xy: Floor millimetres, shape (n, 2); NaN for people without a place, who are close to nobody.
        distance_mm: Pairs at this distance or more are left out.
    """
    known = np.flatnonzero(~np.isnan(xy).any(axis=1))
    if len(known) < 2:
        return []
    at = xy[known]
    if len(known) > _CROWD:
        from scipy.spatial import cKDTree

        pairs = np.sort(cKDTree(at).query_pairs(distance_mm, output_type="ndarray"), axis=1)
        pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
        i, j = pairs[:, 0], pairs[:, 1]
    else:
        i, j = np.triu_indices(len(known), 1)
    d = at[i] - at[j]
    square = d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1]
    near = np.flatnonzero(square < float(distance_mm) * distance_mm)
    if not len(near):
        return []
    a, b, mm = known[i[near]], known[j[near]], np.floor(np.sqrt(square[near])).astype(np.int64)
    return [Edge(*edge) for edge in zip(a.tolist(), b.tolist(), mm.tolist(), strict=True)]


def gatherings(frame: PeopleGraph) -> list[Sighting]:
    """Return the connected components of the graph of close people, which reports call clusters."""
    if not frame.edges:
        return []
    # union-find; the lower number becomes the root, so that the order of the components is that of the people
    root = list(range(len(frame.tracks)))

    def find(i: int) -> int:
        while root[i] != i:
            root[i] = root[root[i]]
            i = root[i]
        return i

    for a, b, _ in frame.edges:
        low, high = sorted((find(a), find(b)))
        root[high] = low
    nearest: dict[int, int] = {}
    for a, _, mm in frame.edges:
        nearest[find(a)] = min(mm, nearest.get(find(a), mm))
    members: dict[int, list[int]] = defaultdict(list)
    for i in range(len(root)):
        if find(i) in nearest:
            members[find(i)].append(i)
    return [_sighting(frame, inside, nearest[members_at]) for members_at, inside in members.items()]


def contacts(frame: PeopleGraph, edges: Iterable[Edge]) -> list[Sighting]:
    """Return the given pairs of a frame that have track ids."""
    return [
        _sighting(frame, (a, b), mm)
        for a, b, mm in edges
        if frame.tracks[a] is not None and frame.tracks[b] is not None
    ]


def _sighting(frame: PeopleGraph, inside: Sequence[int], nearest_mm: int) -> Sighting:
    tracks = frozenset(t for t in (frame.tracks[i] for i in inside) if t is not None)
    at = [p for p in (frame.places[i] for i in inside) if p is not None]
    x, y = (sum(p[k] for p in at) / len(at) for k in (0, 1)) if at else (None, None)
    return Sighting(tracks, len(inside), x, y, nearest_mm)


class Ground:
    """The floor of a site: calibrations, areas, and which of overlapping cameras counts where.

    Args:
        site: The project.
    """

    def __init__(self, site: Site) -> None:
        s = site.settings
        self._cameras = {c.camera_id: c for c in site.cameras}
        self._floor = {c.camera_id: c.floor_id for c in site.cameras}
        self._cell_mm, self._owner_cell_mm = round(FLOOR_CELL_M * 1000), round(OWNER_CELL_M * 1000)
        self._coordinate_max_mm = s.coordinate_max_m * 1000.0
        self._owners: dict[str, list[tuple[int, int, dict[tuple[int, int], str]]]] = defaultdict(list)
        for span in owner_spans(site):
            owner = {(cell.cx, cell.cy): cell.camera_id for cell in span.cells}
            self._owners[span.floor_id].append((span.from_ms, span.to_ms, owner))
        self._areas = {a.area_id: _cells_of(site, a) for a in site.areas}

    def is_in(self, area_id: str, camera_id: str, x_mm: float | None, y_mm: float | None) -> bool:
        """Return whether a place of a camera is in an area: whether the middle of its floor cell is."""
        if x_mm is None or y_mm is None:
            return False
        floor_id, cells = self._areas[area_id]
        return floor_id == self._floor[camera_id] and (int(x_mm // self._cell_mm), int(y_mm // self._cell_mm)) in cells

    def is_owned(self, camera_id: str, ts_ms: int, x_mm: float | None, y_mm: float | None) -> bool:
        """Return whether this camera counts at a place and instant: whether no other is known to see it better."""
        if x_mm is None or y_mm is None:
            return True
        cell = int(x_mm // self._owner_cell_mm), int(y_mm // self._owner_cell_mm)
        spans = self._owners[self._floor[camera_id]]
        return all(
            owner.get(cell, camera_id) == camera_id for from_ms, to_ms, owner in spans if from_ms <= ts_ms < to_ms
        )

    def place(self, observations: pa.Table) -> tuple[Floats, Floats]:
        """Return floor millimetres of stored person records, shape (n,) each; NaN when unknown."""
        x, y, u, v = (_floats(observations[c]) for c in ("x_mm", "y_mm", "u_px", "v_px"))
        to_place = np.isnan(x) & ~np.isnan(u) & ~np.isnan(v)
        if to_place.any():
            coded = pc.dictionary_encode(observations["camera_id"].combine_chunks())
            code, ts_ms = coded.indices.to_numpy(zero_copy_only=False), _ts_ms(observations)
            for i, camera_id in enumerate(coded.dictionary.to_pylist()):
                camera = self._cameras.get(camera_id)
                if camera is not None:
                    rows = np.flatnonzero(to_place & (code == i))
                    x[rows], y[rows] = self._project(camera, ts_ms[rows], np.column_stack((u[rows], v[rows])))
        return x, y

    def _project(self, camera: Camera, ts_ms: NDArray[np.int64], uv: Floats) -> tuple[Floats, Floats]:
        mm = np.full_like(uv, np.nan)
        for from_ms, to_ms, calibration in calibration_spans(camera):
            rows = (ts_ms >= from_ms) & (ts_ms < to_ms)
            if rows.any():
                mm[rows] = 1000.0 * to_floor(calibration.homography, uv[rows], picture_px=camera.picture_px)
        with np.errstate(invalid="ignore"):
            mm[~(np.abs(mm) < self._coordinate_max_mm).all(axis=1)] = np.nan
        mm = np.copysign(np.floor(np.abs(mm) + 0.5), mm)
        return mm[:, 0], mm[:, 1]


def _cells_of(site: Site, area: Area) -> tuple[str, frozenset[tuple[int, int]]]:
    """Return an area's floor and cells; unlike in reports, a cell may belong to several areas."""
    rows = area_cells(replace(site, areas=(area,)))
    return area.floor_id, frozenset(zip(rows["cx"].to_pylist(), rows["cy"].to_pylist(), strict=True))


def _floats(column: pa.ChunkedArray) -> Floats:
    filled = pc.fill_null(column.cast(pa.float64()), float("nan"))
    return np.array(filled.to_numpy(), dtype=np.float64)


def _ts_ms(rows: pa.Table) -> NDArray[np.int64]:
    return np.asarray(rows["ts"].cast(pa.int64()).to_numpy(), dtype=np.int64)
