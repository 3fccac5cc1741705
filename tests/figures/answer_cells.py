"""Rows of answers for tests: the values of a row by column."""

from __future__ import annotations

from vsd_analytics.answer import Answer, Row, Value, value_of


class Cells:
    """A row of an answer: its values by column; `row` has everything else."""

    def __init__(self, row: Row) -> None:
        self.row = row

    def __getitem__(self, column: str) -> Value:
        return value_of(self.row, column)

    def numbers(self, *columns: str) -> tuple[float | None, ...]:
        """Return the numbers of some columns."""
        return tuple(self[column].value for column in columns)


def only_row(answer: Answer) -> Cells:
    """Return the one row of an answer."""
    (row,) = answer.rows
    return Cells(row)
