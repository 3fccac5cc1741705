"""From files to the store: find the adapter, normalise, quarantine, append, fold."""

from __future__ import annotations

import contextlib
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import datetime
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from vsd_analytics.config.reading_rules import reading_rule_of
from vsd_analytics.errors import DiskError, InputError, UsageError, VsdError, Where
from vsd_analytics.ingest.checks.check_case import Case
from vsd_analytics.ingest.checks.late_look import LateLook
from vsd_analytics.ingest.checks.sample import SAMPLE_ROWS, sample_of
from vsd_analytics.ingest.checks.understanding import SourceProfile, refused, table_head, understand
from vsd_analytics.ingest.formats.recognise import find_adapter
from vsd_analytics.ingest.intake.camera_lives import note_floors_of
from vsd_analytics.ingest.intake.import_identity import (
    content_id,
    content_of,
    import_id,
    import_line,
    known_shapes,
    note_shape,
    reading_id,
    warning_of_earlier_reading,
)
from vsd_analytics.ingest.intake.normalise import Normalised, Normaliser
from vsd_analytics.ingest.intake.pseudonyms import keys_of
from vsd_analytics.ingest.intake.quarantine_writer import Quarantine, SourceReading
from vsd_analytics.ingest.intake.rule_camera import with_named_camera
from vsd_analytics.ingest.intake.second_delivery import Door
from vsd_analytics.ingest.reading.adapter import (
    Adapter,
    IngestOptions,
    RawBatch,
    Rejected,
    Source,
    refuse_unused,
    uses_of,
)
from vsd_analytics.ingest.reading.column_hints import differing_cameras
from vsd_analytics.ingest.reading.limits import within_bounds
from vsd_analytics.ingest.reading.raw import n_rows, without_zones
from vsd_analytics.owners import denied
from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.site.cameras_by_name import nearest_camera_id
from vsd_analytics.site.model import ReadingRule, Site
from vsd_analytics.store.erasures import notes_of_erased
from vsd_analytics.store.imports import imports_of, next_run, note_import
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.store.store import FoldResult, Store
from vsd_analytics.store.stretches import far_off_notes

if TYPE_CHECKING:
    import pyarrow as pa

ENGINE_MAX_CHARS = 200
T = TypeVar("T")
_NOTHING_SAID = IngestOptions()

OF_PROFILE = {f.name for f in fields(IngestOptions)} & {f.name for f in fields(ReadingRule)} - {
    "map",
    "camera_from_name",
}
"""Options that a `[[source]]` states; beside them its `map`."""


@dataclass
class SourceResult:
    """The result of one source.

    Attributes:
        source: Name as given.
        format: Adapter that read it.
        n_records: Records acknowledged, by table.
        n_rejected: Records put into quarantine, by reason.
        examples: One rejected record per reason.
        n_dropped: Records left out on purpose, by reason.
        notes: Things the user should know.
        error: Why the rest of the source could not be read, if so.
        first_ms, last_ms: Instants of the first and last record (UTC milliseconds), None without records.
        days, cameras: Records by UTC day number; cameras with records.
        card: What was understood of it; None when nothing could be read.
        is_new_shape: Whether the project has imported no file with such columns before.
        import_id: Its id in the list of imports; "" for a dry run, or when nothing was read.
        mapping: `persons` and `map` that it was read by.
    """

    source: str
    format: str
    n_records: Counter[TableName] = field(default_factory=Counter)
    n_rejected: Mapping[str, int] = field(default_factory=dict)
    examples: Mapping[str, Rejected] = field(default_factory=dict)
    n_dropped: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)
    error: VsdError | None = None
    first_ms: int | None = None
    last_ms: int | None = None
    days: Counter[int] = field(default_factory=Counter)
    cameras: set[str] = field(default_factory=set)
    card: SourceProfile | None = None
    is_new_shape: bool = False
    import_id: str = ""
    mapping: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class IngestResult:
    """What an ingest did.

    Attributes:
        sources: One entry per source.
        fold: What the store gained; empty for a dry run and without folding.
        counted: For a dry run, what an empty store would have gained.
    """

    sources: Sequence[SourceResult]
    fold: FoldResult
    counted: FoldResult = field(default_factory=FoldResult)

    @property
    def n_rejected(self) -> int:
        """Return the number of records put into quarantine, including those whose hour was sealed meanwhile."""
        return sum(sum(s.n_rejected.values()) for s in self.sources) + self.fold.n_sealed


