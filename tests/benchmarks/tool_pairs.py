"""How many persons a second each tool compares with all others of their frame: who is within 2.5 m of whom."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
REACH_MM: Final = 2500
SIDE_MM: Final = 15_000
"""People stand anywhere on a square of this side."""
Crowd = tuple[Ints, Ints, Ints]
"""Frame number, x and y in millimetres of each person, in order of frames."""


def crowd(n_persons: int, *, per_frame: int, seed: int = 1) -> Crowd:
    """Return frames with `per_frame` people each, everybody at a place of their own."""
    rng = np.random.default_rng(seed)
    x, y = rng.integers(0, SIDE_MM, (2, n_persons))
    return np.arange(n_persons) // per_frame, x, y


def ours(people: Crowd) -> int:
    """Count pairs as the fact `pairs` does (`warehouse/accelerated/pairs.py`)."""
    from vsd_analytics.warehouse.accelerated.pairs import near

    return len(near(*people, REACH_MM)[0])


def numpy_shifts(people: Crowd) -> int:
    """Compare each person with the next one, the one after it, and so on, while they are of one frame."""
    frame, x, y = people
    n = 0
    for k in range(1, int(np.bincount(frame).max())):
        is_near = (x[k:] - x[:-k]) ** 2 + (y[k:] - y[:-k]) ** 2 <= REACH_MM**2
        n += len(np.flatnonzero(is_near & (frame[k:] == frame[:-k])))
    return n


def scipy_tree(people: Crowd) -> int:
    """Ask one KD-tree of scipy, with the frame as a third coordinate that nobody reaches across."""
    from scipy.spatial import cKDTree

    frame, x, y = people
    points = np.column_stack([x, y, frame * (2 * REACH_MM)]).astype(np.float64)
    return len(cKDTree(points).query_pairs(REACH_MM, output_type="ndarray"))


def duckdb_join(people: Crowd) -> int:
    """Join the people of a frame with each other in DuckDB."""
    from vsd_analytics.store.duck import connect

    with connect() as con:
        con.register("people", _table(people))
        con.execute("create temp table p as select * from people")
        return int(
            con.execute(
                "select count(*) from p as a inner join p as b on a.frame = b.frame and a.n < b.n "
                "where (a.x - b.x) ** 2 + (a.y - b.y) ** 2 <= $square",
                {"square": REACH_MM**2},
            ).fetchall()[0][0]
        )


def polars_join(people: Crowd) -> int:
    """Join the people of a frame with each other in polars."""
    import polars as pl

    frame, x, y = people
    p = pl.DataFrame({"frame": frame, "n": np.arange(len(frame)), "x": x, "y": y}).lazy()
    is_near = (pl.col("x") - pl.col("x_b")) ** 2 + (pl.col("y") - pl.col("y_b")) ** 2 <= REACH_MM**2
    both = p.join(p, on="frame", suffix="_b").filter((pl.col("n") < pl.col("n_b")) & is_near)
    return int(both.select(pl.len()).collect(engine="streaming").item())


PAIRS: Final[Mapping[str, Callable[[Crowd], int]]] = {
    "vsd, the step of its facts": ours,
    "numpy, shifts": numpy_shifts,
    "polars, join": polars_join,
    "DuckDB, self join": duckdb_join,
    "scipy, KD-tree": scipy_tree,
}


def _table(people: Crowd) -> Any:
    import pyarrow as pa

    frame, x, y = people
    return pa.table({"frame": frame, "n": np.arange(len(frame)), "x": x, "y": y})
