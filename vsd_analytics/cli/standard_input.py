"""`-` among the files: what comes through standard input, as a file of its own while it is read."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from vsd_analytics.errors import InputError, Where
from vsd_analytics.settings import Settings

NAME = "standard input"


@contextmanager
def with_standard_input(files: Sequence[str], settings: Settings) -> Iterator[tuple[list[Path], Mapping[Path, str]]]:
    """Yield the paths of files, `-` being a copy of standard input, and what messages call that copy.

    Files are read more than once: first their beginning, to see what they are. So a pipe is copied.

    Raises:
        InputError: E206, more than `unpack_max_gb` come through it.
    """
    if "-" not in files:
        yield [Path(f) for f in files], {}
        return
    with tempfile.TemporaryDirectory(prefix="vsd-input-") as folder:
        copy = Path(folder) / "input"
        _copy(copy, int(settings.unpack_max_gb * 10**9))
        yield [copy if f == "-" else Path(f) for f in files], {copy: NAME}


def _copy(path: Path, most: int) -> None:
    n_bytes = 0
    with path.open("wb") as f:
        while data := sys.stdin.buffer.read(1 << 20):
            n_bytes += len(data)
            if n_bytes > most:
                raise InputError(
                    f"{NAME} has more than {most:,} bytes",
                    code="E206",
                    where=Where(NAME),
                    why="it is copied to a file before it is read",
                    fix="split it, or raise unpack_max_gb under [ingest] in vsd.toml",
                )
            f.write(data)
