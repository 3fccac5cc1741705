"""`vsd engine live` over three sources for a long time: memory, latency to `vsd hours`, frames, and every file written.

    python tests/live/prove_engine_live.py --minutes 60

Two sources are videos in a loop, one is a camera of the network by HTTP. The process runs below strace, which lists
every path that it or a child opens for writing, makes or renames. Nothing may be outside the project folder, and no
file may begin as a picture does. Every few minutes somebody appears in front of the network camera; the latency is the
time from then to the end of the first `vsd hours` that counts them.
"""

from __future__ import annotations

import argparse
import re
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(TESTS))
from engine.blob_video import Walk  # noqa: E402
from live.live_shop import engine_live, live_shop, status_of, stored_instants, vsd_json  # noqa: E402
from live.picture_server import PictureServer  # noqa: E402

CALLS = "open,openat,creat,rename,renameat,renameat2,link,linkat,mkdir,mkdirat,mknod,mknodat,symlink,memfd_create"
TRACE = ["strace", "-f", "-qq", "-s", "24", "-y", "-e", "signal=none", "-e", f"trace={CALLS},write,pwrite64"]
NO_FILE = ("/dev/null", "/proc/", "/dev/shm", "/dev/tty")
PICTURE_BEGINS = (r"\377\330\377", r"\211PNG", "RIFF", "BM", "II*", "P6\\n")
PICTURE_BYTES = 320 * 240 * 3


def written_paths(trace: Path, folder: Path) -> tuple[set[str], list[str], int]:
    """Return paths opened for writing, made or renamed; writes that begin as a picture; the longest write to a file."""
    paths: set[str] = set()
    pictures: list[str] = []
    longest = 0
    for line in trace.open(errors="replace"):
        if " = -1 " in line:
            continue
        call = re.search(r"^(?:\d+\s+)?(\w+)\(", line)
        if call is None:
            continue
        if call[1] in ("write", "pwrite64"):
            at = re.search(r"\(\d+<([^>]*)>, \"(.*?)\"", line)
            if at is None or not at[1].startswith("/") or at[1].startswith("/dev/"):
                continue
            number = re.search(r"= (\d+)\s*$", line)
            longest = max(longest, int(number[1]) if number else 0)
            if at[2].startswith(PICTURE_BEGINS):
                pictures.append(line.strip())
        elif call[1] not in ("open", "openat") or re.search(r"O_WRONLY|O_RDWR|O_CREAT", line):
            quoted = re.findall(r"\"([^\"]*)\"", line)
            paths.update(str(folder / path) if not path.startswith("/") else path for path in quoted)
    return paths, pictures, longest


def outside(paths: set[str], root: Path) -> list[str]:
    """Return the paths that are neither in the project nor no files at all."""
    return sorted(p for p in paths if not Path(p).is_relative_to(root) and not p.startswith(NO_FILE))


def rss_mb(pid: int) -> float | None:
    """Return the resident memory of a process in megabytes."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * 4096 / 1e6
    except (OSError, IndexError):
        return None


def main() -> int:
    """Run it and print a table; return 1 where something does not hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--every", type=float, default=4.0, help="minutes between two people who appear")
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="engine-live-"))
    root, trace = folder / "shop", folder / "trace"
    appears_s = [float("inf")]
    camera = PictureServer([Walk(lambda t: (0.0, 8.0) if appears_s[0] <= t < appears_s[0] + 20 else None)])
    names = live_shop(root, camera)
    has_strace = shutil.which("strace") is not None
    before = [*TRACE, "-o", str(trace)] if has_strace else []
    began_s = time.monotonic()
    process = engine_live(root, "--fold-every", "900", before=before)
    memory: list[tuple[float, float]] = []
    latencies_s: list[float] = []
    lags_s: list[float] = []
    next_s = 60.0
    while (at_s := time.monotonic() - began_s) < options.minutes * 60:
        time.sleep(5)
        status = status_of(root)
        used = rss_mb(status.get("pid", 0))
        if used is not None:
            memory.append((at_s, used))
            lags_s.append(status["lag_s"] or 0.0)
        if process.poll() is not None:
            print("it ended by itself:", process.communicate()[0])
            return 1
        if at_s >= next_s and at_s + 90 < options.minutes * 60:
            next_s = at_s + options.every * 60
            latencies_s.append(latency_s(root, appears_s))
            print(f"{at_s / 60:6.1f} min  {memory[-1][1]:6.1f} MB  latency {latencies_s[-1]:.2f} s", flush=True)
    pid = status_of(root)["pid"]
    import os

    os.kill(pid, signal.SIGTERM)
    stopped_s = time.monotonic()
    printed = process.communicate(timeout=60)[0]
    print(printed[-600:])
    took_s = time.monotonic() - stopped_s
    status = status_of(root)
    camera.close()
    return report(
        root, trace if has_strace else None, names, memory, latencies_s, lags_s, status, took_s, process.returncode
    )


