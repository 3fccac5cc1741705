"""A camera is taken out of sealed facts: rows of some hours go, those of the others of a day stay as they are.

New files come first, then the seal that names them, then the old ones go. Each step can be done again.
"""

from __future__ import annotations

from collections.abc import Collection, Set
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.store.seals import DaySeal, Seals, UnitSeal


def unseal(seals: Seals, hours: Collection[int], camera_id: str | None) -> None:
    """Remove a camera from sealed facts, and seal what remains.

    Args:
        seals: The sealed facts.
        hours: UTC hour numbers of which its rows are removed; hours that are not sealed are left out.
        camera_id: The camera; None = every camera.
    """
    days = sorted({h // 24 for h in hours})
    for day in days:
        seal = seals.read(day)
        if seal is None:
            continue
        units = {**seal.hours, **_reduced_hours(seals, seal, {h for h in hours if h in seal.hours}, camera_id)}
        whole_day = seal.camera_days
        left = {c for unit in units.values() for c in unit.last_ms}
        if whole_day is not None and (camera_id is None or camera_id not in left):
            whole_day = _with_facts(whole_day, _reduced(seals, day * 24, whole_day, camera_id))
        seals.write(replace(seal, hours=units, camera_days=whole_day))
    seals.sweep(days)  # only now: the old fact files must stay until no seal names them


def _reduced_hours(seals: Seals, seal: DaySeal, going: Set[int], camera_id: str | None) -> dict[int, UnitSeal]:
    """Return the units of a day that change when a camera (None = every one) is removed from some of its hours."""
    together = {h: unit for h, unit in seal.hours.items() if unit.is_in_day}
    hours = {}
    if of_day := going & together.keys():
        facts = _reduced(seals, seal.day * 24, together[min(of_day)], camera_id, hours=of_day)
        hours = {h: _with_facts(unit, facts) for h, unit in together.items()}
    for hour in going - together.keys():
        hours[hour] = _with_facts(seal.hours[hour], _reduced(seals, hour, seal.hours[hour], camera_id))
    for hour in going:
        last_ms = {c: ms for c, ms in hours[hour].last_ms.items() if camera_id is not None and c != camera_id}
        hours[hour] = replace(hours[hour], last_ms=last_ms)
    return hours


def _with_facts(unit: UnitSeal, facts: dict[str, str]) -> UnitSeal:
    """Return a unit with other facts, by digest; those of a camera without rows are the same."""
    return replace(unit, facts=facts, is_as_built=unit.is_as_built and facts == unit.facts)


def _reduced(
    seals: Seals, hour: int, unit: UnitSeal, camera_id: str | None, *, hours: Set[int] | None = None
) -> dict[str, str]:
    """Put the facts of a unit without the rows of a camera (None = of every camera); return their digests by fact.

    A fact that names no camera is a sum over all: nobody can subtract one of them, so no row remains.

    Args:
        seals: The sealed facts.
        hour: UTC hour number of the unit.
        unit: The unit.
        camera_id: The camera.
        hours: Hours whose rows are removed; the file has rows of others too. None = those of the whole file.
    """
    facts = {}
    for relation in unit.facts:
        data = seals.fact_path(relation, hour, unit).read_bytes()
        facts[relation] = seals.put(relation, hour, _without(data, camera_id, hours), is_in_day=unit.is_in_day)
    return facts


def _without(data: bytes, camera_id: str | None, hours: Set[int] | None) -> bytes:
    """Return a sealed file without the rows that `_reduced` removes; the same bytes where it has none of them."""
    sink, n_gone = pa.BufferOutputStream(), 0
    with pq.ParquetFile(pa.BufferReader(data)) as file:
        # the seal holds the inputs it was computed from
        schema = file.schema_arrow.remove_metadata()
        with pq.ParquetWriter(sink, schema, compression="zstd", write_page_checksum=True) as writer:
            for k in range(file.num_row_groups):  # one by one: a day of a large site has millions of rows
                rows = file.read_row_group(k).replace_schema_metadata()
                rest = rows.filter(pa.array(_staying(rows, camera_id, hours)))
                writer.write_table(rest.combine_chunks())
                n_gone += rows.num_rows - rest.num_rows
    return sink.getvalue().to_pybytes() if n_gone else data


def _staying(rows: pa.Table, camera_id: str | None, hours: Set[int] | None) -> npt.NDArray[np.bool_]:
    """Return for each row whether it stays; see `_reduced`."""
    named = [n for n in rows.column_names if n.endswith("camera_id")]  # a row may be about two cameras
    staying = np.full(rows.num_rows, camera_id is not None and bool(named))
    for name in named if camera_id is not None else ():
        staying &= pc.not_equal(rows[name], camera_id).fill_null(False).to_numpy()
    if hours is not None:
        staying |= ~np.isin(rows["hour"].to_numpy(), list(hours))
    return staying