def ingest(
    site: Site,
    paths: Sequence[Path],
    options: IngestOptions,
    *,
    now: datetime,
    is_dry_run: bool = False,
    is_folding: bool = True,
    store: Store | None = None,
    on_bytes: Callable[[int], None] | None = None,
    on_rows: Callable[[int], None] | None = None,
    on_source: Callable[[SourceResult], None] | None = None,
    on_card: Callable[[SourceResult], None] | None = None,
    shown: Mapping[Path, str] | None = None,
) -> IngestResult:
    """Read engine output into the store of a project.

    Args:
        site: The site the files belong to.
        paths: Files, archives or folders.
        options: What the user says about them.
        now: The clock: later records are quarantined.
        is_dry_run: Read and check everything, write nothing.
        is_folding: Fold at the end; False leaves the acknowledged records in the spool.
        store: Where records are appended; None = the project's store.
        on_bytes: Called with the number of bytes read since the last call.
        on_rows: Called with the number of records put into the store since the last call.
        on_source: Called when a source is done.
        on_card: Called when a source's card is known, before any of it is stored.
        shown: What messages call a path, where it is a copy of something else.

    Returns:
        The result of each source, and what the store gained. A source that cannot be read to its end has its error in
        its result; the others are ingested all the same. So has one that is almost surely understood wrongly (E211),
        unless `options.is_sure`: nothing of it is stored.

    Raises:
        UsageError: E101, `options.camera` is no camera of the site.
        StoreError: E302, the store is damaged; what was read stays acknowledged.
        DiskError: E304 to E306, the disk refused; what was acknowledged before stays.
    """
    with_site(site, options)  # a mistake in the options is one of all files
    store = store or Store(site.acknowledged, site_id=site.site_id, ballast_mb=site.settings.ballast_mb)
    keys = keys_of(site, is_reading=is_dry_run)
    normaliser = Normaliser(site, now=now, keys=keys)
    sources = [Source(path, settings=site.settings, shown=(shown or {}).get(path)) for path in paths]
    earlier = (line.source for line in imports_of(site.root / "store").values() if not line.is_taken_back)
    differing = differing_cameras([*(source.name for source in sources), *earlier])
    results = []
    days = store.days()
    run = next_run(site.root / "store")
    with _counting(site) if is_dry_run else contextlib.nullcontext(store) as target:
        for source in sources:
            try:
                read = options_for(site, source, options)
            except InputError as error:
                result = SourceResult(source.name, options.format or "", error=error)
            else:
                result = _Ingest(
                    site, source, read, normaliser, target, now, is_dry_run, on_bytes, on_card, run, differing
                ).run()
            days |= result.days.keys()
            result.notes += far_off_notes(result.days, among=days)
            results.append(result)
            if on_source is not None:
                on_source(result)
        fold = target.fold(on_rows=on_rows) if is_folding or is_dry_run else FoldResult()
    if not is_dry_run:
        note_floors_of(site, {camera_id for result in results for camera_id in result.cameras})
    return IngestResult(results, FoldResult(), fold) if is_dry_run else IngestResult(results, fold)


@contextlib.contextmanager
def _counting(site: Site) -> Iterator[Store]:
    """Yield an empty store outside the project, which counts what a fold would leave out."""
    with tempfile.TemporaryDirectory(prefix="vsd-check-") as folder:
        yield Store(Path(folder) / "store", site_id=site.site_id)


