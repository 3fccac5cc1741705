"""Numbered damaged inputs: case n of a seed is the same on every machine, so that a failure can be run again."""

from __future__ import annotations

import io
from collections import Counter
from dataclasses import dataclass
from functools import cache
from random import Random

import fuzz_mutations as mutations
import pyarrow as pa
import pyarrow.parquet as pq
from fuzz_judge import Judge, Kept, Outcome, WrongRowsError
from fuzz_worlds import World, parquet, same, text_of, worlds

from vsd_analytics.ingest.formats import adapters

WORLDS = worlds()
FORMATS = (*adapters.SPECIFIC, *adapters.GENERAL)


@dataclass(frozen=True)
class Verdict:
    """One case done: its world, the kind of damage, and the outcome."""

    world: str
    damage: str
    outcome: Outcome


def run_case(judge: Judge, number: int, *, seed: int) -> Verdict:
    """Make case `number` and run it.

    Raises:
        Exception: Whatever is not a `VsdError` and came out, or `WrongRowsError`: the failure to be fixed.
    """
    rng = Random(f"{seed}/{number}")
    world = WORLDS[number % len(WORLDS)]
    if world.name == "vsd.toml":
        damage = rng.choice(sorted(mutations.ANYWHERE))
        data = mutations.ANYWHERE[damage](rng, text_of(world.lines))
        return Verdict(world.name, damage, judge.config(data))
    if not world.lines:
        return _members(judge, world, rng)
    way = rng.random()
    if way < 0.5:
        return _one_line(judge, world, rng)
    if way < 0.85 or world.pack is same or not world.file:
        return _anywhere(judge, world, rng)
    damage = rng.choice(sorted(mutations.PACKED))
    assert world.pack is not None
    data = mutations.PACKED[damage](rng, world.pack(text_of(world.lines)))
    return Verdict(world.name, f"packed: {damage}", judge.file(world, data))


def _one_line(judge: Judge, world: World, rng: Random) -> Verdict:
    """Damage one line; the rows of all the others must be stored exactly."""
    damage = rng.choice(sorted(mutations.IN_A_LINE))
    at = rng.randrange(world.first, len(world.lines))
    line = mutations.IN_A_LINE[damage](rng, world.lines[at])
    if world.file:
        line = line.replace(b"\n", b"\r")
    lines = [*world.lines]
    lines[at] = line
    outcome = _whole(judge, world, lines)
    others = _rows_without(judge, world, at)
    compare(others, outcome.rows, world.tables)
    added = sum(n for row, n in (outcome.rows - others).items() if row[0] in world.tables)
    undamaged = sum(n for row, n in (_rows_of(judge, world) - others).items() if row[0] in world.tables)
    if added > max(1 + line.count(b"{") + line.count(b"[") ** 2, undamaged):  # a line may be a whole frame
        raise WrongRowsError(f"{added} rows came from one line")
    return Verdict(world.name, f"one line: {damage}", outcome)


def _anywhere(judge: Judge, world: World, rng: Random) -> Verdict:
    """Damage the text in one place or several, or feed it to another adapter."""
    if world.file and rng.random() < 0.05:
        other = rng.choice(FORMATS)
        options = {"format": other, "start": 1_794_211_200_000, "fps": rng.choice((25.0, 1e-3, 1e3, 9e5)),
                   "first_frame": rng.choice((None, 0.0, 1.0, -9e14, 9e14)), "camera": "cam-1",
                   "period_s": rng.choice((None, 1.0, 1e-300, 0.3, 999_999.0))}  # fmt: skip
        assert world.pack is not None
        return Verdict(world.name, "another format", judge.file(world, world.pack(text_of(world.lines)), **options))
    damage, data = "", text_of(world.lines)
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        damage = rng.choice(sorted(mutations.ANYWHERE))
        data = mutations.ANYWHERE[damage](rng, data)
    if not world.file:
        return Verdict(world.name, damage, judge.payloads([data, *data.split(b"\n")]))
    assert world.pack is not None
    return Verdict(world.name, damage, judge.file(world, world.pack(data)))


def _whole(judge: Judge, world: World, lines: list[bytes]) -> Outcome:
    if not world.file:
        return judge.payloads(lines, world.ignored)
    assert world.pack is not None
    return judge.file(world, world.pack(text_of(lines)))


_known: dict[tuple[str, int | str], Kept] = {}


def compare(others: Kept, rows: Kept, tables: tuple[str, ...]) -> None:
    """Raise unless all `others` are among the rows."""
    lost = Counter({row: n for row, n in (others - rows).items() if row[0] in tables})
    if lost:
        raise WrongRowsError(f"{sum(lost.values())} rows of the others are not stored, such as {next(iter(lost))}")


