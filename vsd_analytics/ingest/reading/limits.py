"""Limits of one source: bytes after decompression, records, unreadable records. All of them are settings.

A file may claim to be small and unpack to gigabytes, or hold millions of records that compress to nothing. What is
allowed grows with the size on disk, so that a small file can do little harm and a large honest one passes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from vsd_analytics.errors import InputError, Where
from vsd_analytics.settings import Settings

if TYPE_CHECKING:
    from vsd_analytics.ingest.reading.adapter import RawBatch, Source

MB, GB = 10**6, 10**9


def unpacked_max(n_bytes: int, settings: Settings) -> int:
    """Return how many bytes `n_bytes` on disk may unpack to: max(free, ratio x bytes), at most `unpack_max_gb`."""
    allowed = max(settings.unpack_free_mb * MB, settings.unpack_ratio_max * n_bytes)
    return int(min(allowed, settings.unpack_max_gb * GB))


def records_max(n_bytes: int, settings: Settings) -> int:
    """Return how many records `n_bytes` on disk may hold: max(free, rate x bytes), at most `records_max`."""
    allowed = max(settings.records_free, settings.records_per_byte_max * n_bytes)
    return int(min(allowed, settings.records_max))


def unpacks_too_far(name: str, *, n_bytes: int, settings: Settings, unpacked_bytes: int | None = None) -> InputError:
    """Return the error of a source that unpacks to more than is allowed: E206.

    Args:
        name: What unpacks, as a path.
        n_bytes: Its size on disk.
        settings: The bounds.
        unpacked_bytes: Bytes it unpacks to, None where reading was stopped at the bound.
    """
    allowed = unpacked_max(n_bytes, settings)
    is_small = settings.unpack_ratio_max * n_bytes < settings.unpack_free_mb * MB
    setting = "unpack_free_mb" if is_small else "unpack_ratio_max"
    setting = "unpack_max_gb" if allowed >= int(settings.unpack_max_gb * GB) else setting
    says = (
        f"{unpacked_bytes:,} bytes; at most {allowed:,} are read"
        if unpacked_bytes is not None
        else f"more than {allowed:,} bytes"
    )
    return InputError(
        f"{name.rpartition('/')[2]}, {n_bytes:,} bytes, would unpack to {says}",
        code="E206",
        where=Where(name),
        why=f"recordings compress less than {settings.unpack_ratio_max:g}-fold; it looks made to fill memory or a disk",
        fix=f"look at it; if it is right, split it, or raise {setting} under [ingest] in vsd.toml "
        f"(it is {getattr(settings, setting):g})",
    )


def too_many(source: Source, shown: str, setting: str, *, allowed: int, why: str) -> InputError:
    """Return the error of a source that goes beyond a bound: E209.

    Args:
        source: The source.
        shown: What it has, after "it has", such as "3 pages".
        setting: The setting that bounds it.
        allowed: The bound that is in force.
        why: A sentence for people.
    """
    return InputError(
        f"{source.file_name} has {shown}; at most {allowed:,} are read",
        code="E209",
        where=Where(source.name),
        why=why,
        fix=f"look at it; if it is right, split it, or raise {setting} under [ingest] in vsd.toml "
        f"(it is {getattr(source.settings, setting):,})",
    )


def too_many_records(source: Source, n_found: int) -> InputError:
    """Return the error of a source with more records than its size allows: E209."""
    settings, allowed = source.settings, records_max(source.size_bytes, source.settings)
    is_small = settings.records_per_byte_max * source.size_bytes < settings.records_free
    setting = "records_free" if is_small else "records_per_byte_max"
    setting = "records_max" if allowed >= settings.records_max else setting
    why = f"{source.size_bytes:,} bytes hold so many records only if they all say the same"
    if setting == "records_max":
        why = "a day of 30 cameras at 10 Hz with five people in view has 415 million"
    return too_many(source, f"{n_found:,} records or more", setting, allowed=allowed, why=why)


def within_bounds(source: Source, batches: Iterable[RawBatch]) -> Iterator[RawBatch]:
    """Pass on the batches of a source while they are within its bounds.

    Raises:
        InputError: E209 beyond the number of records, or of records that cannot be read. The batch that goes beyond is
            passed on first: what was read counts.
    """
    settings = source.settings
    n_records, n_unreadable, allowed = 0, 0, records_max(source.size_bytes, settings)
    for batch in batches:
        yield batch
        n_records += sum(t.num_rows for t in batch.tables.values())
        n_unreadable += len(batch.rejected)
        if n_records > allowed:
            raise too_many_records(source, n_records)
        if n_unreadable > settings.unreadable_max:
            shown = f"{n_unreadable:,} records or more that cannot be read"
            why = "so many point to a wrong format, a wrong column or damage; those before stay, each counted once"
            raise too_many(source, shown, "unreadable_max", allowed=settings.unreadable_max, why=why)
