"""Folding beside listening, in a process of its own: receiving never waits, and the memory is released at its end.

The process also merges the quarantine's many small files.

`python -m vsd_analytics.live.folding STORE SITE BALLAST_MB` folds once and prints what it did as one JSON line.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from vsd_analytics.errors import VsdError
from vsd_analytics.store import quarantine
from vsd_analytics.store.store import Store, TableCounts

NICE = 5


@dataclass(frozen=True, slots=True)
class Folded(TableCounts):
    """What one fold did, with all tables.

    Attributes:
        took_s: Seconds from its start to its end.
        peak_mb: Peak memory of its process in megabytes.
        error: Why it failed; None = it did not.
    """

    took_s: float = 0.0
    peak_mb: float = 0.0
    error: str | None = None


class Folding:
    """Runs one fold at a time.

    Args:
        store: The store folder.
        site_id: Site.
        ballast_mb: Space reserved for folding on a full disk, in megabytes; see `Store`.
    """

    def __init__(self, store: Path, *, site_id: str, ballast_mb: float) -> None:
        module = "vsd_analytics.live.folding"
        self._arguments = [sys.executable, "-m", module, str(store), site_id, str(ballast_mb)]
        self._process: subprocess.Popen[bytes] | None = None
        self._began_s = 0.0

    @property
    def is_running(self) -> bool:
        """Return whether a fold was started whose end `poll` has not returned yet."""
        return self._process is not None

    def start(self) -> None:
        """Start a fold."""
        self._began_s = time.monotonic()
        self._process = subprocess.Popen(
            self._arguments, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )

    def poll(self) -> Folded | None:
        """Return what the fold did once it has ended; None while it runs or when none was started."""
        if self._process is None or self._process.poll() is None:
            return None
        process, self._process = self._process, None
        took_s = time.monotonic() - self._began_s
        out, err = (_read(stream) for stream in (process.stdout, process.stderr))
        try:
            return Folded(took_s=took_s, **json.loads(out.splitlines()[-1]))
        except (IndexError, ValueError, TypeError):
            last = err.strip().splitlines()[-1:] or [f"ended with code {process.returncode}"]
            return Folded(took_s=took_s, error=last[0][:500])

    def stop(self) -> None:
        """Kill a running fold: a fold may be killed at any moment, and the next one does its work."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


def _read(stream: IO[bytes] | None) -> str:
    if stream is None:
        return ""
    with stream:
        return stream.read().decode("utf-8", "replace")


def peak_mb() -> float:
    """Return the peak resident memory of this process, in megabytes (10^6 bytes)."""
    import resource  # missing on Windows

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak * (1 if sys.platform == "darwin" else 1024) / 1e6, 1)


def main(arguments: Sequence[str]) -> int:
    """Fold a store (its folder, site and ballast in megabytes) and print a JSON line; return the exit code."""
    with contextlib.suppress(OSError):
        os.nice(NICE)
    try:
        store = Path(arguments[0])
        folded = Store(store, site_id=arguments[1], ballast_mb=float(arguments[2])).fold()
        quarantine.tidy(store.parent / "quarantine")
    except (VsdError, OSError) as error:
        print(json.dumps({"error": f"{type(error).__name__}: {error}"[:500], "peak_mb": peak_mb()}))
        return 2
    total = sum(folded.tables.values(), TableCounts())
    print(json.dumps({**dataclasses.asdict(total), "peak_mb": peak_mb()}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
