"""Rows that an analyst reads: as pandas, polars or Arrow, and short when printed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import pyarrow as pa

from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

SHOWN_ROWS: Final = 8


class Table:
    """Rows with named columns; instants have their time zone, and what is unknown is null, never 0.

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

    def arrow(self) -> pa.Table:
        """Return the rows as an Arrow table, without a copy.

        Example:
            >>> week.hours.arrow().num_rows
            168
        """
        return self._rows

    def df(self) -> pd.DataFrame:
        """Return the rows as a pandas frame: days are `datetime64`, whole numbers that may be null are `Int64`.

        Example:
            >>> str(week.hours.df()["n_violations"].dtype)
            'Int64'
        """
        import pandas as pd

        frame: pd.DataFrame = self._rows.to_pandas(date_as_object=False)
        for column in self._rows.schema:
            if pa.types.is_integer(column.type) and self._rows[column.name].null_count:
                frame[column.name] = pd.array(self._rows[column.name].to_pylist(), dtype="Int64")
        return frame

    def pl(self) -> pl.DataFrame:
        """Return the rows as a polars frame.

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
