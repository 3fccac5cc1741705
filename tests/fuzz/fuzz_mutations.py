"""Ways to damage an input. Each takes a random source and the bytes (or one line) and returns other bytes."""

from __future__ import annotations

import json
import re
import string
from collections.abc import Callable, Mapping
from decimal import Decimal
from random import Random
from typing import Any

import pyarrow as pa

NUMBERS = (
    b"NaN", b"nan", b"inf", b"-Infinity", b"1e999", b"-1e999", b"1e-400", b"-0", b"-0.0", b"", b" ", b"0x10",
    b"1_0", b"1,5",
    b"9223372036854775807", b"9223372036854775808", b"-9223372036854775809", b"18446744073709551616", b"9" * 400,
    b"9" * 5000, b"1" + b"0" * 5000, b"0." + b"3" * 3000, b"1e308", b"2147483648", b"-2147483649", b"1e15", b"true",
    b"null", b"None", b"1794211200", b"1794211200000", b"1794211200000000000", b"-1", b"0", b"00012", b"+5",
    b".5", b"5.",
    b"1e5", b"1E+05", "٣".encode(), "１".encode(), "½".encode(), b"0000-00-00", b"2026-02-30T00:00:00Z",
    b"2026-11-09T24:00:00Z", b"2026-11-09T09:00:60Z", b"9999-12-31T23:59:59-12:00", b"0001-01-01T00:00:00+14:00",
    b"2026-11-09T09:00:00.123456789123Z", b"2026-11-09 09:00:00", b"2026-10-25T02:30:00", b"2026-11-09T09:00:00+99:99",
)  # fmt: skip
TEXTS = (
    b'"', b"'", b'""', b'"a', b"\\", b"\x00", b"\xff\xfe", b"\xc3", b"\xed\xa0\x80", b"\xf4\x90\x80\x80",
    b"\xef\xbb\xbf",
    b"\r", b"\t", b";", b",", b"#", b"{", b"}", b"[", b"]", b"</script>", b"=1+1", b"../../x", b"%s{}", b"\x1b[31m",
    "\u202e".encode(), "👩‍👩‍👧".encode(), b"\\ud800", b"\\u0000", b"__import__('os')", b"x" * 3000,
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, -0.0, 2**31, 2**53, 2**62, 2**63, 2**64, 10**30, 10**400, 1.5, 1e300, 5e-324,
    "", " ", "x" * 300,
    "\u0000", "7", "left", "cam-9", [], {}, [[]], [None], [1, 2], {"id": 1}, [{"id": True}], "2026-11-09T09:00:00",
    "9999-12-31T23:59:59.999999-14:00", "0001-01-01T00:00:00+14:00", "NaN", "metric", "\U0010ffff",
)  # fmt: skip
_NUMBER = re.compile(rb"-?\d[\d.eE:TZ+-]*")


def _at(rng: Random, data: bytes) -> int:
    return rng.randrange(len(data) + 1)


def _bytes(rng: Random, most: int) -> bytes:
    return rng.randbytes(rng.randint(1, most))


def flip_bits(rng: Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8))):
        if changed:
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def write_bytes(rng: Random, data: bytes) -> bytes:
    at, new = _at(rng, data), _bytes(rng, 8)
    return data[:at] + new + data[at + (len(new) if rng.random() < 0.5 else 0) :]


def cut_off(rng: Random, data: bytes) -> bytes:
    return data[: _at(rng, data)]


def cut_out(rng: Random, data: bytes) -> bytes:
    at = _at(rng, data)
    return data[:at] + data[at + rng.randint(1, 40) :]


def repeat_span(rng: Random, data: bytes) -> bytes:
    at = _at(rng, data)
    span = data[at : at + rng.randint(1, 200)]
    return data[:at] + span * rng.randint(2, 5) + data[at:]


def replace_number(rng: Random, data: bytes) -> bytes:
    found = list(_NUMBER.finditer(data))
    if not found:
        return write_bytes(rng, data)
    at = rng.choice(found)
    return data[: at.start()] + rng.choice(NUMBERS) + data[at.end() :]


def insert_text(rng: Random, data: bytes) -> bytes:
    at = _at(rng, data)
    return data[:at] + rng.choice(TEXTS) + data[at:]


def nest_deeply(rng: Random, data: bytes) -> bytes:
    at, depth = _at(rng, data), rng.choice((50, 900, 20_000))
    opened, closed = rng.choice(((b"[", b"]"), (b'{"a":', b"}"), (b"(", b")"), (b"-", b""), (b"1+", b"1")))
    return data[:at] + opened * depth + (closed * depth if rng.random() < 0.5 else b"") + data[at:]


