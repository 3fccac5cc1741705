"""Reading entries of the quarantine again, with vsd.toml and the user's options as they are now."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import IO, Any

import msgspec
import numpy as np

from vsd_analytics.config.reading_rules import reading_rule_of
from vsd_analytics.errors import InputError
from vsd_analytics.ingest.formats.adapters import adapter
from vsd_analytics.ingest.intake.pipeline import OF_PROFILE, with_site
from vsd_analytics.ingest.intake.quarantine_writer import SourceReading
from vsd_analytics.ingest.intake.rule_camera import ids_by_name
from vsd_analytics.ingest.reading.adapter import Adapter, IngestOptions, RawBatch, Rejected, Source
from vsd_analytics.ingest.reading.instants import local_to_utc, utc_to_local
from vsd_analytics.ingest.reading.named_camera import camera_of
from vsd_analytics.ingest.reading.raw import rows_table, without_zones
from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store.quarantine import QuarantineEntry

_DEFAULTS = IngestOptions()
_NO_ROW = (ValueError, TypeError, OverflowError)


class Rereader:
    """Reads entries of one site again.

    Args:
        site: The site.
        options: New options of the user; fields at their defaults are taken from the ingest.

    Raises:
        UsageError: E101, `options.camera` is no camera of the site.
    """

    def __init__(self, site: Site, options: IngestOptions = _DEFAULTS) -> None:
        self.site = site
        self.options = options
        self._completed = with_site(site, options)

    def reading(self, entry: QuarantineEntry) -> SourceReading | None:
        """Return how lines like this one are read now.

        The options of their ingest hold, those of its `[[source]]` as vsd.toml has it today, and the user's new ones.
        """
        if entry.row is not None or entry.format is None:
            return None
        new = {f.name: getattr(self.options, f.name) for f in fields(IngestOptions)}
        changes = {name: value for name, value in new.items() if value != getattr(_DEFAULTS, name)}
        try:
            options = replace(self._as_today(msgspec.convert(entry.options, IngestOptions)), **changes)
        except msgspec.ValidationError as error:
            raise InputError("an entry of the quarantine was changed by hand", why=str(error)) from None
        if options.camera is None:
            options = replace(options, camera=self._camera_of(entry))
        return SourceReading(options.format or entry.format, options, entry.first_line, entry.engines, entry.import_id)

    def _as_today(self, options: IngestOptions) -> IngestOptions:
        profile = next((p for p in self.site.sources if p.rule_id == options.profile), None)
        if profile is None:
            return options
        names = (*OF_PROFILE, *(["map"] if profile.map else []))
        stated: dict[str, Any] = {n: value for n in names if (value := getattr(profile, n)) is not None}
        return replace(options, **stated)

    def _camera_of(self, entry: QuarantineEntry) -> str | None:
        """Return the camera that the `[[source]]` of an entry's file says today, itself or by the file's name."""
        profile = None if entry.is_live else reading_rule_of(entry.source, self.site.sources)
        if profile is None or profile.camera_from_name is None:
            return None if profile is None else profile.camera
        source, known = Source(Path(entry.source.replace("\0", " "))), ids_by_name(self.site)
        try:
            return camera_of(source, profile.camera_from_name, known, rule_id=profile.rule_id)
        except InputError:  # the entry stays with its reason
            return None

    def batches(
        self, group: Sequence[QuarantineEntry], reading: SourceReading | None, *, reader: Adapter | None = None
    ) -> Iterator[RawBatch]:
        """Read the entries again; the column `line` and the rejected carry their numbers in the group.

        Args:
            group: Entries for which `how_read` returns the same text.
            reading: Their `reading`.
            reader: Adapter that reads their lines; None = the one of their format.
        """
        if reading is None:
            for name in TABLES:
                numbers = [i for i, e in enumerate(group) if e.table == name and e.row is not None]
                if numbers:
                    yield self._rows(name, group, numbers)
            return
        lines = _Lines.of(group)
        for batch in (reader or adapter(reading.format)).read(lines, with_site(self.site, reading.options)):
            tables = {n: lines.renumbered(t) for n, t in batch.tables.items()}
            bad = [replace(r, line=r.line - lines.n_above - 1) for r in batch.rejected if r.line > lines.n_above]
            read = replace(batch, tables=tables, rejected=bad, notes=())
            yield read if reading.options.zone is None else without_zones(read)

    def _rows(self, name: TableName, group: Sequence[QuarantineEntry], numbers: Sequence[int]) -> RawBatch:
        cameras = {i: self._completed.camera or self._camera_of(group[i]) for i in numbers}
        default = {i: {} if camera is None else {"camera": camera} for i, camera in cameras.items()}
        rows = {i: {**default[i], **(group[i].row or {})} for i in numbers}
        try:
            return RawBatch({name: rows_table(name, list(rows.values()), lines=numbers)})
        except _NO_ROW:
            bad = []
        for i in numbers:
            try:
                rows_table(name, [rows[i]], lines=[i])
            except _NO_ROW as error:
                bad.append(Rejected(i, group[i].reason, f"the entry holds no raw row: {error}"))
                del rows[i]
        return RawBatch({name: rows_table(name, list(rows.values()), lines=list(rows))}, bad)

    def on_clocks(self, batch: RawBatch) -> RawBatch:
        """Convert times without an offset from the zone they were read in to the clock their camera has now."""
        clocks = {name: c.clock for c in self.site.cameras for name in (c.camera_id, *c.engine_ids)}
        return replace(batch, tables={n: _moved(t, clocks) for n, t in batch.tables.items()})


def how_read(entry: QuarantineEntry) -> str:
    """Return the same text for entries that may be read together."""
    how = [entry.format, entry.options, entry.first_line] if entry.row is None else None
    return msgspec.json.encode(how).decode()


def _moved(rows: Any, clocks: Mapping[str, str]) -> Any:
    import pyarrow as pa

    zones, cameras = rows["zone"].to_pylist(), rows["camera"].to_pylist()
    now = [None if zone is None else clocks.get(camera, zone) for zone, camera in zip(zones, cameras, strict=True)]
    moves = {(was, to) for was, to in zip(zones, now, strict=True) if was is not None and to is not None and was != to}
    if not moves:
        return rows
    ts_ms = np.array(rows["ts_ms"].fill_null(0).to_numpy(), dtype=np.int64)
    for was, to in sorted(moves):
        at = np.array([(was, to) == pair for pair in zip(zones, now, strict=True)])
        ts_ms[at] = local_to_utc(utc_to_local(ts_ms[at], was), to)[0]
    is_null = rows["ts_ms"].is_null().to_numpy()
    moved = rows.set_column(rows.schema.get_field_index("ts_ms"), "ts_ms", pa.array(ts_ms, pa.int64(), mask=is_null))
    return moved.set_column(rows.schema.get_field_index("zone"), "zone", pa.array(now, pa.string()))


@dataclass(frozen=True, slots=True)
class _Lines(Source):
    """Lines of quarantine as a file of their format.

    Attributes:
        content: The file.
        n_above: Lines above the first entry's.
    """

    content: bytes
    n_above: int

    @staticmethod
    def of(group: Sequence[QuarantineEntry]) -> _Lines:
        """Return a file of the first line, if there is one, and the lines of entries read alike."""
        above = [group[0].first_line] if group[0].first_line else []
        # a JSON message from a broker may have line breaks, which are blanks to JSON
        lines = [*above, *(e.text.replace("\r\n", " ").replace("\n", " ") for e in group)]
        path = Path(group[0].source.replace("\0", " "))
        return _Lines(path, ("\n".join(lines) + "\n").encode(), len(above))

    @property
    def size_bytes(self) -> int:
        """Return the number of bytes of all lines."""
        return len(self.content)

    def open(self) -> IO[bytes]:
        """Return a stream of the lines."""
        return io.BytesIO(self.content)

    def head(self, n_bytes: int = 65536) -> bytes:
        """Return the first bytes."""
        return self.content[:n_bytes]

    def renumbered(self, table: Any) -> Any:
        """Return raw rows with the number of their entry as `line`, without those of the first line."""
        import pyarrow.compute as pc

        table = table.filter(pc.greater(table["line"], self.n_above))
        at = table.schema.get_field_index("line")
        return table.set_column(at, table.schema.field("line"), pc.subtract(table["line"], self.n_above + 1))
