"""SocioPatterns contact lists: a line `t i j` for two people face to face in the 20 seconds up to t.

Worn sensors note contacts of about 1.5 m or less. The lists have neither places nor distances: every pair gets the
limit as its distance (`--threshold`, 1.5 m), so that it counts as a contact at this limit and above, and quality
"relative", because no metre was measured. More columns, such as classes of people, are left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, IngestOptions, RawBatch, Rejected, Source, bytes_read
from vsd_analytics.ingest.reading.raw import BadRowError, bounded_lines, raw_table, rejected

STEP_S = 20
EPOCH_LEAST_S = 500_000_000
"""Times from here on are unix seconds (1985); smaller ones count from a start that the user must say."""
_LINE = re.compile(rb"\d{1,10}[ \t]+\w{1,20}[ \t]+\w{1,20}(?:[ \t]+\S+){0,2}[ \t]*\r?$")


class SocioPatterns:
    """Adapter of SocioPatterns contact lists."""

    name = "sociopatterns"
    coordinates = "none: pairs of ids, closer than --threshold"
    uses = frozenset({"threshold_m", "start"})

    def detects(self, source: Source) -> bool:
        """Return whether the first lines are `t i j` with times that grow in steps of 20 seconds."""
        lines = source.head(4096).split(b"\n")[:-1][:50]
        if len(lines) < 2 or not all(_LINE.fullmatch(line) for line in lines):
            return False
        times = [int(line.split()[0]) for line in lines]
        steps = [b - a for a, b in pairwise(times)]
        return all(step >= 0 and step % STEP_S == 0 for step in steps)

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the contacts, and a frame for every time that has one.

        Raises:
            InputError: E207, times count from the start of the study, and nobody says when that was.
        """
        columns: dict[str, list[object]] = {"ts_ms": [], "track_a": [], "track_b": [], "line": []}
        bad: list[Rejected] = []
        frames: dict[int, int] = {}
        start_ms: int | None = None
        with source.open() as stream:
            for number, line in bounded_lines(stream, max_bytes=options.line_max_bytes):
                try:
                    contact = _contact(line)
                    if contact is not None:
                        start_ms = _start_ms(contact[0], source, options) if start_ms is None else start_ms
                        contact = _placed(contact, start_ms)
                except BadRowError as error:
                    bad.append(rejected(number, reason=error.args[0], detail=error.args[1], record=line or b""))
                    continue
                if contact is None:
                    continue
                for name, value in zip(columns, (*contact, number), strict=True):
                    columns[name].append(value)
                frames[contact[0]] = frames.get(contact[0], 0) + 1
                if len(frames) + len(columns["line"]) + 10 * len(bad) >= BATCH_ROWS:
                    last = contact[0]
                    yield _batch(
                        columns, {t: n for t, n in frames.items() if t != last}, bad, options, bytes_read(stream)
                    )
                    columns, bad, frames = {name: [] for name in columns}, [], {last: frames[last]}
        yield _batch(columns, frames, bad, options, source.size_bytes)


def _contact(line: bytes | None) -> tuple[int, str, str] | None:
    """Return seconds and both ids of a line; None for a blank one."""
    if line is None:
        raise BadRowError("line-too-long", "the line is longer than any contact")
    cells = line.split()
    if not cells:
        return None
    if len(cells) < 3:
        raise BadRowError("too-few-columns", f"a contact is t i j; found {len(cells)} columns")
    try:
        t_s, one, other = int(cells[0]), cells[1].decode(), cells[2].decode()
    except ValueError:
        shown = cells[0][:40].decode("utf-8", "replace")
        raise BadRowError("not-a-number", f"{shown!r} is no number of seconds") from None
    if not 0 <= t_s < 10**10:
        raise BadRowError("not-a-time", f"{t_s} seconds is no time")
    return t_s, one, other


def _start_ms(t_s: int, source: Source, options: IngestOptions) -> int:
    """Return the instant that times count from, by the first of them: 1970, or the start that the user says."""
    if t_s >= EPOCH_LEAST_S:
        return 0
    if options.start is not None:
        return options.start
    raise InputError(
        f"{source.file_name} has times in seconds since a start that it does not say",
        code="E207",
        where=Where(source.name),
        why=f"its times are smaller than {EPOCH_LEAST_S:,}, so they are not unix seconds",
        fix="give the start, for example --start 2009-06-29T00:00:00+02:00",
    )


def _placed(contact: tuple[int, str, str], start_ms: int) -> tuple[int, str, str]:
    """Return a contact with UTC milliseconds; a time that counts from another start than the first is none."""
    t_s, one, other = contact
    if (t_s >= EPOCH_LEAST_S) != (start_ms == 0):
        raise BadRowError("not-a-time", f"{t_s} seconds count from another start than the first time of the file")
    return start_ms + t_s * 1000, one, other


def _batch(
    columns: dict[str, list[object]], frames: dict[int, int], bad: list[Rejected], options: IngestOptions, done: int
) -> RawBatch:
    tables = {}
    if columns["line"]:
        tables["pairs"] = raw_table(
            "pairs",
            camera=options.camera,
            **columns,
            person_a=0,
            person_b=1,
            distance_m=options.threshold_m,
            quality="relative",
        )
    if frames:
        tables["frames"] = raw_table(
            "frames", camera=options.camera, ts_ms=list(frames), n_pairs=list(frames.values()), line=0
        )
    engines = [options.engine or "SocioPatterns"]
    return RawBatch(tables, bad, done_bytes=done, engines=engines, first_line="")  # type: ignore[arg-type]