def change_json(rng: Random, data: bytes) -> bytes:
    """Change the value, the type, the name or the number of one member of a JSON line."""
    try:
        value = json.loads(data)
    except ValueError:
        return replace_number(rng, data)
    places: list[tuple[Any, Any]] = []

    def walk(node: Any) -> None:
        for key in list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ():
            places.append((node, key))
            walk(node[key])

    walk(value)
    if not places:
        return insert_text(rng, data)
    node, key = rng.choice(places)
    kind = rng.randrange(6)
    if kind == 0:
        del node[key]
    elif kind == 1 and isinstance(node, dict):
        node[rng.choice(("", "v", "camera", "ts", "persons", "pairs", "id", "x_m", "seq", "quality", "extra"))] = (
            node.pop(key)
        )
    elif kind == 2 and isinstance(node, dict):  # a key that is there twice
        text = json.dumps(value)
        again = f'{{"{key}":{json.dumps(rng.choice(VALUES))},'
        return text.replace("{", again, 1).encode()
    else:
        node[key] = rng.choice(VALUES)
    return json.dumps(value, ensure_ascii=rng.random() < 0.5).encode()


def change_cells(rng: Random, data: bytes) -> bytes:
    """Change, swap, drop or add cells of a line."""
    delimiter = max((b",", b";", b"\t", b" "), key=data.count)
    cells = data.split(delimiter)
    i, j = rng.randrange(len(cells)), rng.randrange(len(cells))
    kind = rng.randrange(5)
    if kind == 0:
        cells[i], cells[j] = cells[j], cells[i]
    elif kind == 1:
        del cells[i]
    elif kind == 2:
        cells.insert(i, rng.choice(NUMBERS + TEXTS))
    else:
        cells[i] = rng.choice(NUMBERS + TEXTS)
    return delimiter.join(cells)


def very_long(rng: Random, data: bytes) -> bytes:
    at = _at(rng, data)
    return data[:at] + rng.choice((b"x", b"0", b" ", b'"', b",", b"[")) * rng.choice((5_000, 1_100_000)) + data[at:]


def _on_lines(change: Callable[[Random, list[bytes]], None]) -> Callable[[Random, bytes], bytes]:
    def changed(rng: Random, data: bytes) -> bytes:
        lines = data.split(b"\n")
        change(rng, lines)
        return b"\n".join(lines)

    return changed


def _shuffle(rng: Random, lines: list[bytes]) -> None:
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(5)
    if kind == 0:
        lines[i], lines[j] = lines[j], lines[i]
    elif kind == 1:
        del lines[i]
    elif kind == 2:
        lines.insert(i, lines[j])
    elif kind == 3:
        lines[i] += lines[j]
    else:
        lines[i:j] = []


def _ends(rng: Random, lines: list[bytes]) -> None:
    for i in range(len(lines)):
        lines[i] += rng.choice((b"", b"\r", b"\r\r", b"\n", b" "))
    if rng.random() < 0.3:
        lines[0] = b"\xef\xbb\xbf" * rng.randint(1, 2) + lines[0]


shuffle_lines = _on_lines(_shuffle)
mix_line_ends = _on_lines(_ends)

ANYWHERE: Mapping[str, Callable[[Random, bytes], bytes]] = {
    "bits flipped": flip_bits,
    "bytes written": write_bytes,
    "cut off": cut_off,
    "cut out": cut_out,
    "span repeated": repeat_span,
    "number replaced": replace_number,
    "text inserted": insert_text,
    "nested deeply": nest_deeply,
    "lines shuffled": shuffle_lines,
    "line ends mixed": mix_line_ends,
}
IN_A_LINE: Mapping[str, Callable[[Random, bytes], bytes]] = {
    "bits flipped": flip_bits,
    "bytes written": write_bytes,
    "cut off": cut_off,
    "cut out": cut_out,
    "number replaced": replace_number,
    "text inserted": insert_text,
    "nested deeply": nest_deeply,
    "JSON changed": change_json,
    "cells changed": change_cells,
    "very long": very_long,
}
PACKED: Mapping[str, Callable[[Random, bytes], bytes]] = {
    "bits flipped": flip_bits,
    "bytes written": write_bytes,
    "cut off": cut_off,
    "cut out": cut_out,
    "span repeated": repeat_span,
    "junk behind": lambda rng, data: data + _bytes(rng, 2000),
    "twice": lambda rng, data: data + data,
}