def _rows_of(judge: Judge, world: World) -> Kept:
    if (world.name, "") not in _known:
        _known[world.name, ""] = _whole(judge, world, [*world.lines]).rows
    return _known[world.name, ""]


def _rows_without(judge: Judge, world: World, at: int) -> Kept:
    key = (world.name, at)
    if key not in _known:
        lines = [*world.lines]
        lines[at] = b""
        outcome = _whole(judge, world, lines)
        if outcome.word != "clean" or not outcome.rows:
            raise AssertionError(f"{world.name} is not clean before it is damaged: {outcome.word} {outcome.code}")
        _known[key] = outcome.rows
    return _known[key]


def _members(judge: Judge, world: World, rng: Random) -> Verdict:
    """Damage a member, a name, a type of column, or the packed bytes."""
    if world.file.endswith(".parquet"):
        return _parquet(judge, world, rng)
    files = dict(world.files)
    name = rng.choice(sorted(files))
    way = rng.choice(("member", "member", "name", "packed", "flags"))
    if way == "member" or (world.pack is None and way in ("packed", "flags")):
        damage = rng.choice(sorted(mutations.ANYWHERE))
        files[name] = mutations.ANYWHERE[damage](rng, files[name])
        outcome = _packed(judge, world, files)
        if not name.endswith(".ini"):  # what it says of one sequence may refuse all of them
            if (world.name, name) not in _known:
                _known[world.name, name] = _packed(judge, world, {n: d for n, d in files.items() if n != name}).rows
            compare(_known[world.name, name], outcome.rows, world.tables)
        return Verdict(world.name, f"member: {damage}", outcome)
    if way == "name":
        damage, odd = "odd name of a member", mutations.member_name(rng, name)
        files = {odd if n == name else n: d for n, d in files.items()}
        if rng.random() < 0.3:
            files[name] = world.files[name]
        return Verdict(world.name, damage, _packed(judge, world, files))
    assert world.pack is not None
    if way == "flags":
        return Verdict(world.name, "packed: flags of headers", judge.file(world, _flagged(rng, world.pack(files))))
    damage = rng.choice(sorted(mutations.PACKED))
    return Verdict(world.name, f"packed: {damage}", judge.file(world, mutations.PACKED[damage](rng, world.pack(files))))


def _packed(judge: Judge, world: World, files: dict[str, bytes]) -> Outcome:
    if world.pack is None:
        return judge.folder_of(world, files)
    return judge.file(world, world.pack(files))


def _flagged(rng: Random, data: bytes) -> bytes:
    """Change bytes of the headers of an archive: flags, methods, sizes, lengths, checksums, offsets."""
    changed = bytearray(data)
    starts = [i for mark in (b"PK\x01\x02", b"PK\x03\x04", b"PK\x05\x06", b"ustar") for i in _places(data, mark)]
    for _ in range(rng.randint(1, 3)):
        at = rng.choice(starts or [0]) + rng.randint(-256 if b"ustar" in data else 4, 46)
        if 0 <= at < len(changed):
            changed[at] = rng.choice((0, 1, 8, 12, 14, 99, 127, 128, 255, rng.randrange(256)))
    return bytes(changed)


def _places(data: bytes, mark: bytes) -> list[int]:
    found, at = [], data.find(mark)
    while at >= 0:
        found.append(at)
        at = data.find(mark, at + 1)
    return found


@cache
def _position_table(data: bytes) -> pa.Table:
    return pq.read_table(io.BytesIO(data))


def _parquet(judge: Judge, world: World, rng: Random) -> Verdict:
    data = world.files[""]
    if rng.random() < 0.4:
        damage = rng.choice(sorted(mutations.PACKED))
        plain = rng.random() < 0.5
        data = parquet(_position_table(data), compression="none" if plain else "zstd", use_dictionary=not plain)
        return Verdict(world.name, f"packed: {damage}", judge.file(world, mutations.PACKED[damage](rng, data)))
    table = _position_table(data)
    damage = ""
    for _ in range(rng.choice((1, 1, 2))):
        at = rng.randrange(table.num_columns)
        if rng.random() < 0.15:
            damage = "columns renamed"
            names = [*table.column_names]
            names[at] = rng.choice((*names, "", "_", "X_M", " ts", "track_a", "distance_m", "frame", "ü", "x" * 9999))
            table = table.rename_columns(names)
        else:
            _, column = mutations.odd_column(rng, table.column(at))
            damage = "column of another type"
            table = table.set_column(at, pa.field(table.column_names[at], column.type), column)
    try:
        data = parquet(table)
    except (pa.ArrowException, UnicodeDecodeError):  # Parquet has no such type: nothing to feed
        return Verdict(world.name, damage, judge.file(world, data))
    return Verdict(world.name, damage, judge.file(world, data))
