"""Folding beside listening: a process of its own, so that receipt never waits and its memory goes with it.

It also puts the quarantine's many small files together.

`python -m vsd_analytics.live.folding STORE SITE BALLAST_MB` folds once and prints what it did as one JSON line.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

NICE = 5


@dataclass(frozen=True, slots=True)
class Folded:
    """What one fold did.

    Attributes:
        took_s: Seconds from its start to its end.
        n_new: Records the tables gained.
        n_known: Records that were delivered again, or twice.
        n_second: Records left out because another one with their key and other values was there.
        peak_mb: Peak memory of its process.
        error: Why it failed; None = it did not.
    """

    took_s: float
    n_new: int = 0
    n_known: int = 0
    n_second: int = 0
    peak_mb: float = 0.0
    error: str | None = None


class Folding:
    """Runs one fold at a time.

    Args:
        store: The store folder.
        site_id: Site.
        ballast_mb: Room kept for folding on a full disk; see `Store`.
    """

    def __init__(self, store: Path, *, site_id: str, ballast_mb: float) -> None:
        module = "vsd_analytics.live.folding"
        self._arguments = [sys.executable, "-m", module, str(store), site_id, str(ballast_mb)]
        self._process: subprocess.Popen[bytes] | None = None
        self._began_s = 0.0

    @property
    def is_running(self) -> bool:
        """Return whether a fold was started and not yet asked about after its end."""
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
            told = json.loads(out.splitlines()[-1])
            return Folded(took_s=took_s, **told)
        except (IndexError, ValueError, TypeError):
            last = err.strip().splitlines()[-1:] or [f"ended with code {process.returncode}"]
            return Folded(took_s=took_s, error=last[0][:500])

    def stop(self) -> None:
        """End a running fold at once: a fold may be ended anywhere, and the next one goes on."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


def _read(stream: IO[bytes] | None) -> str:
    if stream is None:
        return ""
    with stream:
        return stream.read().decode("utf-8", "replace")


def main(arguments: Sequence[str]) -> int:
    """Fold a store (its folder, site and ballast in megabytes) and print a JSON line; return the exit code."""
    from vsd_analytics.errors import VsdError
    from vsd_analytics.ingest import quarantine
    from vsd_analytics.ingest.quarantine import tidy
    from vsd_analytics.live.status import peak_mb
    from vsd_analytics.store import Counts, Store

    with contextlib.suppress(OSError):
        os.nice(NICE)
    try:
        store = Path(arguments[0])
        folded = Store(store, site_id=arguments[1], ballast_mb=float(arguments[2])).fold()
        quarantine.tidy(store.parent / "quarantine")
        tidy(Path(arguments[0]).parent / "quarantine")
    except (VsdError, OSError) as error:
        print(json.dumps({"error": f"{type(error).__name__}: {error}"[:500], "peak_mb": peak_mb()}))
        return 2
    total = sum(folded.tables.values(), Counts())
    told = {"n_new": total.n_new, "n_known": total.n_known, "n_second": total.n_second, "peak_mb": peak_mb()}
    print(json.dumps(told))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