@dataclass(frozen=True, slots=True)
class _Ingest:
    """The ingest of one source; for the attributes see `ingest`."""

    site: Site
    source: Source
    options: IngestOptions
    normaliser: Normaliser
    store: Store
    now: datetime
    is_dry_run: bool
    on_bytes: Callable[[int], None] | None
    on_card: Callable[[SourceResult], None] | None
    run_number: int
    differing_cameras: frozenset[str]
    late: LateLook = field(default_factory=LateLook)

    def run(self) -> SourceResult:
        """Read the source, look at its head, and store it."""
        options = self.options
        read_by = {"persons": options.persons, "map": options.map}
        result = SourceResult(self.source.name, options.format or "", mapping=read_by)
        folder = None if self.is_dry_run else self.site.root / "quarantine"
        quarantine = Quarantine(folder, source=self.source.name, at=self.now)
        try:
            cleaned = self.cleaned(self.batches(result), quarantine)
            head, error = _head(cleaned, rows_in=lambda pair: n_rows(pair[1].tables.values()))
            door = self.ask_at_door(result, [clean.tables for _, clean in head]) if head else None
            for number, (batch, clean) in enumerate(chain(head, () if error is not None else cleaned)):
                if number >= len(head) and door is not None:
                    result.notes += [note for note in door.look_late(clean.tables) if note not in result.notes]
                engines = batch.engines or ([options.engine] if options.engine else [])
                reading = SourceReading(result.format, options, batch.first_line, engines, result.import_id)
                quarantine.add(clean.rejected, reading=reading)
                result.n_dropped.update(clean.n_dropped)
                result.notes += [n for n in batch.notes if n not in result.notes]
                for name in reversed(TABLES):  # a frame is stored after the persons it counts
                    rows = clean.tables.get(name)
                    if rows is None or not rows.num_rows:
                        continue
                    self.store.append(name, rows, engines=engines, import_id=result.import_id)
                    result.n_records[name] += rows.num_rows
                    result.cameras.update(rows["camera_id"].unique().to_pylist())
                    _note_times(result, rows["ts"])
            result.notes += notes_of_erased(result.n_dropped)
            if error is not None:
                raise error
            is_empty = not result.n_records and not quarantine.counts and not result.notes
            if is_empty and not (result.card is not None and result.card.warnings):
                result.notes.append("W212: no record was found in it")
            if result.is_new_shape and result.card is not None and result.n_records and not self.is_dry_run:
                note_shape(self.site.root, result.card.shape)
        except DiskError:
            raise
        except VsdError as error:
            result.error = error
        quarantine.close()
        result.n_rejected, result.examples = dict(quarantine.counts), quarantine.examples
        return result

    def cleaned(self, batches: Iterator[RawBatch], quarantine: Quarantine) -> Iterator[tuple[RawBatch, Normalised]]:
        """Yield each batch with its rows in stored form."""
        for batch in batches:
            stated = batch if self.options.zone is None else without_zones(batch)
            yield batch, self.normaliser.normalise(stated, n_whole=quarantine.room)

    def ask_at_door(self, result: SourceResult, head: Sequence[Mapping[TableName, pa.Table]]) -> Door:
        """Refuse a source whose records are stored already in another spelling, unless the user is sure, or note it.

        It is noted in the list of imports before anything of it is stored; nothing is for a dry run.
        """
        content = [] if self.is_dry_run else content_of(self.source.path)
        new_id = "" if self.is_dry_run else import_id(self.site, self.options, content, kind=result.format)
        door = Door(self.site, [Store(self.site.root / "store", site_id=self.site.site_id), self.store], new_id)
        card = result.card
        if card is not None and not any(warning.code == "W230" for warning in card.warnings):
            result.card = card = replace(card, warnings=(*card.warnings, *door.look(head)))
            if card.sure_warnings and not self.is_dry_run and not self.options.is_sure:
                raise refused(self.source, card)
        if self.is_dry_run:
            return door
        identity = (new_id, content_id(content), reading_id(self.options, kind=result.format))
        line = import_line(self.source, result.format, identity, self.now, self.run_number, door.landmarks())
        for folder in dict.fromkeys((self.site.root / "store", self.site.acknowledged)):
            note_import(folder, line)
        result.import_id = new_id
        return door

    def batches(self, result: SourceResult) -> Iterator[RawBatch]:
        """Read the source with its adapter, but nothing of it where its head is almost surely understood wrongly.

        A file the system cannot open is an error of this source alone.
        """
        try:
            reader = find_adapter(self.source, self.options)
            result.format = reader.name
            refuse_unused(self.source, reader, self.options)
            batches = self.counting_bytes(within_bounds(self.source, reader.read(self.source, self.options)))
            head, error = _head(batches, rows_in=lambda batch: n_rows(batch.tables.values()))
            if head:
                self.understand(result, reader, head)
            for batch in chain(head, () if error is not None else batches):
                self.late.add(batch)
                yield batch
            result.notes += self.late.notes(import_id=result.import_id)
            if error is not None:
                raise error
        except OSError as error:
            why, fix = denied(error, self.source.path)
            what = f"{self.source.file_name} cannot be read: {error.strerror or error}"
            raise InputError(what, code="E120", where=Where(self.source.name), why=why, fix=fix) from None

    def understand(self, result: SourceResult, reader: Adapter, head: Sequence[RawBatch]) -> None:
        """Make the card of the source, and refuse what is almost surely wrong; `late` compares what follows with it."""
        sample = sample_of(head, is_whole=sum(n_rows(b.tables.values()) for b in head) < SAMPLE_ROWS)
        table = table_head(self.source, reader, self.options)
        case = Case(
            self.site,
            self.options,
            sample,
            table,
            self.source.name,
            self.differing_cameras,
            self.now,
            uses=uses_of(reader),
        )
        card = understand(case, name=reader.name)
        again = warning_of_earlier_reading(self.site, self.source, reading_id(self.options, kind=reader.name))
        card = card if again is None else replace(card, warnings=(*card.warnings, again))
        result.card = card
        result.is_new_shape = bool(card.columns) and card.shape not in known_shapes(self.site.root)
        if self.on_card is not None:
            self.on_card(result)
        if card.sure_warnings and not self.is_dry_run and not self.options.is_sure:
            raise refused(self.source, card)
        self.late.case, self.late.warnings = case, card.warnings

    def counting_bytes(self, batches: Iterator[RawBatch]) -> Iterator[RawBatch]:
        """Pass on batches, and report how far into the source they reach."""
        done = 0
        for batch in batches:
            yield batch
            if self.on_bytes is not None and batch.done_bytes > done:
                self.on_bytes(batch.done_bytes - done)
                done = batch.done_bytes
        if self.on_bytes is not None:
            self.on_bytes(max(0, self.source.size_bytes - done))