def latency_s(root: Path, appears_s: list[float]) -> float:
    """Let somebody appear; return the seconds until a `vsd hours` that counts them has answered."""

    def n_people() -> int:
        hours = vsd_json(root, "hours", "--by", "camera")["hours"]
        return sum(h["person_records"] or 0 for h in hours if h.get("camera_id") == "cam-3")

    before = n_people()
    appears_s[0] = time.time()
    while n_people() == before:
        if time.time() > appears_s[0] + 60:
            return float("nan")
    return time.time() - appears_s[0]


def report(
    root: Path,
    trace: Path | None,
    names: list[str],
    memory: list[tuple[float, float]],
    latencies_s: list[float],
    lags_s: list[float],
    status: dict,
    stop_s: float,
    code: int,
) -> int:
    """Print the table; return 1 where something does not hold."""
    instants = stored_instants(root)
    at_s, used_mb = (np.array(column) for column in zip(*memory, strict=True))
    settled = at_s > min(300.0, at_s[-1] / 3)
    slope = np.polyfit(at_s[settled] / 3600, used_mb[settled], 1)[0]
    good = code == 0
    print("| what | measured |\n|---|---|")
    print(f"| time | {at_s[-1] / 60:.1f} min, {len(names)} sources |")
    for name in names:
        at_ms, engine = instants[name], status["engine"]["cameras"][name]
        n_stored, n_distinct = len(at_ms), len(set(at_ms))
        longest_s = float(np.diff(at_ms).max()) / 1000
        print(
            f"| {name}: pictures kept, looked at, stored, instants | {engine['pictures']:,}, {engine['processed']:,}, "
            f"{n_stored:,}, {n_distinct:,} |"
        )
        good &= n_stored == n_distinct and engine["processed"] >= n_stored >= engine["processed"] - 3
        lost = {k: engine[k] for k in ("too_slow", "hung", "not_stored")}
        lost_text = f"{', '.join(map(str, lost.values()))}, {engine['connections']}; longest gap {longest_s:.1f} s"
        print(f"| {name}: too slow, hung, not stored, connections | {lost_text} |")
    first_mb, last_mb, most_mb = used_mb[settled][0], used_mb[-1], used_mb.max()
    print(f"| memory after start, at the end, most | {first_mb:.1f}, {last_mb:.1f}, {most_mb:.1f} MB |")
    print(f"| slope of memory | {slope:+.2f} MB an hour |")
    some = np.array(latencies_s)
    if len(some):
        text = f"median {np.median(some):.1f}, most {some.max():.1f} s of {len(some)}"
        print(f"| picture to `vsd hours`, its own run included | {text} |")
        good &= bool(np.isfinite(some).all())
    print(f"| newest instant stored, behind the clock | median {np.median(lags_s):.1f}, most {max(lags_s):.1f} s |")
    print(f"| a picture takes, a running mean | {status['engine']['picture_ms']} ms |")
    print(f"| SIGTERM to the end | {stop_s:.1f} s, exit code {code} |")
    print(f"| folds; doubles they found | {status['folds']}; {status['doubles']} |")
    if trace is not None:
        paths, pictures, longest = written_paths(trace, root)
        bad = outside(paths, root)
        print(f"| paths written, outside the project | {len(paths):,}, {len(bad)} {bad[:5]} |")
        suffixes = sorted({Path(p).suffix or Path(p).name for p in paths if Path(p).is_relative_to(root)})
        print(f"| names they end with | {' '.join(suffixes)} |")
        print(f"| writes that begin as a picture; longest write | {len(pictures)}; {longest:,} bytes |")
        good &= not bad and not pictures
    print("holds" if good else "DOES NOT HOLD")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