def member_name(rng: Random, name: str) -> str:
    """Return a hostile name of a member near `name`."""
    odd = (
        "../" * 5 + name, "/" + name, name.replace("/", "\\"), name + "/", "a\x00b/" + name, "CON/" + name,
        "x" * 900 + name,
        name.upper(), "\u202e" + name, "é/" + name, "./" + name, "//" + name, "", ".",
        name.rpartition("/")[2], "-/" + name,
        "gt/gt.txt", "det/det.txt", "annotations_positions/999999999.json", "objects_log/x.csv", "👩‍👧/" + name,
    )  # fmt: skip
    return rng.choice(odd)


def odd_column(rng: Random, column: pa.ChunkedArray) -> tuple[str, pa.Array]:
    """Return a column of the same length in another type, or with odd values."""
    n = len(column)
    ids = [f"t{i % 3}" for i in range(n)]
    instants = [1_794_211_200_000 + 1000 * i for i in range(n)]
    wild = [rng.choice((0, 1, -1, 2**62, -(2**62), None)) for _ in range(n)]
    reals = [rng.choice((0.0, float("nan"), float("inf"), -1e308, 1e-320, None)) for _ in range(n)]
    texts = [rng.choice((*NUMBERS[:40], *TEXTS[:10])).decode("utf-8", "replace") for _ in range(n)]
    made: dict[str, Callable[[], pa.Array]] = {
        "decimal": lambda: pa.array([Decimal(i) / 8 for i in range(n)], pa.decimal128(38, 9)),
        "decimal256": lambda: pa.array([Decimal(10) ** 60 + i for i in range(n)], pa.decimal256(76, 0)),
        "list": lambda: pa.array([[i] for i in range(n)]),
        "empty lists": lambda: pa.array([[] for _ in range(n)], pa.list_(pa.int8())),
        "struct": lambda: pa.array([{"a": i} for i in range(n)]),
        "map": lambda: pa.array([[("a", i)] for i in range(n)], pa.map_(pa.string(), pa.int64())),
        "dictionary": lambda: pa.array(ids).dictionary_encode(),
        "dictionary of numbers": lambda: pa.array([i % 3 for i in range(n)]).dictionary_encode(),
        "date32": lambda: pa.array([20_766 + i for i in range(n)], pa.int32()).cast(pa.date32()),
        "date64": lambda: pa.array([1_794_182_400_000] * n, pa.int64()).cast(pa.date64()),
        "large text": lambda: pa.array(texts, pa.large_string()),
        "text": lambda: pa.array(texts),
        "text view": lambda: pa.array(texts, pa.string_view()),
        "bytes": lambda: pa.array([rng.choice(TEXTS) for _ in range(n)], pa.binary()),
        "fixed bytes": lambda: pa.array([b"abcd"] * n, pa.binary(4)),
        "wrong UTF-8": lambda: pa.Array.from_buffers(
            pa.string(), n, pa.array([b"\xff\xed\xa0"] * n, pa.binary()).buffers()
        ),
        "int8": lambda: pa.array([i % 127 for i in range(n)], pa.int8()),
        "uint64": lambda: pa.array([2**64 - 1 - i for i in range(n)], pa.uint64()),
        "wild int64": lambda: pa.array(wild, pa.int64()),
        "float16": lambda: pa.array([float(i) for i in range(n)], pa.float16()),
        "float32": lambda: pa.array([float(i) for i in range(n)], pa.float32()),
        "wild floats": lambda: pa.array(reals, pa.float64()),
        "bool": lambda: pa.array([bool(i % 2) for i in range(n)]),
        "null": lambda: pa.nulls(n),
        "time": lambda: pa.array(list(range(n)), pa.time32("s")),
        "duration": lambda: pa.array(list(range(n)), pa.duration("s")),
        "timestamp s": lambda: pa.array([t // 1000 for t in instants], pa.timestamp("s")),
        "timestamp ns": lambda: pa.array([t * 10**6 for t in instants], pa.timestamp("ns", tz="UTC")),
        "timestamp with zone": lambda: pa.array(instants, pa.timestamp("ms", tz="Asia/Tokyo")),
        "timestamp, no such zone": lambda: pa.array(instants, pa.timestamp("ms", tz="Mars/Olympus")),
        "wild timestamp s": lambda: pa.array(wild, pa.int64()).cast(pa.timestamp("s")),
        "wild timestamp us": lambda: pa.array(wild, pa.int64()).cast(pa.timestamp("us")),
        "wild timestamp ms": lambda: pa.array(wild, pa.int64()).cast(pa.timestamp("ms", tz="UTC")),
    }
    kind = rng.choice(sorted(made))
    return kind, made[kind]()


def random_name(rng: Random) -> str:
    """Return a short name of letters."""
    return "".join(rng.choices(string.ascii_lowercase, k=rng.randint(1, 8)))