def _head(items: Iterator[T], *, rows_in: Callable[[T], int]) -> tuple[list[T], VsdError | None]:
    """Return the first batches, of at least `SAMPLE_ROWS` records if there are so many, and what ended them early."""
    head: list[T] = []
    n_found = 0
    try:
        for item in items:
            head.append(item)
            n_found += rows_in(item)
            if n_found >= SAMPLE_ROWS:
                break
    except VsdError as error:  # the batches before it count
        return head, error
    return head, None


def options_for(site: Site, source: Source, options: IngestOptions) -> IngestOptions:
    """Return the options of one source: the user's, then those of its `[[source]]` of vsd.toml, then of the site.

    Raises:
        UsageError: E101, as `with_site`.
        InputError: E213, its name should say the camera, and does not.
    """
    profile = reading_rule_of(source.name, site.sources)
    options = with_named_camera(site, source, profile, options)
    return with_site(site, options) if profile is None else options_of_rule(site, profile, options)


def options_of_rule(site: Site, profile: ReadingRule, options: IngestOptions = _NOTHING_SAID) -> IngestOptions:
    """Return the options of sources of one `[[source]]`; what the user says wins.

    Raises:
        UsageError: E101, as `with_site`.
    """
    stated = {name: getattr(profile, name) for name in OF_PROFILE}
    missing = {name: value for name, value in stated.items() if getattr(options, name) is None}
    merged = replace(options, **missing, map={**profile.map, **options.map}, profile=profile.rule_id)
    return with_site(site, merged)


def with_site(site: Site, options: IngestOptions) -> IngestOptions:
    """Return options completed from vsd.toml: the only camera, clocks, `[ingest]`.

    Raises:
        UsageError: E101, `options.camera` is no camera of the site, or `options.engine` no name.
    """
    known = {name: c for c in site.cameras for name in (c.camera_id, *c.engine_ids)}
    camera = options.camera
    is_unsaid = camera is None and options.camera_from_name is None
    is_only_camera = options.is_only_camera or (is_unsaid and len(site.cameras) == 1)
    if is_unsaid and len(site.cameras) == 1:
        camera = site.cameras[0].camera_id
    elif camera is not None and camera not in known:
        near = nearest_camera_id(camera, site.cameras)
        raise UsageError(
            f"{camera!r} is no camera of vsd.toml",
            why=f"known: {', '.join(list(known)[:20]) or 'none'}",
            in_python=f'camera="{near}"' if near else None,
            fix=f"--camera {near}" if near else "--camera with one of them, or add a [[camera]] to vsd.toml",
        )
    engine = options.engine
    if engine is not None and not (0 < len(engine) <= ENGINE_MAX_CHARS and engine.isprintable()):
        raise UsageError(
            f"--engine must be 1 to {ENGINE_MAX_CHARS} printable characters", fix='--engine "name and version"'
        )
    zones = {c.clock for c in ([known[camera]] if camera is not None else site.cameras)}
    return replace(
        options,
        camera=camera,
        is_only_camera=is_only_camera,
        site_map={**site.ingest_map, **options.site_map},
        frame_zone=options.zone or (zones.pop() if len(zones) == 1 else options.frame_zone),
        clocks={**{name: options.zone or c.clock for name, c in known.items()}, **options.clocks},
        pictures={name: c.picture_px for name, c in known.items() if c.picture_px is not None},
        line_max_bytes=int(site.settings.line_max_bytes),
        persons_max=int(site.settings.persons_max),
        pairs_max=int(site.settings.pairs_max),
        staff_classes=site.settings.staff_classes,
    )


def _note_times(result: SourceResult, ts: pa.ChunkedArray) -> None:
    import numpy as np

    instants = ts.cast("int64").to_numpy()
    low, high = int(instants.min()), int(instants.max())
    result.first_ms = low if result.first_ms is None else min(result.first_ms, low)
    result.last_ms = high if result.last_ms is None else max(result.last_ms, high)
    days, counts = np.unique(instants // (24 * HOUR_MS), return_counts=True)
    result.days.update(dict(zip(days.tolist(), counts.tolist(), strict=True)))
