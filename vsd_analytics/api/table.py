"""Rows that an analyst reads: as pandas, polars or Arrow, and short when printed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.errors import UsageError, nearest

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

SHOWN_ROWS: Final = 8
PLACE: Final = ("x_m", "y_m")
"""Columns of a place on a floor, metres; trajectories have them too."""


class Table:
    """Rows with named columns; instants have their time zone, and what is unknown is null, never 0.

    `len(table)`, `table["column"]` (a list) and iteration over rows (dictionaries) work. polars, DuckDB and every other
    reader of Arrow's C stream take it as it is.

    Args:
        rows: The rows.
        title: What they are, for printing.
        note: Why there are none, or what a reader must know; empty for nothing.
    """

    def __init__(self, rows: pa.Table, *, title: str, note: str = "") -> None:
        self._rows = rows
        self.title = title
        self.note = note

    @property
    def columns(self) -> list[str]:
        """Return the names of the columns.

        Example:
            >>> week.coverage.columns
            ['camera_id', 'local_date', 'open_h', 'recorded_h']
        """
        return list(self._rows.column_names)

    def __len__(self) -> int:
        return int(self._rows.num_rows)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yield the rows as dictionaries, instants with their zone."""
        for batch in self._rows.to_batches(max_chunksize=1000):
            yield from batch.to_pylist()

    def __getitem__(self, column: str) -> list[Any]:
        """Return the values of a column, None where unknown.

        Raises:
            UsageError: E101, there is no such column.

        Example:
            >>> week.hours["state"][10]
            'full'
        """
        self._check(column)
        values: list[Any] = self._rows[column].to_pylist()
        return values

    def __contains__(self, column: object) -> bool:
        return column in self._rows.column_names

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """Return the rows as Arrow's C stream, which polars, DuckDB, pandas and others read without a copy."""
        return self._rows.__arrow_c_stream__(requested_schema)

    def total(self, column: str) -> int | float | None:
        """Return the sum of the known values of a column, None where none is known: a sum of nothing is not 0.

        Raises:
            UsageError: E101, there is no such column, or it holds no numbers.

        Example:
            >>> week.hours.total("n_violations") == len(week.violations)
            True
        """
        self._check(column)
        kind = self._rows.schema.field(column).type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            raise UsageError(f"{column} cannot be summed", why=f"its values are of type {kind}")
        total: int | float | None = pc.sum(self._rows[column], min_count=1).as_py()
        return total

    def arrow(self) -> pa.Table:
        """Return the rows as an Arrow table, without a copy.

        Example:
            >>> week.hours.arrow().num_rows
            168
        """
        return self._rows

    def df(self) -> pd.DataFrame:
        """Return the rows as a pandas frame: days are `datetime64`, numbers that may be null are `Int64` and `Float64`.

        A sum of unknown values is `<NA>`, not 0, also by group and of frames put together. After arithmetic
        (`frame["n"] + 1`) or `astype` pandas' own rule holds, and it is 0.

        Example:
            >>> str(week.hours.df()["n_violations"].dtype)
            'Int64'
        """
        import pandas as pd

        from vsd_analytics.api.unknown_numbers import unknown_floats, unknown_integers

        frame: pd.DataFrame = self._rows.to_pandas(date_as_object=False)
        for column in self._rows.schema:
            values = self._rows[column.name]
            if values.null_count and pa.types.is_integer(column.type):
                frame[column.name] = pd.Series(unknown_integers(values), index=frame.index)
            elif values.null_count and pa.types.is_floating(column.type):
                frame[column.name] = pd.Series(unknown_floats(values), index=frame.index)
        return frame

    def pl(self) -> pl.DataFrame:
        """Return the rows as a polars frame. Its `sum` of unknown values is 0; `total` says None.

        Raises:
            UsageError: E101, polars is not installed.

        Example:
            >>> week.hours.pl().shape[0]
            168
        """
        try:
            import polars as pl
        except ImportError:
            raise UsageError("polars is not installed", fix="pip install polars, or use .df() or .arrow()") from None
        frame = pl.from_arrow(self._rows)
        assert isinstance(frame, pl.DataFrame)
        return frame

    def geojson(self) -> dict[str, Any]:
        """Return the rows with a known place as GeoJSON points in floor metres; other columns are their properties.

        Raises:
            UsageError: E101, the rows have no places.

        Example:
            >>> week.violations.geojson()["features"][0]["geometry"]["type"]
            'Point'
        """
        if not set(PLACE) <= set(self.columns):
            raise UsageError(
                f"{self.title}: there are no places", why=f"GeoJSON needs the columns {' and '.join(PLACE)}",
                fix="violations, episodes, cells, hotspots and trajectories have them",
            )  # fmt: skip
        features = []
        for row in self:
            x_m, y_m = (row.pop(name) for name in PLACE)
            if x_m is not None and y_m is not None:
                texts = {k: v.isoformat() if hasattr(v, "isoformat") else v for k, v in row.items()}
                point = {"type": "Point", "coordinates": [x_m, y_m]}
                features.append({"type": "Feature", "properties": texts, "geometry": point})
        return {"type": "FeatureCollection", "features": features}

    def _check(self, column: str) -> None:
        if column not in self.columns:
            near = nearest(str(column), self.columns)
            raise UsageError(
                f"{self.title}: there is no column {column!r}",
                why=f"these are {', '.join(self.columns)}",
                fix=f'did you mean "{near}"?' if near else None,
            )

    def _head(self) -> Table:
        return Table(self._rows.slice(0, SHOWN_ROWS), title=self.title)

    def __repr__(self) -> str:
        lines = [f"{self.title}: {len(self):,} rows, {len(self.columns)} columns", *([self.note] if self.note else [])]
        if len(self):
            lines.append(self._head().df().to_string(index=False, max_cols=8, max_colwidth=28))
        if len(self) > SHOWN_ROWS:
            lines.append(f"... {len(self) - SHOWN_ROWS:,} more; .df(), .pl() or .arrow() returns all")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return the first rows for a notebook, written and drawn as in the report; texts are escaped."""
        from vsd_analytics.api.notebook_html import table_html

        rows = self._rows.slice(0, SHOWN_ROWS).to_pylist()
        return table_html(rows, columns=self.columns, title=self.title, note=self.note, n_rows=len(self))
