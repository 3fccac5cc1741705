"""JSON as a table: an array of flat objects, or one object after the other; each object is a row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source, damaged_after, empty
from vsd_analytics.ingest.reading.cell_texts import CellTable
from vsd_analytics.ingest.reading.column_hints import place_like
from vsd_analytics.ingest.reading.json_guess import guessed_mapping
from vsd_analytics.ingest.reading.json_values import json_values
from vsd_analytics.ingest.reading.table_file import Header

HEADER_ROWS = 200
"""Objects whose keys are the columns: engines leave out keys of objects that lack them."""
COLUMNS_MAX = 500


class JsonTable(CellTable):
    """One JSON file, its first objects read.

    Args:
        source: The file.
        options: `line_max_bytes` bounds an object.

    Raises:
        InputError: E202 it has no object, E204 it is no array of flat objects, E205 it is damaged from its beginning.
    """

    def __init__(self, source: Source, options: IngestOptions) -> None:
        self._source, self._max = source, options.line_max_bytes
        names: dict[str, None] = {}
        is_nested = False
        for number, (entry, _) in enumerate(self._objects(), start=1):
            names.update(dict.fromkeys(str(key) for key in entry))
            is_nested = is_nested or any(isinstance(value, list | dict) for value in entry.values())
            if number >= HEADER_ROWS or len(names) > COLUMNS_MAX:
                break
        if not names:
            raise empty(source)
        if is_nested and not place_like(names) and (guess := guessed_mapping(source)) is not None:
            raise self._deeper(guess)
        self._keys = list(names)[:COLUMNS_MAX]
        super().__init__(Header(self._keys), cell_max_bytes=int(source.settings.cell_max_bytes))

    def rows(self) -> Iterator[tuple[int, Sequence[Any], int]]:
        """Yield the objects as rows; see `CellTable.rows`."""
        for number, (value, done) in enumerate(self._objects(), start=1):
            yield number, [value.get(key) for key in self._keys], done

    def _objects(self) -> Iterator[tuple[dict[str, Any], int]]:
        """Yield the objects, and how far the file has been read."""
        for number, value, text, done in json_values(self._source, value_max_bytes=self._max, damaged=self._damaged):
            if not isinstance(value, dict):
                raise self._no_object(number, text[-80:])
            yield value, done

    def _damaged(self, number: int, text: str, error: Exception) -> InputError:
        why = str(error) if len(text) < self._max else f"an object is longer than {self._max:,} bytes (line_max_bytes)"
        return damaged_after(self._source, number, why=f"it is not JSON: {why[:200]}", what="object", text=text)

    def _deeper(self, guess: str) -> InputError:
        return InputError(
            f"{self._source.file_name} is JSON, but no table",
            code="E204",
            where=Where(self._source.name),
            why="the places of people are inside lists or objects",
            fix=f"say where its values are, probably: {guess}",
        )

    def _no_object(self, number: int, text: str) -> InputError:
        return InputError(
            f"{self._source.file_name} is JSON, but no table",
            code="E204",
            where=Where(self._source.name, number, text),
            why='a table is an array of flat objects: [{"ts": ..., "track_id": ..., "x_m": ..., "y_m": ...}, ...]',
            fix="export it like this, or as CSV",
        )
